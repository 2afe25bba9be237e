"""The pages tell the truth: snippets and commands run, and what is named exists.

A snippet runs in a temporary folder, after those before it on its page. Info strings: `python slow` for more
than a few seconds (`make test-all`), `python no-run` for what cannot run here (its imports are tried all the
same). Commands run likewise, made short.
"""

import ast
import contextlib
import dataclasses
import importlib.util
import inspect
import io
import re
import shlex
import shutil
import subprocess
import typing
from importlib import import_module
from pathlib import Path

import pytest
import tyro

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
TOP = ["warpdribble", "kernels", "sims", "learning", "assets", "benchmarks", "tests", "docs"]

FENCE = re.compile(r"^```(.*)\n((?:.*\n)*?)```$", re.M)
SPAN = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"\]\(([^)\s]+)\)")
NAME = re.compile(r"(?<![\w./-])[a-z]+(?:\.\w+)+")
FILE = re.compile(rf"(?<![\w./<:-])(?:{'|'.join(TOP)})/[\w./-]*")
BARE_FILE = re.compile(r"(?<![\w./*-])\w+\.(?:py|md)\b")
RUN = re.compile(r"\bpython3? -m (warpdribble[\w.]*)")
COMMAND = re.compile(r"(?:^|[\s/])warpdribble (?=[a-z])")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")

pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)


def fences(page, language):
    """(words after the language, text, number of the line before it) of the page's fenced blocks."""
    text = page.read_text()
    for found in FENCE.finditer(text):
        name, *words = found[1].split() or [""]
        if name == language:
            yield words, found[2], text[: found.start(2)].count("\n")


def prose(page):
    """The page without its fenced blocks."""
    return FENCE.sub("", page.read_text())


