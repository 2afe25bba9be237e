"""Recordings: what is recorded is what is learned, and its reference walks on from where the player began."""

from dataclasses import replace

import numpy as np
import pytest

from warpdribble.learning.choose import Ahead, RandomWalk
from warpdribble.learning.evaluate.record import record
from warpdribble.learning.graph import STEPS, joined
from warpdribble.learning.methods import STAGES
from warpdribble.learning.rollout import Rollout
from warpdribble.learning.runs.folder import Run
from warpdribble.learning.starts import Streams, reference_starts
from warpdribble.learning.tasks.disturbance import Disturbance, Disturber
from warpdribble.learning.tasks.follow import OpenLoop
from warpdribble.sims.planar import composed, planar, relative


@pytest.fixture(scope="module")
def learned():
    return Run.load("dribble-right-authored").learned(STAGES, "locomotion")


def streams(seed, worlds=1):
    return Streams([np.random.default_rng(seed)], worlds)


def test_a_recording_steps_as_learning_does(learned):
    task, other, drawn = learned.task(1), learned.task(1), streams(5)
    (seen,) = record(task, learned.controller, learned.starts.draw(drawn), 20, chooser=RandomWalk(drawn))
    assert len(seen.joint_q) == len(seen.body_q) == len(seen.reference_q) == 20 * STEPS + 1
    assert seen.duration == pytest.approx(1.0) and seen.wall_time > 0.0
    drawn = streams(5)
    start = learned.starts.draw(drawn)
    for _ in Rollout(other, learned.controller, RandomWalk(drawn), start).fragments(20):
        pass
    np.testing.assert_array_equal(seen.joint_q[0], start.joint_q[0].astype(np.float32))
    np.testing.assert_array_equal(seen.joint_q[-1], other.sim.joint_q[0])
    np.testing.assert_array_equal(seen.body_q[-1], other.sim.body_q[0])


def test_some_of_the_worlds_are_recorded_as_they_are_beside_all(learned):
    begin = learned.starts.draw(streams(1, 5))

    def pushed():
        return Disturber(Disturbance(push=200.0, push_every=0.5), streams(2, 5))

    whole = record(learned.task(5), learned.controller, begin, 6, worlds=range(5), disturber=pushed())
    some = record(learned.task(5), learned.controller, begin, 6, worlds=(3, 0), disturber=pushed())
    for one, other in zip(some, (whole[3], whole[0])):
        for name in ("joint_q", "body_q", "reference_q"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_progress_is_said(learned):
    done = []
    record(learned.task(1), learned.controller, learned.starts.draw(streams(1)), 4, progress=done.append)
    assert done == [1, 2, 3, 4]


def test_who_breaks_is_left_out(learned):
    task, begin = learned.task(3), learned.starts.draw(streams(1, 3))
    whole = record(task, learned.controller, begin, 4, worlds=range(3))
    step, calls = task.course.step, []

    def breaks(count, rows):
        calls.append(None)
        if len(calls) == 7:
            task.sim.port("joint_q").numpy()[1, 3] = np.nan
        step(count, rows)

    task.course.step = breaks
    left = record(task, learned.controller, begin, 4, worlds=range(3))
    assert len(left) == 2
    for one, other in zip(left, (whole[0], whole[2])):
        np.testing.assert_array_equal(one.reference_q, other.reference_q)
        np.testing.assert_allclose(one.joint_q, other.joint_q, atol=1e-4)


# --------------------------------------------------------------------------------------- its reference


def test_the_reference_goes_on_from_where_the_player_is(learned, player):
    """Fragment by fragment on from there, by the step that each makes, whatever the player does."""
    graph, step = learned.graph, np.array([[0.05, 0.02, 0.3]])
    goal = graph.goal_q.copy()
    aim = composed(planar(graph.start_q), np.repeat(step, graph.count, axis=0))
    goal[:, :2] = aim[:, :2]
    goal[:, 3:7] = [[0.0, 0.0, np.sin(h / 2), np.cos(h / 2)] for h in aim[:, 2]]
    travelling = replace(graph, goal_q=goal, motion=None)
    task = replace(learned, context=replace(learned.context, graph=travelling)).task(1)
    begin = learned.starts.draw(streams(3))
    (seen,) = record(task, OpenLoop(task.actions), begin, 10)
    places = planar(seen.reference_q[::STEPS])
    faces = planar(graph.start_q[begin.k])[0, 2]  # as the reference does, however far the player is off
    assert places[0] == pytest.approx([*planar(seen.joint_q[:1])[0, :2], faces], abs=1e-5)
    assert relative(places[:-1], places[1:]) == pytest.approx(np.repeat(step, 10, axis=0), abs=2e-3)
    assert np.abs(np.diff(seen.reference_q[:, :3], axis=0)).max() < 0.03


def test_between_fragments_the_reference_is_the_graph_s(player, graph, task):
    """Moved and turned over the ground and nothing else, over a branch too."""
    both = joined([graph, graph], [((0, 3), (1, 4)), ((1, 13), (0, 0))])
    begin = reference_starts(both)
    begin = begin[2:3]
    worlds = task(1, graph=both)

    class Over:
        def next(self, graph, k):
            return np.where(k == 3, graph.count // 2 + 4, Ahead().next(graph, k))

    (seen,) = record(worlds, OpenLoop(worlds.actions), begin, 4, chooser=Over())
    rows = [both.rows(player, k) for k in (2, 3, 18, 19)]
    expected = np.concatenate([rows[0], *(part[1:] for part in rows[1:])])
    np.testing.assert_allclose(seen.reference_q[:, 7:], expected[:, 7:], atol=1e-12)
    np.testing.assert_allclose(seen.reference_q[:, 2], expected[:, 2], atol=1e-12)
    np.testing.assert_allclose(seen.reference_q[:, :2], expected[:, :2], atol=1e-9)
