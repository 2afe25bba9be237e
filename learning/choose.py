"""Choosers: which fragment of a control graph comes next."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from .graph import ControlGraph
    from .starts import Streams


class Chooser(Protocol):
    """Picks a successor for every world."""

    def next(self, graph: ControlGraph, k: np.ndarray) -> np.ndarray:
        """(worlds,) fragments that follow fragments k (worlds,)."""
        ...


class RandomWalk:
    """One of the fragments that may follow, drawn evenly; a unit of the streams goes one way."""

    def __init__(self, streams: Streams):
        self.streams = streams

    def next(self, graph: ControlGraph, k: np.ndarray) -> np.ndarray:
        if not graph.branches:
            return graph.follow(k)
        return graph.follow(k, self.streams.worlds(self.streams.uniform()))


class Ahead:
    """The first that may follow: along a cycle, or a clip."""

    def next(self, graph: ControlGraph, k: np.ndarray) -> np.ndarray:
        return graph.follow(k)


class Commanded:
    """The shortest way to a span of the graph, where it then stays: `want` is its number, for all worlds or
    for each."""

    def __init__(self, graph: ControlGraph, want: int | np.ndarray = 0):
        self.want = want
        self._next = np.stack([_toward(graph, span.first, span.count) for span in graph.spans])

    def next(self, graph: ControlGraph, k: np.ndarray) -> np.ndarray:
        return np.asarray(self._next[np.broadcast_to(self.want, np.shape(k)), k])


def _toward(graph: ControlGraph, first: int, count: int) -> np.ndarray:
    """For each fragment (fragments,) the successor that is nearest to a span; those in it stay in it."""
    inside = np.arange(first, first + count)
    far = np.full(graph.count, graph.count)
    far[inside] = 0
    line = deque(inside.tolist())
    while line:
        at = line.popleft()
        for before in graph.edges[graph.edges[:, 1] == at, 0]:
            if far[before] == graph.count:
                far[before] = far[at] + 1
                line.append(int(before))
    best = [min(graph.after(k), key=lambda j: (far[j], j != k + 1, j)) for k in range(graph.count)]
    return np.array(best)
