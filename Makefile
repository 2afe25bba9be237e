# make setup | demo | test | test-all | bench | lint | wheel | clean
# With learning (torch):  make setup EXTRAS=dev,learn

PYTHON ?= python3
VENV   ?= .venv
EXTRAS ?= dev
PY     := $(VENV)/bin/python
STAMP  := $(VENV)/.stamp-$(EXTRAS)
WHAT   := -q -c constraints.txt -e '.[$(EXTRAS)]'

.DEFAULT_GOAL := setup
.PHONY: setup demo test test-all bench lint wheel clean

setup: $(STAMP)

# uv where there is one; pip where there is none, or where uv does not find a package.
$(STAMP): pyproject.toml constraints.txt
	@echo "setting up $(VENV): about a minute the first time"
	@$(PYTHON) -m venv $(VENV)
	@if command -v uv >/dev/null && uv pip install --python $(PY) $(WHAT); then :; \
	 else $(PY) -m pip install --disable-pip-version-check $(WHAT); fi
	@touch $@

demo: $(STAMP)
	$(PY) -m warpdribble demo

test: $(STAMP)
	$(PY) -m pytest -q -m "not slow"

test-all: $(STAMP)
	$(PY) -m pytest -q

bench: $(STAMP)
	$(PY) -m warpdribble bench step --worlds 256 --against mujoco

lint: $(STAMP)
	$(PY) -m ruff check .

wheel: $(STAMP)
	$(PY) -m build

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
