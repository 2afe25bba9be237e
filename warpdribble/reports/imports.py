"""Who imports whom: the source's imports, read without running it, and the rooms that they join.

A room is a package. Imports inside functions, under TYPE_CHECKING and by `import_module("...")` count like
those at a file's top: who names another's type knows it too. `from ..sims import Model` is an import of the
module in which Model stands. The packages' `__init__`s, the doors, tell that, under TYPE_CHECKING; so there,
and only there, what stands under TYPE_CHECKING is no import.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

TOP = "warpdribble"
BRIDGES = (TOP, f"{TOP}.lazy")
"""Modules without a room: everybody stands on them and they import nothing."""

Imports = dict[tuple[str, str], list["Import"]]
"""(who imports, what is imported) -> the imports."""


class Import(NamedTuple):
    """By which module, of which (of ours, or the top name of another package), what of it, and where."""

    by: str
    of: str
    name: str
    line: int
    typed: bool
    """Under TYPE_CHECKING."""


@dataclass
class Tree:
    """The source as modules and imports."""

    modules: dict[str, Path]
    """Name, as it is imported -> file."""
    imports: list[Import]

    def ours(self, without: set[tuple[str, str]] | None = None) -> Imports:
        """Imports between our modules, but for those of pairs (by, of)."""
        found: Imports = defaultdict(list)
        for one in self.imports:
            if one.of in self.modules and one.of != one.by and (one.by, one.of) not in (without or set()):
                found[one.by, one.of].append(one)
        return dict(found)

    def foreign(self, below: str) -> dict[str, list[Import]]:
        """Other packages that the modules of a package import."""
        found = defaultdict(list)
        for one in self.imports:
            if one.of not in self.modules and within(one.by, below):
                found[one.of].append(one)
        return dict(found)

    def said(self, one: Import) -> str:
        """`file:line: source` of an import."""
        path = self.modules[one.by]
        return f"{path}:{one.line}: {path.read_text(encoding='utf-8').splitlines()[one.line - 1].strip()}"


def read_tree(root: Path) -> Tree:
    """Modules and imports of a checkout: of every folder at its top that is a package."""
    modules = {}
    for init in sorted(root.glob("*/__init__.py")):
        for path in sorted(init.parent.rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            parts = parts if parts[0] == TOP else (TOP, *parts)
            modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    files = {name: _File(name, path) for name, path in modules.items()}
    imports = [
        Import(name, _stands_in(files, of, wanted), wanted, line, typed)
        for name, file in files.items()
        for of, wanted, line, typed in file.imports
    ]
    return Tree(modules, sorted(set(imports)))


def rooms(tree: Tree, edges: Imports) -> dict[str, str]:
    """Module -> room. Loose modules, those beside the sub-packages of a package, share a room as far as that
    closes no circle; its name is theirs, joined by '+'. BRIDGES and the `__init__`s of packages with
    sub-packages have none."""
    packages = {name for name, path in tree.modules.items() if path.name == "__init__.py"}
    halls = {name.rpartition(".")[0] for name in packages}
    found = {}
    for name in tree.modules:
        package = name if name in packages else name.rpartition(".")[0]
        if name not in BRIDGES and not (name in packages and name in halls):
            found[name] = name if package in halls else package
    for hall in sorted(halls):
        loose = [name for name, room in found.items() if name == room and name.rpartition(".")[0] == hall]
        found |= _shared(found, edges, [name for name in loose if name not in packages])
    return found


def between(edges: Imports, room: dict[str, str]) -> Imports:
    """Imports between rooms."""
    found: Imports = defaultdict(list)
    for (by, of), imports in edges.items():
        if by in room and of in room and room[by] != room[of]:
            found[room[by], room[of]] += imports
    return dict(found)


def circles(edges: Collection[tuple[str, str]]) -> list[list[str]]:
    """Sets of nodes each of which reaches all others."""
    nodes = sorted({node for edge in edges for node in edge})
    at = {node: i for i, node in enumerate(nodes)}
    pairs = np.array([(at[by], at[of]) for by, of in edges], int).reshape(-1, 2)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(nodes),) * 2)
    count, part = connected_components(graph, connection="strong")
    members = [[node for node in nodes if part[at[node]] == k] for k in range(count)]
    return [nodes for nodes in members if len(nodes) > 1]


def within(name: str, package: str) -> bool:
    """Whether a name is a package's or of something in it."""
    return name == package or name.startswith(package + ".")


