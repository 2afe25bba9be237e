"""A motion begun with small variations of the ball: what starts, and which of them is kept."""

import numpy as np
import pytest

from warpdribble.learning.choose import Ahead
from warpdribble.learning.evaluate.attempts import (
    LOW,
    SETTLED,
    STRIDE,
    TRIES,
    follow,
    longest_in_play,
    starts,
    time_in_play,
)
from warpdribble.learning.evaluate.record import record
from warpdribble.learning.evaluate.tracking import track
from warpdribble.learning.tasks.follow import OpenLoop
from warpdribble.sims import Model
from warpdribble.sims.authored.dribble import dribble_right
from warpdribble.sims.model import pose
from warpdribble.sims.reference.reference import Cycle
from warpdribble.sims.trajectory import Trajectory


@pytest.fixture(scope="module")
def full():
    return Model.load("player")


@pytest.fixture(scope="module")
def reference(full):
    return Cycle(dribble_right(full).reference).repeat(full, 4)


def attempted(full, reference, root):
    """What all tries did."""
    task = follow(full, reference, TRIES, root)
    begin = starts(full, reference, TRIES, ball=True)
    return record(task, OpenLoop(), begin, task.graph.count, worlds=range(TRIES), chooser=Ahead())


@pytest.fixture(scope="module", params=["free", "tracked"])
def tried(request, full, reference):
    return attempted(full, reference, request.param)


@pytest.fixture(scope="module")
def seen(full, reference, tried):
    return longest_in_play(full, tried).first(reference.frame_count)


# ------------------------------------------------------------------------------------------ the dribble


def test_the_player_follows_the_dribble_on_its_feet(full, seen):
    found = track(full, seen)
    assert found.falls == 0
    assert np.degrees(found.angle_error.mean()) < 2.0
    assert found.position_error.mean() < 0.03
    assert found.contacts["right foot down"].mean() > 0.95
    assert found.contacts["left foot down"].mean() > 0.95


def test_the_ball_is_in_play(full, seen):
    height = seen.body_q[:, full.body("ball"), 2]
    bounces = (height[1:-1] < height[:-2]) & (height[1:-1] <= height[2:]) & (height[1:-1] < 0.25)
    assert bounces.sum() >= 2
    assert height.min() > 0.1
    contacts = track(full, seen).contacts
    assert contacts["ball on ground"].any()
    assert contacts["ball on right hand"].any()


def test_it_is_the_one_in_play_longest(full, tried, seen):
    times = [time_in_play(full, one) for one in tried]
    assert len(tried) == TRIES and len(set(times)) > 1
    np.testing.assert_array_equal(seen.body_q, tried[np.argmax(times)].body_q[: seen.frame_count])


def test_the_reference_is_the_one_that_was_given(reference, seen):
    np.testing.assert_allclose(np.abs(seen.reference_q), np.abs(reference.joint_q), atol=1e-6)


def test_the_same_job_gives_the_same_result(full):
    clip = dribble_right(full).reference
    first, second = (attempted(full, clip, "free") for _ in range(2))
    for one, two in zip(first, second):
        np.testing.assert_array_equal(one.body_q, two.body_q)


# ----------------------------------------------------------------------------------------------- starts


def test_the_ball_starts_as_in_the_reference_and_about_it(full, reference):
    """The first world exactly, the others within 15 mm over the ground and 0.2 m/s; always the same ones."""
    begin = starts(full, reference, TRIES, ball=True)
    q, v = full.q_slice("ball").start, full.dof_slice("ball").start
    path = reference.joint_q[:2, q : q + 3]
    np.testing.assert_array_equal(begin.joint_q[0, q : q + 3], path[0])
    np.testing.assert_allclose(begin.joint_qd[0, v : v + 3], (path[1] - path[0]) / 0.01)
    off = begin.joint_q[1:, q : q + 3] - path[0]
    fast = begin.joint_qd[1:, v : v + 3] - begin.joint_qd[0, v : v + 3]
    assert np.abs(off).max() < 0.015 and not off[:, 2].any() and (np.abs(off[:, :2]) > 0.0).all()
    assert np.abs(fast).max() < 0.2 and (np.abs(fast) > 0.0).all()
    again = starts(full, reference, TRIES, ball=True)
    np.testing.assert_array_equal(begin.joint_qd, again.joint_qd)
    apart = np.delete(begin.joint_q - begin.joint_q[0], np.r_[full.q_slice("ball")], axis=1)
    assert not apart.any() and not begin.k.any()


