"""The rooms' law: imports run downward only, without a circle, and no room knows what is not its business.

`python -m warpdribble.reports.rooms` draws what is checked here.
"""

import ast
from importlib import import_module
from pathlib import Path

import pytest

from warpdribble.reports import layout
from warpdribble.reports.imports import BRIDGES, TOP, between, circles, read_tree, rooms
from warpdribble.reports.rooms import draw, label, without_circles

ROOT = Path(__file__).resolve().parents[1]

FLOORS = (
    "kernels assets",
    "sims",
    "learning",
    "clips skin takes web skills simulate gym",
    "commands benchmarks reports",
    "cli __main__",
)
"""From the bottom: nothing imports from a line above its own. Whatever is new takes its place here."""

NOT_THEIRS = {
    "kernels": "numpy scipy mujoco torch tyro rich pxr pooch trimesh matplotlib tensorboard",
    "sims": "tyro rich pxr pooch trimesh matplotlib tensorboard",
    "learning": "tyro rich pxr pooch trimesh matplotlib",
}
"""Other packages that have no business there: file formats, pictures, the command line."""

KNOWN = {
    ("takes.skel", "takes.figure"),
}
"""(who, whom): imports that break the law and are to go. Nothing is ever added here."""


def broken(tree, known=frozenset()):
    """What breaks the law, a line each, with the imports that do.

    Modules of one room may know each other's types; rooms may not.
    """
    edges = tree.ours({(f"{TOP}.{by}", f"{TOP}.{of}") for by, of in known})
    room = rooms(tree, edges)
    joined = between(edges, room)
    run = {pair: some for pair, some in edges.items() if not all(one.typed for one in some)}
    found = [*_circles("modules", run, tree), *_circles("rooms", joined, tree)]
    floor = {f"{TOP}.{name}": i for i, line in enumerate(FLOORS) for name in line.split()}
    for (by, of), imports in edges.items():
        here, there = (".".join(name.split(".")[:2]) for name in (by, of))
        if by in room and floor.get(here, -1) < floor.get(there, -1):
            found += [f"upward: {tree.said(one)}" for one in imports]
        if of not in room and (of not in BRIDGES or imports[0].name not in ("", "__version__", "lazily")):
            found += [f"through a door that names nothing of the kind: {tree.said(one)}" for one in imports]
        if by not in room and of not in BRIDGES:
            found += [f"a door that imports: {tree.said(one)}" for one in imports]
    unplaced = {".".join(name.split(".")[:2]) for name in room} - floor.keys()
    found += [f"without a line in FLOORS: {name}" for name in sorted(unplaced)]
    for name, foreign in NOT_THEIRS.items():
        used = tree.foreign(f"{TOP}.{name}")
        found += [f"not its business: {tree.said(one)}" for of in foreign.split() for one in used.get(of, [])]
    return found


def _circles(what, edges, tree):
    for circle in circles(edges):
        inside = [one for (by, of), some in edges.items() if {by, of} <= set(circle) for one in some]
        lines = "\n  ".join(dict.fromkeys(map(tree.said, inside)))
        yield f"{what} in a circle: {', '.join(circle)}\n  {lines}"


@pytest.fixture(scope="module")
def tree():
    return read_tree(ROOT)


def test_imports_run_downward(tree):
    found = broken(tree, KNOWN)
    assert not found, "\n".join(found)


@pytest.mark.parametrize("pair", sorted(KNOWN))
def test_known_breaks_are_still_there(tree, pair):
    """An entry that is no longer needed leaves KNOWN."""
    assert broken(tree, KNOWN - {pair}), f"{pair}: mended, take it out of KNOWN"


def test_every_arrow_points_downward(tree):
    edges = tree.ours()
    room = rooms(tree, edges)
    down, _ = without_circles(between(edges, room))
    shown = layout.direct(down)
    floor = layout.lifted(layout.floors(down, set(room.values())), shown)
    assert all(floor[by] > floor[of] for by, of in down)
    assert len(shown) < len(down)


def test_doors_name_what_they_load(tree):
    """Of a lazy `__init__`: names for type checkers, names that load and `__all__` are the same."""
    doors = [name for name, path in tree.modules.items() if "lazily(" in path.read_text()]
    for name in set(doors) - set(BRIDGES):
        source = ast.parse(tree.modules[name].read_text())
        typed = {
            "." * node.level + (node.module or ""): {alias.name for alias in node.names}
            for block in source.body
            if isinstance(block, ast.If)
            for node in block.body
        }
        (call,) = [n for n in ast.walk(source) if isinstance(n, ast.Call) and ast.unparse(n.func) == "lazily"]
        loaded = {module: set(names.split()) for module, names in ast.literal_eval(call.args[1]).items()}
        assert typed == loaded, name
        assert set(import_module(name).__all__) == set().union(*loaded.values()), name


