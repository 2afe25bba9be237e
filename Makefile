# make setup | demo | test | test-all | bench | lint | types | docs | wheel | clean
# EXTRAS: what is set up beside the client's own needs. The demo sets up none where nothing is set up yet.

PYTHON ?= python3
VENV   ?= .venv
EXTRAS ?= dev,docs,gym,learn,onnx
PY     := $(VENV)/bin/python
BARE   := $(VENV)/.stamp-
STAMP  := $(BARE)$(EXTRAS)
# A worker fills a core. It takes whole files, whose tests share what is dear to make.
TEST   := $(PY) -m pytest -q -n auto --maxprocesses 4 --dist loadfile
WHAT    = -q -c constraints.txt -e '.$(patsubst %,[%],$(@:$(BARE)%=%))'

.DEFAULT_GOAL := setup
.PHONY: setup demo test test-all bench lint tree types docs wheel clean

setup: $(STAMP)

# uv where there is one; pip where there is none, or where uv does not find a package.
$(sort $(STAMP) $(BARE)): pyproject.toml constraints.txt
	@echo "setting up $(VENV): about a minute the first time"
	@$(PYTHON) -m venv $(VENV)
	@if command -v uv >/dev/null && uv pip install --python $(PY) $(WHAT); then :; \
	 else $(PY) -m pip install --disable-pip-version-check $(WHAT); fi
	@touch $@

demo: $(or $(wildcard $(STAMP)),$(BARE))
	$(PY) -m warpdribble demo --overwrite

test: $(STAMP)
	$(TEST) -m "not slow"

test-all: $(STAMP)
	$(TEST)

bench: $(STAMP)
	$(PY) -m warpdribble bench step --worlds 256 --against mujoco

lint: $(STAMP)
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .

# What reads source and runs none follows no __path__: it sees the packages as links in one folder.
INSIDE := $(filter-out %__pycache__ warpdribble,$(wildcard warpdribble/*) $(patsubst %/__init__.py,%,$(wildcard */__init__.py)))
tree:
	@mkdir -p .typing/warpdribble && find -L .typing -type l -delete
	@ln -sfn $(addprefix ../../,$(INSIDE)) .typing/warpdribble

types: $(STAMP) tree
	$(PY) -m mypy

docs: $(STAMP) tree
	NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build
	@echo "build/site/index.html opens in any browser, from the disk too"

wheel: $(STAMP)
	$(PY) -m build

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache .typing .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