def run(page, slow):
    """Run the page's snippets, one namespace for all."""
    names = {"__name__": "__main__"}
    for words, text, line in fences(page, "python"):
        tree = ast.parse(text, str(page))
        if "no-run" in words or ("slow" in words and not slow):
            tree.body = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
        exec(compile(ast.increment_lineno(tree, line), str(page), "exec"), names)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where snippets run: with a small clip to read."""
    spec = importlib.util.spec_from_file_location("clips_for_tests", ROOT / "tests/warpdribble/conftest.py")
    made_up = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made_up)
    frames = 121
    root = [[3.0, 17.0, 40.0]] * (frames + 1)
    text = made_up.bvh_text(made_up.skeleton(), made_up.dribbling_angles(frames), root)
    (tmp_path / "clip.bvh").write_text(text)
    monkeypatch.chdir(tmp_path)


@pages
def test_snippets_run(page, folder):
    run(page, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if any("slow" in words for words, *_ in fences(page, "python"))],
    ids=lambda page: page.stem,
)
def test_slow_snippets_run(page, folder):
    run(page, slow=True)


@pages
def test_snippets_import_public_names(page):
    """From a package with `__all__`, one step below warpdribble; what is deeper may move."""
    for _, text, _ in fences(page, "python"):
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and node.module.split(".")[0] == "warpdribble":
                assert node.module.count(".") <= 1, f"{node.module} is not public"
                public = import_module(node.module).__all__
                assert {alias.name for alias in node.names} <= set(public), node.module


@pages
def test_names_exist(page):
    text = page.read_text()
    folders = {init.parent.name for init in ROOT.glob("*/__init__.py")}
    folders |= {init.parent.name for init in ROOT.glob("warpdribble/*/__init__.py")}
    for found in NAME.finditer(text):
        parts = found[0].removeprefix("warpdribble.").split(".")
        if parts[0] in folders and parts[-1] not in ("py", "md", "toml"):
            assert stands(parts), f"{page.name}: no {found[0]}"


def stands(parts):
    """Whether a dotted name below warpdribble is a module or something in one."""
    for count in range(len(parts), 0, -1):
        name = ".".join(["warpdribble", *parts[:count]])
        with contextlib.suppress(ModuleNotFoundError):
            found = import_module(name)
            for part in parts[count:]:
                found = getattr(found, part, None)
            return found is not None
    return False


@pages
def test_files_exist(page):
    text = page.read_text()
    for found in FILE.finditer(text):
        assert (ROOT / found[0].rstrip(".")).exists(), f"{page.name}: no {found[0]}"
    tracked = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True
    )
    names = {Path(line).name for line in tracked.stdout.splitlines()}
    for found in BARE_FILE.finditer(text):
        assert not names or found[0] in names, f"{page.name}: no file {found[0]}"


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=lambda page: page.stem)
def test_links_lead_somewhere(page):
    for found in LINK.finditer(FENCE.sub("", page.read_text())):
        path, _, anchor = found[1].partition("#")
        if "://" in path:
            continue
        target = (page.parent / path) if path else page
        assert target.exists(), f"{page.name}: no {path}"
        if anchor:
            heads = re.findall(r"^#+ (.*)$", target.read_text(), re.M)
            slugs = {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}
            assert anchor in slugs, f"{page.name}: no {found[1]}"


@pages
def test_modules_that_run_exist(page):
    for found in RUN.finditer(page.read_text()):
        spec = importlib.util.find_spec(found[1])
        assert spec is not None, f"{page.name}: no {found[1]}"
        if spec.submodule_search_locations is None:
            assert "__main__" in Path(spec.origin).read_text(), f"{found[1]} does nothing when it is run"


@pages
def test_targets_of_make_exist(page):
    makefile = (ROOT / "Makefile").read_text()
    text = "\n".join([*SPAN.findall(prose(page)), *(text for _, text, _ in fences(page, "sh"))])
    for target in re.findall(r"(?:^|&& )make ([a-z-]+)", text, re.M):
        assert re.search(rf"^{target}:", makefile, re.M), f"{page.name}: no make {target}"


def options(command):
    """Options of a command and of what is below it."""
    found = set()
    for field in dataclasses.fields(command):
        kind = typing.get_type_hints(command)[field.name]
        below = [part for part in typing.get_args(kind) if dataclasses.is_dataclass(part)]
        found |= {option for one in below for option in options(one)}
        name = field.name.replace("_", "-")
        found |= {f"--{name}", f"--no-{name}"}
    return found


def commands():
    from warpdribble.commands import COMMANDS

    if "bench" in COMMANDS:
        return COMMANDS
    from warpdribble.benchmarks import command

    return COMMANDS | {f"bench {name}": bench for name, bench in command.COMMANDS.items()}


def parse(arguments):
    """What the command line says against arguments, '' where it takes them."""
    from warpdribble import cli

    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        try:
            bench = commands().get(" ".join(arguments[:2]))
            if bench:
                tyro.cli(bench, args=arguments[2:])
            else:
                cli._parse(arguments)
        except SystemExit as stop:
            return said.getvalue() if stop.code else ""
    return ""


def said_commands(text):
    """Arguments of the commands in a text of shell lines: all that may be left out, the first of choices."""
    for line in text.splitlines():
        for part in line.split(" #")[0].split(";"):
            if found := COMMAND.search(part):
                rest = re.sub(r"[\[\]]", "", part[found.end() :].replace("$seed", "0"))
                words = [word.split("|")[0] for word in shlex.split(rest)]
                yield [{"A": "0", "B": "1"}.get(word, word) for word in words]


@pages
def test_commands_are_understood(page):
    for language in ("sh", ""):
        for _, text, _ in fences(page, language):
            for arguments in said_commands(text):
                assert not parse(arguments), (
                    f"{page.name}: warpdribble {' '.join(arguments)}\n{parse(arguments)}"
                )
    for span in SPAN.findall(prose(page)):
        for arguments in said_commands(span):
            # A command named in passing need not say everything that it asks for.
            tried = [arguments, [*arguments, "cmu"], [*arguments, "cmu", "--out", "run"]]
            assert any(not parse(one) for one in tried), f"{page.name}: `{span}`\n{parse(arguments)}"


SHORT = {"--seconds": "1", "--cycles": "2", "--trials": "2", "--repeat": "2", "--rounds": "1"}
"""Option -> value with which a command takes seconds."""
ADDED = {
    "demo": ["--seconds", "1"],
    "learn": ["--stage", "locomotion", "--iterations", "1"],
    "bench solve": ["--sweeps", "6", "--worlds", "16"],
}
"""What makes a command short that says none of it."""
QUICK = {"motion", "skill"}


def shortened(arguments):
    """The command as it is run here: on the clip that there is, for seconds."""
    words = ["clip.bvh" if word in ("CLIP", "06_12.bvh") else word for word in arguments]
    words = [SHORT.get(before, word) for before, word in zip(["", *words], words) if word != "--pushes"]
    if "--frames" in words:
        at = words.index("--frames")
        words[at : at + 3] = ["--frames", "0", "120"]
    more = [added for name, added in ADDED.items() if " ".join(words).startswith(name)]
    return words + [word for added in more if added[0] not in words for word in added]


def can_run(arguments):
    """Whether what a command needs is here: recordings, a GPU, minutes of learning before it."""
    from warpdribble.skills import SkillError, read_skill, skill_names
    from warpdribble.skills.staged import find_clip

    named = [read_skill(word) for word in arguments if word in skill_names()]
    if "cuda:0" in arguments or (arguments[0] == "learn" and arguments[-4:] != ADDED["learn"]):
        return False
    try:
        return all(find_clip(one) for one in named if one.clip)
    except SkillError:
        return False


def run_commands(page, wanted):
    """Run the page's commands in their order, those of which it is wanted."""
    from warpdribble import cli

    for _, text, _ in fences(page, "sh"):
        lines = [line for line in text.splitlines() if not line.startswith("for ")]
        for arguments in map(shortened, said_commands("\n".join(lines))):
            if wanted(arguments) and can_run(arguments):
                assert cli.main(arguments) == 0, f"{page.name}: warpdribble {' '.join(arguments)}"
                if arguments[0] == "learn":  # what follows is tried on a run of which every stage is there
                    out = arguments[arguments.index("--out") + 1]
                    shutil.rmtree(out)
                    shutil.copytree(ROOT / "assets/controllers/dribble-right-authored", out)


