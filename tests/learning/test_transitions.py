"""Where one skill may become another, and the bridges over which it does."""

from dataclasses import replace

import numpy as np
import pytest

from warpdribble.learning.graph import STEPS
from warpdribble.learning.transitions import BLEND, Link, alike, apart, bridge, find, linked, moved, unrolled
from warpdribble.sims import Model
from warpdribble.sims.planar import planar
from warpdribble.sims.reference.reference import difference
from warpdribble.skills import read_skill, skill_graph


@pytest.fixture(scope="module")
def model():
    return Model.load("player")


@pytest.fixture(scope="module")
def graphs():
    """The dribble of the right hand, its twin, and the one from hand to hand."""
    right, switch = read_skill("dribble-right-authored"), read_skill("switch-hands")
    skills = (right, replace(right, mirror=True, name="left"), switch)
    return [skill_graph(skill)[0] for skill in skills]


def turned_away(model, graph):
    """The same, elsewhere and facing another way."""

    def put(q):
        return moved(model, q, np.zeros(3), np.array([3.0, -1.0, 2.0]))

    turn = np.array([[np.cos(2.0), -np.sin(2.0)], [np.sin(2.0), np.cos(2.0)]])
    speed = graph.start_qd.copy()
    for joint in model.joints:
        if joint.kind == "free":
            at = joint.dof.start
            speed[:, at : at + 2] = speed[:, at : at + 2] @ turn.T
    return replace(
        graph, start_q=put(graph.start_q), goal_q=put(graph.goal_q), motion=put(graph.motion), start_qd=speed
    )


def test_it_is_the_players_own_view_that_counts(model, graphs):
    """Nobody is apart from himself, wherever he stands; and who has the ball in the other hand is far."""
    right, left, _ = graphs
    there = turned_away(model, right)
    far = apart(model, right, there)
    np.testing.assert_allclose(np.diag(far), 0.0, atol=1e-5)
    assert (far[~np.eye(right.count, dtype=bool)] > 0.02).all()
    np.testing.assert_allclose(far, apart(model, there, right).T, atol=1e-6)
    holds = [graph.touch.reshape(graph.count, STEPS, 2)[:, 0] for graph in (right, left)]
    other = (holds[0][:, None] != holds[1][None]).any(axis=-1)
    assert np.isinf(apart(model, right, left)[other]).all() and other.any() and not other.all()


def test_a_cycle_goes_on_as_itself_best(model, graphs):
    right = graphs[0]
    enters, far = alike(model, right, turned_away(model, right))
    np.testing.assert_array_equal(enters, (np.arange(right.count) + 1 + BLEND) % right.count)
    np.testing.assert_allclose(far, 0.0, atol=1e-5)


def test_unrolled_cycles_have_no_seam(model, graphs):
    there = turned_away(model, graphs[0])
    rows = unrolled(model, there, 9, 20)
    assert len(rows) == 20 * STEPS + 1
    steps = np.abs(difference(model, rows[:-1], rows[1:]))
    assert steps.max() < 1.5 * np.abs(difference(model, there.motion[:-1], there.motion[1:])).max()


def test_a_bridge_to_oneself_is_the_cycle(model, graphs):
    """It has the motion, the velocities and the contacts of the fragments in whose place it stands."""
    right = graphs[0]
    own = bridge(model, right, 1, turned_away(model, right), 5)
    np.testing.assert_allclose(own.motion, right.motion[2 * STEPS : 5 * STEPS], atol=1e-6)
    np.testing.assert_allclose(own.start_qd, right.start_qd[2:5], atol=1e-3)
    np.testing.assert_allclose(own.targets, right.targets[2 * STEPS : 5 * STEPS], atol=0.02)
    np.testing.assert_array_equal(own.touch, right.touch[2 * STEPS : 5 * STEPS])
    marks = [mark - 2 * STEPS for mark in right.checkpoints if 2 * STEPS <= mark < 5 * STEPS]
    np.testing.assert_array_equal(own.checkpoints, marks)


def test_bridges_lead_from_one_to_the_other(model, graphs):
    """They begin in the one's state and end in the other's, over the ground too; nothing jumps on the way."""
    links = find(model, graphs, within=0.35)
    assert {(link.start, link.goal) for link in links} == {(0, 2), (1, 2), (2, 0), (2, 1)}
    whole = linked(model, graphs, links)
    assert whole.count == sum(g.count for g in graphs) + BLEND * len(links)
    for span, link in zip(whole.spans[3:], links):
        first, last = span.first, span.first + BLEND - 1
        came = whole.spans[link.start].first + link.leaves
        goes = whole.spans[link.goal].first + link.enters
        assert first in whole.after(came) and list(whole.after(last)) == [goes]
        for one, other in ((came, first), (last, goes)):
            q, start = whole.goal_q[[one]], whole.start_q[[other]]
            here = moved(model, q, planar(q)[0], planar(start)[0])
            np.testing.assert_allclose(difference(model, here, start), 0.0, atol=1e-6)
        rows = whole.motion[first * STEPS : (last + 1) * STEPS]
        speed = np.abs(difference(model, rows[:-1], rows[1:]))[:, 6:] / whole.timestep
        usual = max(np.abs(difference(model, g.motion[:-1], g.motion[1:]))[:, 6:].max() for g in graphs)
        assert speed.max() < 2.0 * usual / whole.timestep


def test_who_is_unlike_is_not_linked(model, graphs):
    assert find(model, graphs, within=0.01) == []
    assert all(isinstance(link, Link) for link in find(model, graphs[:2], within=2.0, most=1))
