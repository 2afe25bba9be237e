"""The folders import as warpdribble.* from a wheel, an sdist, an editable or bare checkout.

Everything is built from a copy of the tree, offline, with the installed setuptools.
"""

import compileall
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile
from importlib import import_module
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).resolve().parents[1]
TOP = ["warpdribble", "kernels", "sims", "learning", "assets", "benchmarks"]
PACKAGES = {
    ".".join(dict.fromkeys(["warpdribble", *init.parent.relative_to(ROOT).parts])): init.parent
    for top in TOP
    for init in sorted((ROOT / top).rglob("__init__.py"))
}
"""Import name -> folder of every package there is."""
NOT_SOURCE = shutil.ignore_patterns(
    ".git", ".venv*", "venv*", "build", "dist", "out", "*.egg-info", "__pycache__", ".*_cache",
    ".typing", ".hypothesis", "shared",
)  # fmt: skip

KINDS = {
    "warpdribble": {".py", ".typed"},
    "warpdribble/assets": {".csv", ".json", ".md", ".npz", ".py", ".toml", ".xml"},
    "warpdribble/assets/replay": {".LICENSE", ".html", ".js"},
}
"""Folder of the wheel -> the kinds of files in it, and below where no other folder is nearer."""
LARGEST = 4e6
"""Bytes of a wheel, so that a recording or a run does not slip in."""

IMPORT_ALL = f"""
from importlib import import_module, resources
for name in {list(PACKAGES)}:
    module = import_module(name)
    print(module.__name__, module.__file__)
    for public in getattr(module, "__all__", []):
        assert hasattr(module, public), (name, public)
assert (resources.files("warpdribble.assets") / "player.xml").is_file()
"""