@pages
def test_quick_commands_run(page, folder):
    run_commands(page, lambda arguments: arguments[0] in QUICK)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if any(list(said_commands(text)) for _, text, _ in fences(page, "sh"))],
    ids=lambda page: page.stem,
)
def test_commands_run(page, folder):
    run_commands(page, lambda arguments: True)


def test_quoted_messages_are_said():
    """Of docs/troubleshooting.md: what stands in the first column as said by the program, is in its source.
    `...` is what differs."""
    page = ROOT / "docs/troubleshooting.md"
    texts = {
        node.value
        for folder in ("sims", "learning", "warpdribble")
        for file in (ROOT / folder).rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    rows = [line.split(" | ")[0] for line in page.read_text().splitlines() if line.startswith("| ")]
    said = [span for row in rows for span in SPAN.findall(row) if re.search(r"^[a-z.].* ", span)]
    said = [span for span in said if not span.startswith("warpdribble")]
    assert len(said) > 15
    for span in said:
        for part in filter(None, (part.strip() for part in span.split("..."))):
            assert any(part in text for text in texts), f"{page.name}: nothing says `{span}`"


@pages
def test_options_exist(page):
    known = {"--help"}.union(*(options(command) for command in commands().values()))
    for span in SPAN.findall(prose(page)):
        if span.startswith("--"):
            assert set(OPTION.findall(span)) <= known, f"{page.name}: `{span}`"


def test_calls_of_the_simulation_exist():
    """Of docs/api.md: calls in the table, with their parameters."""
    from warpdribble.sims import Simulation

    rows = [line for line in (ROOT / "docs/api.md").read_text().splitlines() if line.startswith("| `")]
    calls = [call for row in rows for call in SPAN.findall(row.split("|")[1])]
    assert len(calls) > 10
    for call in calls:
        name, _, said = call.partition("(")
        if "." in name:
            continue
        member = getattr(Simulation, name)
        if said:
            words = set(re.findall(r"(\w+)(?==|,|\))", re.sub(r"=[^,)]*", "=", said)))
            assert words <= set(inspect.signature(member).parameters), call


@pages
def test_diffs_are_of_todays_files(page):
    """What a shown diff adds, and what it leaves, stands in the file like that."""
    for _, text, _ in fences(page, "diff"):
        lines = []
        for line in text.splitlines():
            if line.startswith("+++ b/"):
                lines = (ROOT / line.removeprefix("+++ b/")).read_text().splitlines()
            elif not line.startswith("-") and line[1:].strip() != "...":
                assert line[1:] in lines, f"{page.name}: not in the file: {line}"


def test_every_room_has_its_line():
    from warpdribble.reports.imports import read_tree, rooms

    tree = read_tree(ROOT)
    packages = {name for name, path in tree.modules.items() if path.name == "__init__.py"}
    there = {
        room.removeprefix("warpdribble.") for room in rooms(tree, tree.ours()).values() if room in packages
    }
    said = re.findall(r"^\| `([\w.]+)` \|", (ROOT / "docs/contributing.md").read_text(), re.M)
    assert sorted(said) == sorted(there)


def test_moved_names_have_arrived():
    """The right column of the changelog's table."""
    rows = re.findall(r"^\| `.*` \| (`.*`) \|$", (ROOT / "CHANGELOG.md").read_text(), re.M)
    names = [name for row in rows for name in SPAN.findall(row) if re.fullmatch(r"[a-z]\w*(\.\w+)+", name)]
    assert len(names) > 20
    assert not [name for name in names if not stands(name.split("."))]


@pytest.mark.parametrize(
    "check, text",
    [
        (test_snippets_import_public_names, "```python\nfrom warpdribble.sims.model.mjcf import Shape\n```"),
        (test_snippets_import_public_names, "```python\nfrom warpdribble.sims import Shape\n```"),
        (test_names_exist, "call `sims.Simulation.stop`"),
        (test_names_exist, "`warpdribble.nothing.there`, `warpdribble.clips.read_all`"),
        (test_files_exist, "in `sims/dribble.py`"),
        (test_files_exist, "read shooting.md"),
        (test_links_lead_somewhere, "[here](nowhere.md)"),
        (test_links_lead_somewhere, "# Head\n[here](#hand)"),
        (test_modules_that_run_exist, "`python -m warpdribble.reports.all`"),
        (test_modules_that_run_exist, "`python -m warpdribble.reports.layout`"),
        (test_targets_of_make_exist, "`make everything`"),
        (test_commands_are_understood, "```sh\nwarpdribble simulate CLIP --frame 1 2\n```"),
        (test_commands_are_understood, "`warpdribble dribble`"),
        (test_commands_are_understood, "```sh\n.venv/bin/warpdribble bench step --world 3\n```"),
        (test_options_exist, "with `--skins`"),
        (test_diffs_are_of_todays_files, "```diff\n+++ b/kernels/step.py\n+import numpy\n```"),
    ],
)
def test_untrue_pages_are_found(tmp_path, check, text):
    page = tmp_path / "page.md"
    page.write_text(text + "\n")
    with pytest.raises(AssertionError):
        check(page)