def test_without_a_ball_all_start_alike(full, reference):
    begin = starts(full, reference, 3, ball=False)
    np.testing.assert_array_equal(begin.joint_q, np.tile(reference.joint_q[0], (3, 1)))
    np.testing.assert_array_equal(begin.joint_qd, np.tile(reference.velocity(full)[0], (3, 1)))


# ------------------------------------------------------------------------------------------- in play


def trajectory(full, ball):
    """A player that stands, and a ball at places (frames, 3) from its root."""
    body_q = np.tile(pose.forward(full, full.start_q[None]), (len(ball), 1, 1))
    body_q[:, full.body("ball"), :3] = body_q[:, full.body("pelvis"), :3] * [1, 1, 0] + ball
    joint_q = np.tile(full.start_q, (len(ball), 1))
    return Trajectory(joint_q, body_q, 0.01, joint_q)


def test_a_ball_is_out_of_play_a_stride_away(full):
    way = np.zeros((100, 3)) + [0.0, 0.0, 1.0]
    assert time_in_play(full, trajectory(full, way)) == 100
    way[40:, 0] = STRIDE + 0.01
    assert time_in_play(full, trajectory(full, way)) == 40
    way[:, 0] *= (STRIDE - 0.01) / (STRIDE + 0.01)
    assert time_in_play(full, trajectory(full, way)) == 100


def test_a_ball_is_out_of_play_that_has_stopped_bouncing(full):
    way, rows = np.zeros((200, 3)) + [0.0, 0.0, 1.0], round(SETTLED / 0.01)
    way[20 : 20 + rows - 1, 2] = LOW - 0.01
    assert time_in_play(full, trajectory(full, way)) == 200
    way[100 : 100 + rows, 2] = LOW - 0.01
    assert time_in_play(full, trajectory(full, way)) == 100 + rows - 1


def test_which_is_kept(full):
    ways = np.zeros((3, 50, 3)) + [0.0, 0.0, 1.0]
    ways[0, 10:, 0] = ways[1, 30:, 0] = ways[2, 30:, 0] = 2.0
    several = [trajectory(full, way) for way in ways]
    assert longest_in_play(full, several) is several[1]  # the first of those
    bare = Model.load("player", without=("ball",))
    assert longest_in_play(bare, several) is several[0]


def test_a_state_that_breaks_down_is_said(full):
    """Where all have; where some have, the others are what is left."""
    reference = dribble_right(full).reference
    task = follow(full, reference, 2)
    begin = starts(full, reference, 2, ball=True)
    step, broken = task.course.step, [0]

    def breaks(count, rows):
        task.sim.port("joint_q").numpy()[broken, 3] = np.nan
        step(count, rows)

    task.course.step = breaks
    left = record(task, OpenLoop(), begin, 2, worlds=range(2))
    assert len(left) == 1 and np.isfinite(longest_in_play(full, left).body_q).all()
    broken.append(1)
    left = record(task, OpenLoop(), begin, 2, worlds=range(2))
    with pytest.raises(FloatingPointError, match="broke down"):
        longest_in_play(full, left)


def test_a_recorded_dribble_is_tracked(mocap, full):
    """With the root held to it: degrees and centimetres."""
    from warpdribble.skills import clip_skill, stage_skill

    one = stage_skill(full, clip_skill(mocap / "cmu" / "06_12.bvh", (597, 684), cyclic=True))
    repeated = one.cycle.repeat(full, 3)
    seen = longest_in_play(full, attempted(full, repeated, "tracked")).first(repeated.frame_count)
    found = track(full, seen)
    assert found.falls == 0 and one.ball.touch[:, 1].any() and not one.ball.touch[:, 0].any()
    assert np.degrees(found.angle_error.mean()) < 3.0
    assert found.position_error.mean() < 0.03
