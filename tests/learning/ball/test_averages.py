"""Where the ball is on average, and H as hands have it, against NumPy on states and on bodies' poses."""

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.learning.ball.averages import averaged
from warpdribble.learning.ball.optimised import Optimised, Playback
from warpdribble.learning.evaluate.record import record
from warpdribble.learning.graph import STEPS
from warpdribble.learning.tasks.arms import HELD, Arms
from warpdribble.learning.tasks.fingers import FINGERS


@pytest.fixture(scope="module")
def whole(learner):
    """Three cycles, from fragment 11 on."""
    return Optimised.of(learner[0].result)


def part(found, *where):
    """Some rows of it."""
    return Optimised(*(getattr(found, f.name)[slice(*where)] for f in fields(Optimised)))


def seen_from_the_player(model, joint_q):
    """(n, 3) the ball, from the ground below the root, X the way that the root's X points over the ground."""
    ahead = Rotation.from_quat(joint_q[:, 3:7]).apply([1.0, 0.0, 0.0])
    x = np.stack([ahead[:, 0], ahead[:, 1]], axis=1) / np.linalg.norm(ahead[:, :2], axis=1, keepdims=True)
    ball = joint_q[:, model.q_slice(model.roles.one("ball_joint"))][:, :3]
    off = (ball - joint_q[:, :3])[:, :2]
    y = np.stack([-x[:, 1], x[:, 0]], axis=1)
    return np.stack([np.sum(off * x, axis=1), np.sum(off * y, axis=1), ball[:, 2]], axis=1)


def test_the_ball_is_where_the_next_fragments_begin(whole, full, dribbled, legs):
    """On average of all times; where nothing leads, and no more is said of H, as in the reference."""
    task = Arms(full, dribbled, 8, legs)
    found = part(whole, 0, -1)
    ball, _ = averaged(task, found)
    ends = seen_from_the_player(full, whole.joint_q[1:].astype(float))
    for k in range(dribbled.count):
        np.testing.assert_allclose(ball[k], ends[found.k == k].mean(axis=0), atol=1e-5)
    few, some = averaged(task, part(whole, 0, 5))
    other = np.setdiff1d(np.arange(dribbled.count), whole.k[:5])
    at = seen_from_the_player(full, dribbled.goal_q[other])
    np.testing.assert_allclose(few[other], at, atol=1e-5)
    np.testing.assert_allclose(few[whole.k[:5]], ends[:5], atol=1e-5)
    rows = (other[:, None] * STEPS + np.arange(STEPS)).ravel()
    np.testing.assert_array_equal(some[rows], dribbled.touch[rows])


def test_frames_of_H_are_those_with_fingers_at_the_ball(whole, full, dribbled, legs):
    """Of a hand that should have the ball always: from the bodies' poses of a recording, step by step."""
    touch = np.zeros_like(dribbled.touch)
    touch[:, 1] = True
    task = Arms(full, replace(dribbled, touch=touch), 8, legs)
    _, seen = averaged(task, whole)
    body_q = record(task, Playback(whole), whole.starts(8), len(whole))[0].body_q[1:].astype(float)
    ball = body_q[:, full.body(full.roles.one("ball")), :3]
    off = []
    for finger in FINGERS:
        body, at, _ = full.sites[f"r_{finger}_tip"]
        tip = body_q[:, body, :3] + Rotation.from_quat(body_q[:, body, 3:]).apply(at)
        off.append(np.linalg.norm(tip - ball, axis=1) - full.ball_radius)
    cycle = np.mean(np.mean(off, axis=0).reshape(3, -1), axis=0)  # in the order of whole.k
    expected = np.zeros(len(touch), bool)
    rows = (whole.k[: dribbled.count, None] * STEPS + np.arange(STEPS)).ravel()
    expected[rows] = cycle <= HELD
    assert np.abs(cycle - HELD).min() > 1e-5, "or rounding decides"
    np.testing.assert_array_equal(seen[:, 1], expected)
    assert not seen[:, 0].any(), "who should not have it does not become one who should"
    assert seen[dribbled.checkpoints, 1].all() and 0 < seen[:, 1].sum() < len(seen)


def test_what_does_not_play_back_is_refused(whole, full, dribbled, legs):
    """The hands do nothing."""
    with pytest.raises(ValueError, match="does not play back"):
        averaged(Arms(full, dribbled, 8, legs), replace(whole, action=np.zeros_like(whole.action)))