def _shared(room: dict[str, str], edges: Imports, loose: list[str]) -> dict[str, str]:
    """Loose modules -> names of the rooms that they share; the lowest first, so that the most are found."""
    height = {name: len(_reach(edges, name)) for name in loose}
    groups: list[list[str]] = []
    for name in sorted(loose, key=lambda name: (height[name], name)):
        for group in groups:
            tried = room | dict.fromkeys([*group, name], "tried")
            if not any("tried" in circle for circle in circles(between(edges, tried))):
                group.append(name)
                break
        else:
            groups.append([name])
    return {name: "+".join(sorted(group)) for group in groups for name in group}


def _reach(edges: Imports, name: str) -> set[str]:
    seen, todo = set(), [name]
    while todo:
        here = todo.pop()
        todo += [of for by, of in edges if by == here and of not in seen]
        seen |= {of for by, of in edges if by == here}
    return seen


class _File:
    """What a file imports, and where the names of an `__init__` stand."""

    def __init__(self, name: str, path: Path):
        self.name = name
        self.package = name if path.name == "__init__.py" else name.rpartition(".")[0]
        tree = ast.parse(path.read_text(encoding="utf-8"), str(path))
        self.names: dict[str, tuple[str, str]] = {}
        """Of an `__init__`: public name -> module and name there."""
        blocks = [n for n in ast.walk(tree) if isinstance(n, ast.If) and "TYPE_CHECKING" in ast.dump(n.test)]
        typed = {inner for block in blocks for line in block.body for inner in ast.walk(line)}
        door = path.name == "__init__.py"
        if door:
            for node in ast.walk(tree):
                if isinstance(node, ast.ImportFrom):
                    origin = self._absolute(node)
                    self.names |= {a.asname or a.name: (origin, a.name) for a in node.names}
        self.imports = [
            (*one, node in typed)
            for node in ast.walk(tree)
            if not (door and node in typed)
            for one in self._imports(node)
        ]
        """(module, name in it or '', line, whether for types only)."""

    def _imports(self, node: ast.AST) -> list[tuple[str, str, int]]:
        if isinstance(node, ast.Import):
            return [(alias.name, "", node.lineno) for alias in node.names]
        if isinstance(node, ast.ImportFrom):
            return [(self._absolute(node), alias.name, node.lineno) for alias in node.names]
        if isinstance(node, ast.Call) and "import_module" in ast.dump(node.func):
            said = node.args[0].value if node.args and isinstance(node.args[0], ast.Constant) else None
            if isinstance(said, str):
                level = len(said) - len(said.lstrip("."))
                return [(self._above(level, said[level:]), "", node.lineno)]
        return []

    def _absolute(self, node: ast.ImportFrom) -> str:
        return self._above(node.level, node.module or "")

    def _above(self, level: int, name: str) -> str:
        parts = self.package.split(".")[: 1 - level or None] if level else []
        return ".".join([*parts, name] if name else parts)


def _stands_in(files: dict[str, _File], module: str, name: str) -> str:
    """The module behind `from module import name`; the top name of what is not ours."""
    if not within(module, TOP):
        return module.partition(".")[0]
    if f"{module}.{name}" in files:
        return f"{module}.{name}"
    if module in files and name in files[module].names:
        origin, there = files[module].names[name]
        if within(origin, TOP) and (origin, there) != (module, name):
            return _stands_in(files, origin, there)
    return module
