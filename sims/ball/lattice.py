"""The cheapest way through a few states over time: most rows go on from one to the next, some arcs leap."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Arc:
    """A leap over the rows from `leaves` to `comes` - 1, which belong to no state."""

    leaves: int
    """First row after the state that it comes from; at least 1."""
    comes: int
    """First row of the state that it goes to; the number of rows when it leaves for good."""
    state: int
    next_state: int
    cost: float


def cheapest(
    start: np.ndarray, stay: np.ndarray, change: np.ndarray, arcs: list[Arc]
) -> tuple[np.ndarray, list[Arc], float]:
    """States (rows,), -1 inside an arc, the arcs taken, and what the way costs.

    start: (states,) cost of beginning in each. stay: (rows, states) of being there. change: (rows, states,
    states) of going from one (second index) to the other (third) at a row.
    """
    rows, states = stay.shape
    coming: dict[int, list[Arc]] = defaultdict(list)
    leaving: list[Arc] = []
    for arc in arcs:
        (coming[arc.comes] if arc.comes < rows else leaving).append(arc)
    best = np.empty((rows, states))
    came: list[list[int | Arc]] = [[0] * states]
    best[0] = start + stay[0]
    for row in range(1, rows):
        over = best[row - 1][:, None] + change[row]
        before = over.argmin(axis=0)
        best[row] = over[before, np.arange(states)]
        came.append(before.tolist())
        for arc in coming.get(row, ()):
            cost = best[arc.leaves - 1, arc.state] + arc.cost
            if cost < best[row, arc.next_state]:
                best[row, arc.next_state] = cost
                came[row][arc.next_state] = arc
        best[row] += stay[row]
    state, row, cost = int(best[-1].argmin()), rows - 1, float(best[-1].min())
    taken: list[Arc] = []
    for arc in leaving:
        if best[arc.leaves - 1, arc.state] + arc.cost < cost:
            state, row, taken = arc.state, arc.leaves - 1, [arc]
            cost = float(best[row, state]) + arc.cost
    way = np.full(rows, -1)
    while True:
        way[row] = state
        if row == 0:
            return way, taken[::-1], cost
        before = came[row][state]
        if isinstance(before, Arc):
            taken.append(before)
            state, row = before.state, before.leaves - 1
        else:
            state, row = before, row - 1