def run(*command, cwd):
    done = subprocess.run([*map(str, command)], cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def copy_tree(to):
    return shutil.copytree(ROOT, to, ignore=NOT_SOURCE)


def build(kind, tree, out):
    """Let setuptools build one wheel or sdist of tree; returns its path."""
    pytest.importorskip("setuptools", minversion="77")
    script = f"from setuptools import build_meta as b; print(b.build_{kind}({str(out)!r}))"
    return out / run(sys.executable, "-c", script, cwd=tree).splitlines()[-1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel of the tree as it is."""
    out = tmp_path_factory.mktemp("wheel")
    return build("wheel", copy_tree(out / "tree"), out)


def make_env(folder):
    """An environment without warpdribble that sees this one's other packages; returns its python.

    A path in a .pth file comes last and its own .pth files (an editable install's) are not read.
    """
    run(sys.executable, "-m", "venv", "--without-pip", folder, cwd=folder.parent)
    paths = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (site,) = folder.glob("lib/python*/site-packages")
    (site / "others.pth").write_text("\n".join(sorted(paths)))
    return folder / "bin" / "python"


def install(env_python, *what):
    offline = ["--no-index", "--no-deps", "--no-build-isolation", "--ignore-installed"]
    pip = [sys.executable, "-m", "pip", "--python", env_python]
    run(*pip, "install", "-q", *offline, *what, cwd=env_python.parent)


def check_imports(env_python, cwd, below):
    """All packages import, from below this folder, and the player is found."""
    files = [line.split()[1] for line in run(env_python, "-c", IMPORT_ALL, cwd=cwd).splitlines()
             if line.startswith("warpdribble")]  # fmt: skip
    assert len(files) == len(PACKAGES)
    assert all(Path(file).is_relative_to(below) for file in files), files


def test_bare_checkout_imports(tmp_path):
    tree = copy_tree(tmp_path / "tree")
    check_imports(make_env(tmp_path / "env"), cwd=tree, below=tree)


@pytest.mark.slow
@pytest.mark.parametrize("via_sdist", [False, True], ids=["wheel", "sdist-wheel"])
def test_wheel_imports(tmp_path, via_sdist):
    tree = copy_tree(tmp_path / "tree")
    if via_sdist:
        with tarfile.open(build("sdist", tree, tmp_path)) as sdist:
            sdist.extractall(tmp_path / "sdist", filter="data")
        (tree,) = (tmp_path / "sdist").iterdir()
        assert (tree / "warpdribble" / "py.typed").is_file()
    compileall.compile_dir(tree / "assets", quiet=1)  # must not end in the wheel
    wheel = build("wheel", tree, tmp_path)

    names = set(zipfile.ZipFile(wheel).namelist())
    for folder in TOP:
        prefix = "" if folder == "warpdribble" else "warpdribble/"
        pattern = "*" if folder == "assets" else "*.py"
        files = [f.relative_to(ROOT) for f in (ROOT / folder).rglob(pattern) if f.is_file()]
        expected = {prefix + f.as_posix() for f in files if "__pycache__" not in f.parts}
        assert expected <= names, expected - names
    assert "warpdribble/py.typed" in names
    assert not [n for n in names if "__pycache__" in n or n.startswith(("tests", "kernels"))]

    env_python = make_env(tmp_path / "env")
    install(env_python, wheel)
    check_imports(env_python, cwd=tmp_path, below=tmp_path / "env")


@pytest.mark.slow
def test_editable_imports_and_sees_edits(tmp_path):
    pytest.importorskip("setuptools", minversion="77")
    tree = copy_tree(tmp_path / "tree")
    env_python = make_env(tmp_path / "env")
    install(env_python, "-e", tree)
    check_imports(env_python, cwd=tmp_path, below=tree)
    (tree / "sims" / "just_added.py").write_text("")
    run(env_python, "-c", "import warpdribble.sims.just_added", cwd=tmp_path)


@pytest.mark.slow
def test_wheel_holds_these_kinds_of_files(wheel):
    found = {folder: set() for folder in KINDS}
    for path in map(PurePosixPath, zipfile.ZipFile(wheel).namelist()):
        if not path.parts[0].endswith(".dist-info"):
            near = next(str(up) for up in path.parents if str(up) in KINDS)
            found[near].add(path.suffix or path.name)
    assert found == KINDS
    assert wheel.stat().st_size < LARGEST


@pytest.mark.slow
def test_wheel_names_the_licences_of_what_is_in_it(wheel):
    names = {PurePosixPath(name).name for name in zipfile.ZipFile(wheel).namelist() if "/licenses/" in name}
    assert names == {"LICENSE", "NOTICE.md", "three.LICENSE"}


@pytest.mark.slow
def test_commands_of_a_wheel_run_from_any_folder(tmp_path, wheel):
    install(make_env(tmp_path / "env"), wheel)
    (folder := tmp_path / "elsewhere").mkdir()
    command = tmp_path / "env" / "bin" / "warpdribble"
    assert "simulate" in run(command, "--help", cwd=folder)
    assert "switch-hands" in run(command, "skill", "list", cwd=folder)
    run(command, "demo", "--seconds", "2", cwd=folder)
    there = {path.name for path in (folder / "out").iterdir()}
    assert there == {"demo.usdc", "demo.html", "demo.png", "demo.plots.png"}


@pytest.mark.slow
def test_version_comes_from_the_package(wheel):
    import warpdribble

    assert wheel.name.split("-")[1] == warpdribble.__version__


def test_version_is_the_same_everywhere():
    import warpdribble

    heads = re.findall(r"^## \[(.*?)\]", (ROOT / "CHANGELOG.md").read_text(), re.M)
    cited = re.search(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(), re.M)
    assert next(head for head in heads if head != "Unreleased") == warpdribble.__version__ == cited[1]


def test_pyproject_lists_what_exists():
    setuptools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert sorted(setuptools["packages"]) == sorted(PACKAGES)
    assert sorted(setuptools["package-dir"].values()) == sorted(TOP)


def test_hook_runs_what_ci_runs():
    """What the pre-commit hook installs for itself is pinned to what the dev extra pins."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    wanted = (line.partition(";")[0].strip() for line in extras["dev"])
    pinned = dict(line.split("==") for line in wanted if "==" in line)
    assert {"mypy", "ruff"} <= set(pinned)
    hook = (ROOT / ".pre-commit-config.yaml").read_text()
    lists = re.findall(r"additional_dependencies: \[(.*)\]", hook)
    assert lists and hook.count("additional_dependencies") == len(lists)
    for package in (name.strip() for several in lists for name in several.split(",")):
        name, _, version = package.partition("==")
        assert pinned.get(name) == version, package


def test_public_names_are_no_modules():
    """A module of the same name would take the name's place once it is imported."""
    for name, folder in PACKAGES.items():
        public = getattr(import_module(name), "__all__", [])
        beside = {p.stem for p in folder.iterdir()} - {"__init__"}
        assert not beside & set(public), name


def test_import_is_light():
    heavy = ["torch", "pxr", "warp", "mujoco", "numpy", "matplotlib"]
    script = f"import sys, warpdribble; print([m for m in {heavy} if m in sys.modules])"
    assert run(sys.executable, "-c", script, cwd=ROOT).strip() == "[]"


def test_unknown_name_is_an_attribute_error():
    import warpdribble

    with pytest.raises(AttributeError, match="no_such_name"):
        _ = warpdribble.no_such_name


def test_no_file_names_a_path_of_one_machine(tmp_path):
    private = re.compile(r"(?<![\w.])/(home|Users|root|work|workspace)/\w|[A-Z]:\\Users\\")
    found = []
    for file in copy_tree(tmp_path / "tree").rglob("*"):
        try:
            text = file.read_text() if file.is_file() else ""
        except UnicodeDecodeError:
            continue
        found += [f"{file.name}: {line}" for line in text.splitlines() if private.search(line)]
    assert not found
