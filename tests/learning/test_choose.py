"""Choosers: random walks go evenly and by unit, commands go the shortest way."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chisquare

from warpdribble.learning.choose import Ahead, Commanded, RandomWalk
from warpdribble.learning.graph import STEPS, ControlGraph, Span
from warpdribble.learning.starts import Streams


def of(edges, count, spans=()):
    """A graph with edges and nothing else that counts."""
    rows = np.zeros((count, 1))
    return ControlGraph(np.zeros((count * STEPS, 1)), rows, rows, rows, rows, edges, 0.01, spans=spans)


@st.composite
def graphs(draw):
    """Every fragment has a few that follow it; cut into spans, whose fragments may lead anywhere."""
    count = draw(st.integers(1, 9))
    after = [draw(st.sets(st.integers(0, count - 1), min_size=1, max_size=3)) for _ in range(count)]
    edges = draw(st.permutations([[k, j] for k, js in enumerate(after) for j in js]))
    cuts = sorted({0, count, *draw(st.sets(st.integers(0, count), max_size=2))})
    return of(edges, count, [Span(str(i), a, b - a) for i, (a, b) in enumerate(pairwise(cuts))])


CHAIN = of([[k, (k + 1) % 6] for k in range(6)], 6)
STAR = of([[0, 1], [0, 2], [0, 3], [1, 0], [2, 0], [3, 0]], 4)


def randoms(seed, count=1):
    return [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(count)]


# ----------------------------------------------------------------------------------------- random walks


def test_a_random_walk_goes_evenly():
    """By chi-square; one in a million would fail by chance."""
    walk, worlds = RandomWalk(Streams(randoms(1), 3000)), np.zeros(3000, int)
    often = np.bincount(walk.next(STAR, worlds), minlength=4)
    assert often[0] == 0 and chisquare(often[1:]).pvalue > 1e-6
    assert set(walk.next(STAR, worlds + 2)) == {0}


def test_the_worlds_of_a_unit_go_one_way_and_units_their_own():
    walk, seen = RandomWalk(Streams(randoms(2, 5), group=4)), []
    for _ in range(40):
        after = walk.next(STAR, np.zeros(20, int)).reshape(5, 4)
        np.testing.assert_array_equal(after, np.broadcast_to(after[:, :1], after.shape))
        seen.append(after[:, 0])
    assert len({tuple(way) for way in np.transpose(seen)}) == 5


def test_a_unit_walks_as_it_would_alone():
    several, alone = RandomWalk(Streams(randoms(3, 4))), RandomWalk(Streams(randoms(3, 4)[2:3]))
    k, own = np.zeros(4, int), np.zeros(1, int)
    for _ in range(30):
        k, own = several.next(STAR, k), alone.next(STAR, own)
        assert k[2] == own[0]


def test_where_there_is_no_choice_nothing_is_drawn():
    streams = Streams(randoms(4), 3)
    k = RandomWalk(streams).next(CHAIN, np.array([0, 4, 5]))
    np.testing.assert_array_equal(k, [1, 5, 0])
    np.testing.assert_array_equal(streams.uniform(), Streams(randoms(4), 3).uniform())


# ----------------------------------------------------------------------------------------------- ahead


def test_ahead_is_along_a_cycle_and_the_first_of_several():
    np.testing.assert_array_equal(Ahead().next(CHAIN, np.arange(6)), [1, 2, 3, 4, 5, 0])
    branching = of([[0, 2], [1, 0], [0, 1], [2, 2]], 3)
    np.testing.assert_array_equal(Ahead().next(branching, np.array([0, 0, 1])), [2, 2, 0])


# -------------------------------------------------------------------------------------------- commanded


def lengths(graph, goal):
    """Edges (fragments,) from each fragment to the nearest of `goal`, by matrix products; inf for no way."""
    step = np.zeros((graph.count, graph.count), bool)
    step[graph.edges[:, 0], graph.edges[:, 1]] = True
    reached = np.isin(np.arange(graph.count), goal)
    out = np.where(reached, 0.0, np.inf)
    for far in range(1, graph.count + 1):
        reached = reached | (step @ reached)
        out = np.where(np.isinf(out) & reached, far, out)
    return out


@settings(max_examples=200, deadline=None, derandomize=True)
@given(graph=graphs())
def test_commands_go_the_shortest_way_and_stay(graph):
    for want, span in enumerate(graph.spans):
        goal = np.arange(span.first, span.first + span.count)
        far, chooser = lengths(graph, goal), Commanded(graph, want)
        k = np.arange(graph.count)
        after = chooser.next(graph, k)
        for one, to in zip(k, after):
            allowed = graph.after(one)
            assert to in allowed and far[to] == far[allowed].min()
        for _ in range(graph.count):
            k = chooser.next(graph, k)
        if all(set(graph.after(one)) & set(goal) for one in goal):  # nothing leads them out
            np.testing.assert_array_equal(np.isin(k, goal), np.isfinite(far))


TWO = of(
    [[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [1, 4], [5, 0]],
    6,
    [Span("walk", 0, 3), Span("run", 3, 3)],
)


def test_in_its_span_a_command_goes_on_rather_than_jumps():
    jumpy = of([[0, 2], [0, 0], [0, 1], [1, 0], [1, 2], [2, 0]], 3)
    np.testing.assert_array_equal(Commanded(jumpy).next(jumpy, np.arange(3)), [1, 2, 0])
    np.testing.assert_array_equal(Commanded(TWO, 1).next(TWO, np.arange(6)), [1, 4, 0, 4, 5, 3])


def test_each_world_has_its_command_and_commands_change():
    chooser = Commanded(TWO, np.array([0, 1, 1, 0]))
    k, seen = np.array([1, 1, 3, 3]), []
    for _ in range(4):
        k = chooser.next(TWO, k)
        seen.append(k)
    assert np.transpose(seen).tolist() == [[2, 0, 1, 2], [4, 5, 3, 4], [4, 5, 3, 4], [4, 5, 0, 1]]
    chooser.want = 0
    for _ in range(4):
        k = chooser.next(TWO, k)
    assert (k < 3).all()


def test_a_span_that_there_is_not():
    with pytest.raises(IndexError):
        Commanded(TWO, 2).next(TWO, np.arange(6))
