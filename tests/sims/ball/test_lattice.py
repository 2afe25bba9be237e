"""The cheapest way is the cheapest of all, each of which is tried on small problems."""

import numpy as np
import pytest

from warpdribble.sims.ball.lattice import Arc, cheapest


def every_way(start, stay, change, arcs):
    """(cost, states) of every way there is, found by going on from each in turn."""
    rows, states = stay.shape
    open_ways = [(start[s] + stay[0, s], (s,)) for s in range(states)]
    while open_ways:
        cost, way = open_ways.pop()
        row, state = len(way), way[-1]
        if row == rows:
            yield cost, way
            continue
        for s in range(states):
            open_ways.append((cost + change[row, state, s] + stay[row, s], (*way, s)))
        for arc in arcs:
            if (arc.leaves, arc.state) != (row, state):
                continue
            flown = (*way, *[-1] * (arc.comes - arc.leaves))
            if arc.comes == rows:
                yield cost + arc.cost, flown
            else:
                landed = arc.next_state
                open_ways.append((cost + arc.cost + stay[arc.comes, landed], (*flown, landed)))


@pytest.mark.parametrize("seed", range(20))
def test_no_way_is_cheaper(seed):
    random = np.random.default_rng(seed)
    rows, states = 6, 3
    start, stay = random.uniform(0, 3, states), random.uniform(-1, 1, (rows, states))
    change = random.uniform(0, 2, (rows, states, states))
    arcs = []
    for _ in range(8):
        leaves = int(random.integers(1, rows - 1))
        comes = int(random.integers(leaves + 1, rows + 1))
        arcs.append(Arc(leaves, comes, *random.integers(0, states, 2).tolist(), random.uniform(-3, 1)))
    least, states_of_least = min(every_way(start, stay, change, arcs))
    way, taken, cost = cheapest(start, stay, change, arcs)
    assert cost == pytest.approx(least)
    assert tuple(way) == states_of_least
    assert sum(arc.comes - arc.leaves for arc in taken) == (way == -1).sum()


def test_one_row_is_a_way():
    way, taken, cost = cheapest(np.array([2.0, 1.0]), np.array([[0.0, 0.5]]), np.zeros((1, 2, 2)), [])
    assert (way.tolist(), taken, cost) == ([1], [], 1.5)
