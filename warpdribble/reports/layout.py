"""A directed graph without circles laid out on floors, every edge from a higher floor to a lower one.

The four steps of Sugiyama, Tagawa and Toda 1981: floors, bends where an edge passes a floor, an order within
the floors that crosses little (sweeps of barycentres from several starts), places that bend the edges little.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from graphlib import TopologicalSorter
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import isotonic_regression, linprog

Edge = tuple[str, str]


class Bend(NamedTuple):
    """Where an edge passes a floor."""

    edge: Edge
    floor: int


Node = str | Bend


class Way(NamedTuple):
    """An edge on its way down."""

    edge: Edge
    bends: list[Bend]
    """From above."""

    @property
    def nodes(self) -> list[Node]:
        """One on every floor, ends included."""
        return [self.edge[0], *self.bends, self.edge[1]]


STARTS, SWEEPS = 60, 12
ROUNDS = 200
STRAIGHT = 3.0
"""How much harder a bend pulls at what it is tied to: long edges run straight."""


def floors(edges: Iterable[Edge], nodes: Iterable[str]) -> dict[str, int]:
    """Node -> number of edges on its longest way down. Raises graphlib.CycleError."""
    below = {node: sorted(to for by, to in edges if by == node) for node in nodes}
    found: dict[str, int] = {}
    for node in TopologicalSorter(below).static_order():
        found[node] = 1 + max((found[to] for to in below[node]), default=-1)
    return found


def lifted(floor: dict[str, int], edges: set[Edge], ground: Iterable[str] = ()) -> dict[str, int]:
    """Floors in a house of the same height such that the sum of all edges' lengths is least.

    A linear program with whole solutions (Gansner et al. 1993, A Technique for Drawing Directed Graphs,
    section 2). ground: nodes that stay at the bottom.
    """
    nodes = sorted(floor)
    at = {node: i for i, node in enumerate(nodes)}
    rows = np.zeros((len(edges), len(nodes)))
    for row, (by, to) in zip(rows, sorted(edges)):
        row[at[to]], row[at[by]] = 1.0, -1.0
    bounds = [(0, 0 if node in ground else max(floor.values())) for node in nodes]
    best = linprog(-rows.sum(axis=0), A_ub=rows, b_ub=-np.ones(len(rows)), bounds=bounds).x
    if best is None:
        raise ValueError("no floors: edges in a circle, or to a node on the ground from one that is too")
    return dict(zip(nodes, np.rint(best).astype(int).tolist()))


def direct(edges: Iterable[Edge]) -> set[Edge]:
    """Edges that no longer way implies."""
    below = defaultdict(set)
    for by, to in edges:
        below[by].add(to)

    def reach(node: str) -> set[str]:
        return below[node].union(*map(reach, below[node]))

    return {(by, to) for by, to in edges if not any(to in reach(other) for other in below[by] - {to})}


def ways(floor: dict[str, int], edges: Iterable[Edge]) -> list[Way]:
    """Edges with their bends."""
    return [
        Way(edge, [Bend(edge, k) for k in range(floor[edge[0]] - 1, floor[edge[1]], -1)])
        for edge in sorted(edges)
    ]


def order(floor: dict[str, int], lines: list[Way]) -> list[list[Node]]:
    """Nodes of every floor from left to right: of several starts what crosses least."""
    layers: list[list[Node]] = [[] for _ in range(max(floor.values()) + 1)]
    for node in sorted(floor):
        layers[floor[node]].append(node)
    for bend in (bend for line in lines for bend in line.bends):
        layers[bend.floor].append(bend)
    links = [link for line in lines for link in pairwise(line.nodes)]
    random = np.random.default_rng(0)
    best, least = layers, crossings(layers, links)
    for _ in range(STARTS):
        tried = [[layer[i] for i in random.permutation(len(layer))] for layer in layers]
        for sweep in range(SWEEPS):
            _sort(tried, links, upward=sweep % 2 == 0)
            count = crossings(tried, links)
            if count < least:
                best, least = [list(layer) for layer in tried], count
    return best


def crossings(layers: list[list[Node]], links: list[tuple[Node, Node]]) -> int:
    """Pairs of links between neighbouring floors that cross."""
    place = {node: (k, i) for k, layer in enumerate(layers) for i, node in enumerate(layer)}
    rows = np.array([(*place[by], place[to][1]) for by, to in links], int).reshape(-1, 3)
    same = rows[:, None, 0] == rows[None, :, 0]
    turned = (rows[:, None, 1] - rows[None, :, 1]) * (rows[:, None, 2] - rows[None, :, 2]) < 0
    return int(np.count_nonzero(same & turned)) // 2


def places(
    layers: list[list[Node]], lines: list[Way], width: dict[Node, float], gap: float
) -> dict[Node, float]:
    """Node -> its middle: near what it is tied to, as far as its neighbours on the floor let it."""
    x: dict[Node, float] = {}
    least: dict[Node, float] = {}
    for layer in layers:
        edge = 0.0
        for node in layer:
            least[node] = edge + width[node] / 2
            edge += width[node] + gap
        x |= {node: least[node] - edge / 2 for node in layer}
    tied: dict[Node, list[tuple[Node, float]]] = {node: [] for node in x}
    for line in lines:
        for by, to in pairwise(line.nodes):
            pull = 1.0 + STRAIGHT * (isinstance(by, Bend) + isinstance(to, Bend))
            tied[by].append((to, pull))
            tied[to].append((by, pull))
    for sweep in range(ROUNDS):
        for layer in layers if sweep % 2 else reversed(layers):
            wish = np.array([_mean(tied[node], x, x[node]) for node in layer])
            free = isotonic_regression(wish - [least[node] for node in layer]).x
            x |= {node: float(v) + least[node] for node, v in zip(layer, free)}
    return x


def _mean(tied: list[tuple[Node, float]], x: dict[Node, float], otherwise: float) -> float:
    if not tied:
        return otherwise
    return float(np.average([x[node] for node, _ in tied], weights=[pull for _, pull in tied]))


def _sort(layers: list[list[Node]], links: list[tuple[Node, Node]], upward: bool) -> None:
    """Sort the floors one after the other by the mean place of what their nodes are tied to."""
    place = {node: i / len(layer) for layer in layers for i, node in enumerate(layer)}
    for layer in layers if upward else reversed(layers):
        tied: dict[Node, list[tuple[Node, float]]] = {node: [] for node in layer}
        for by, to in links:
            here, there = (by, to) if upward else (to, by)
            if here in tied:
                tied[here].append((there, 1.0))
        layer.sort(key=lambda node: _mean(tied[node], place, place[node]))
        place |= {node: i / len(layer) for i, node in enumerate(layer)}
