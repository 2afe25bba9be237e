"""Worlds that follow a graph: placing, copying, stepping, and what is broken."""

import numpy as np
import pytest

from warpdribble.learning.graph import STEPS
from warpdribble.learning.starts import reference_starts
from warpdribble.learning.tasks.follow import Follow, OpenLoop


@pytest.fixture
def worlds(player, graph):
    return Follow(player, graph, 5, steered=("l_hip",), pushed=("torso",))


def some(graph, *k):
    return reference_starts(graph)[list(k)]


def test_some_worlds_are_placed_and_the_others_left(worlds, graph):
    worlds.reset(some(graph, 0, 1, 2, 3, 4))
    before = worlds.sim.joint_q
    np.testing.assert_allclose(before, graph.start_q[:5], atol=1e-6)
    which = np.array([False, True, False, True, False])
    worlds.reset(some(graph, 9, 7), which)
    np.testing.assert_allclose(worlds.sim.joint_q[which], graph.start_q[[9, 7]], atol=1e-6)
    np.testing.assert_allclose(worlds.sim.joint_qd[which], graph.start_qd[[9, 7]], atol=1e-5)
    np.testing.assert_array_equal(worlds.sim.joint_q[~which], before[~which])


def test_nobody_is_placed(worlds, graph):
    worlds.reset(some(graph, 0, 1, 2, 3, 4))
    before = worlds.sim.joint_q
    worlds.reset(some(graph), np.zeros(5, bool))
    np.testing.assert_array_equal(worlds.sim.joint_q, before)


def test_each_world_steps_along_its_fragment(worlds, graph):
    """By its own rows of the table, part by part."""
    k, none = np.array([0, 3, 3, 13, 7]), np.zeros((5, 0))
    worlds.reset(some(graph, *k))
    worlds.advance(k, none, 0, 2)
    worlds.advance(k, none, 2, 3)
    parts = worlds.sim.joint_q
    worlds.reset(some(graph, *k))
    worlds.advance(k, none)
    np.testing.assert_array_equal(worlds.sim.joint_q, parts)
    np.testing.assert_array_equal(parts[1], parts[2])
    np.testing.assert_allclose(parts[:, 2], graph.goal_q[k, 2], atol=0.02)


def test_samples_are_whole_fragments(worlds, graph):
    k = np.zeros(5, int)
    worlds.reset(some(graph, *k))
    assert worlds.samples == 0 and worlds.simulating == 0.0
    for step in range(STEPS):
        worlds.advance(k, np.zeros((5, 0)), step, 1)
        assert worlds.samples == (5 if step == STEPS - 1 else 0)
    assert worlds.simulating > 0.0


def test_only_what_is_broken_has_failed(worlds, graph):
    k = np.zeros(5, int)
    worlds.reset(some(graph, *k))
    worlds.sim.port("joint_q").numpy()[2, 4] = np.nan
    worlds.advance(k, np.zeros((5, 0)))
    cost, failed = worlds.judge(k)
    np.testing.assert_array_equal(failed, [False, False, True, False, False])
    np.testing.assert_array_equal(cost, [0.0, 0.0, np.inf, 0.0, 0.0])


def test_worlds_become_others(worlds, graph):
    worlds.reset(some(graph, 0, 1, 2, 3, 4))
    before = worlds.sim.joint_q
    worlds.become(np.array([0, 0, 4, 3, 4]))
    np.testing.assert_array_equal(worlds.sim.joint_q, before[[0, 0, 4, 3, 4]])


def test_what_acts_on_it_ends(worlds, graph):
    """Offsets and pushes do something, and nothing after `calm`."""
    k, none, seen = np.zeros(5, int), np.zeros((5, 0)), []
    for offset, push, end in ((0.0, 0.0, False), (0.3, 0.0, False), (0.0, 100.0, False), (0.3, 100.0, True)):
        worlds.course.offset[:], worlds.course.push[:] = offset, push
        if end:
            worlds.calm()
        worlds.reset(some(graph, *k))
        worlds.advance(k, none)
        seen.append(worlds.sim.joint_q)
    np.testing.assert_array_equal(seen[3], seen[0])
    for other in seen[1:3]:
        assert np.abs(other - seen[0]).max() > 1e-3


def test_the_open_loop_feels_and_changes_nothing(worlds):
    k = np.zeros(5, int)
    assert worlds.observe(k).shape == (5, 0)
    assert OpenLoop().act(worlds.observe(k), k).shape == (5, 0)
    np.testing.assert_array_equal(OpenLoop(11).act(np.ones((5, 18)), k), np.zeros((5, 11)))
