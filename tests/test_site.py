"""The site as `make docs` leaves it: whole, and nothing of it is fetched from elsewhere."""

import json
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path

import pytest

pytest.importorskip("mkdocs", reason="the site's generator is the extra docs")
pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ["clips", "gym", "learning", "sims", "skills", "takes", "web"]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site."""
    out = tmp_path_factory.mktemp("site")
    subprocess.run(["make", "tree"], cwd=ROOT, check=True)
    build = [sys.executable, "-m", "mkdocs", "build", "--site-dir", out]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return out


class Page(HTMLParser):
    """Ids of a page, and what it loads."""

    def __init__(self, path):
        super().__init__()
        self.ids, self.loads = set(), set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        said = dict(attributes)
        self.ids.add(said.get("id"))
        if tag != "a" and said.get("rel") != "canonical":
            self.loads |= {said[key] for key in ("src", "href") if said.get(key)}


def test_nothing_is_fetched_from_elsewhere(site):
    loads = {load for path in site.rglob("*.html") for load in Page(path).loads}
    assert any(load.endswith("iframe-worker.js") for load in loads)
    assert not [load for load in loads if "//" in load]


@pytest.mark.parametrize("package", PACKAGES)
def test_public_names_are_documented(site, package):
    name = f"warpdribble.{package}"
    ids = Page(site / "reference" / f"{package}.html").ids
    undocumented = {one for one in import_module(name).__all__ if f"{name}.{one}" not in ids}
    modules = {one for one in undocumented if (site / "reference" / f"{package}.{one}.html").is_file()}
    assert undocumented == modules


def test_search_finds(site):
    index = json.loads((site / "search/search_index.json").read_text(encoding="utf-8"))
    where = {entry["location"] for entry in index["docs"] if "set_root_drive" in entry["text"]}
    assert any(place.startswith("api.html") for place in where)
    assert any(place.startswith("reference/sims.html") for place in where)


def test_commands_have_their_options(site):
    text = re.sub(r"<[^>]+>", "", (site / "reference/commands.html").read_text(encoding="utf-8"))
    for option in ("--no-skin", "--usd-joints {revolute,d6,spherical}", "--shortest FLOAT", "--against"):
        assert option in text
    assert not re.search(r"-{10}|│|\bNone\|", text)


@pytest.mark.skipif(not shutil.which("chromium"), reason="needs chromium")
def test_search_works_from_the_disk(site):
    browser = ["chromium", "--headless=new", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=15000"]
    page = f"{(site / 'index.html').as_uri()}?q=restitution"
    done = subprocess.run([*browser, "--dump-dom", page], capture_output=True, text=True, timeout=120)
    assert re.search(r"md-search-result__meta\W*\d+ matching documents", done.stdout)