MADE_UP = {
    "warpdribble/__init__.py": "",
    "warpdribble/lazy.py": "def lazily(): ...",
    "warpdribble/cli.py": "from importlib import import_module\n"
    "import_module('.commands.learn', __package__)",
    "warpdribble/commands/__init__.py": "",
    "warpdribble/commands/learn.py": "from ..clips import read_clip\nfrom ..learning.train import train",
    "warpdribble/clips/__init__.py": "from typing import TYPE_CHECKING\n"
    "if TYPE_CHECKING:\n    from .read import read_clip",
    "warpdribble/clips/read.py": "from ..sims import Model",
    "kernels/__init__.py": "",
    "kernels/step.py": "import warp",
    "sims/__init__.py": "from typing import TYPE_CHECKING\nfrom ..lazy import lazily\n"
    "if TYPE_CHECKING:\n    from .model import Model",
    "sims/model/__init__.py": "from typing import TYPE_CHECKING\n"
    "if TYPE_CHECKING:\n    from .model import Model",
    "sims/model/model.py": "",
    "sims/worlds/__init__.py": "",
    "sims/worlds/batch.py": "from ... import kernels\nfrom ..model import Model",
    "learning/__init__.py": "",
    "learning/graph.py": "from ..sims import Model",
    "learning/train.py": "from .methods.samcon import learn",
    "learning/methods/__init__.py": "",
    "learning/methods/samcon.py": "from ..graph import Graph",
}


def grow(folder, planted=None):
    """The made-up tree, with lines at the ends of some of its files."""
    for name, text in MADE_UP.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n{(planted or {}).get(name, '')}\n")
    return read_tree(folder)


def test_made_up_tree_keeps_the_law(tmp_path):
    tree = grow(tmp_path)
    assert broken(tree) == []
    edges = tree.ours()
    assert (f"{TOP}.clips.read", f"{TOP}.sims.model.model") in edges  # not the door
    assert (f"{TOP}.cli", f"{TOP}.commands.learn") in edges
    room = rooms(tree, edges)
    assert (
        room[f"{TOP}.learning.graph"] != room[f"{TOP}.learning.train"]
    )  # together they would close a circle
    assert f"{TOP}.sims" not in room


@pytest.mark.parametrize(
    "file, line, said",
    [
        ("kernels/step.py", "from ..sims.model.model import Model", "upward"),
        ("kernels/step.py", "def f():\n    from ..sims import Model", "upward"),
        ("kernels/step.py", "from warpdribble import Model", "names nothing"),
        ("kernels/step.py", "import numpy", "not its business"),
        ("sims/model/model.py", "from ...clips import read_clip", "upward"),
        ("sims/model/model.py", "import warpdribble.learning.graph", "upward"),
        ("sims/model/model.py", "from pxr import Usd", "not its business"),
        ("sims/model/model.py", "from ..worlds.batch import Batch", "rooms in a circle"),
        ("sims/worlds/batch.py", "if TYPE_CHECKING:\n    from ...learning.graph import Graph", "upward"),
        (
            "sims/model/model.py",
            "if TYPE_CHECKING:\n    from ..worlds.batch import Batch",
            "rooms in a circle",
        ),
        ("learning/graph.py", "if TYPE_CHECKING:\n    from .train import train", "rooms in a circle"),
        ("sims/worlds/batch.py", "from . import ports", ""),
        ("sims/__init__.py", "from .model.model import Model", "a door that imports"),
        ("learning/graph.py", "def f():\n    from ..commands.learn import Learn", "upward"),
        ("learning/graph.py", "import_module('..commands.learn', __package__)", "upward"),
        ("learning/graph.py", "from .train import train", "modules in a circle"),
        ("learning/graph.py", "from ..sims import Simulation", "names nothing"),
        ("warpdribble/clips/read.py", "from ..commands import learn", "upward"),
    ],
)
def test_planted_imports_are_found(tmp_path, file, line, said):
    found = broken(grow(tmp_path, {file: line}))
    if not said:
        assert found == []
        return
    assert any(said in one for one in found), found
    assert any(line.strip().splitlines()[-1].strip() in one for one in found), found


def test_picture_is_drawn(tmp_path):
    edges = {("a.x", "a.y"), ("a.y", "a.z"), ("a.x", "a.z")}
    draw(tmp_path / "rooms.png", {"a.x": 1, "a.y": 12, "a.z": 3}, edges, frozenset({("a.z", "a.x")}))
    assert (tmp_path / "rooms.png").read_bytes().startswith(b"\x89PNG")
    assert label("warpdribble.learning.graph+warpdribble.learning.rollout") == "learning: graph, rollout"
    assert label("warpdribble.__main__+warpdribble.cli") == "cli"
