"""Fingers between flat and fist (P1 Eq. 1-3), against the model's own keyframes."""

import numpy as np
import pytest

from warpdribble.learning.tasks.fingers import (
    FINGERS,
    SHARES,
    finger_joints,
    finger_signals,
    with_ready_hands,
)
from warpdribble.sims import Model
from warpdribble.sims.model import pose
from warpdribble.sims.worlds import Course, Simulation


@pytest.fixture(scope="module")
def full():
    return Model.load("player")


def test_shares_are_those_of_the_paper():
    """Eq. 2 and 3: the middle and the ring finger lie between index and little finger."""
    thumb, index, pinky = 0.3, 0.6, 0.9
    closed = dict(zip(FINGERS, SHARES @ [thumb, index, pinky]))
    assert closed["middle"] == pytest.approx(2 / 3 * index + 1 / 3 * pinky)
    assert closed["ring"] == pytest.approx(1 / 3 * index + 2 / 3 * pinky)
    assert (closed["thumb"], closed["index"], closed["pinky"]) == (thumb, index, pinky)


@pytest.mark.parametrize("share, keyframe", [(0.0, "flat"), (0.2, "ready"), (1.0, "fist")])
def test_a_signal_leads_from_flat_to_fist(full, share, keyframe):
    """The targets that a course gives are the keyframe's own: Eq. 1 at 0, 0.2 and 1."""
    sim = Simulation(full, 1)
    course = Course(sim, full.keyframes["flat"][None], finger_signals(full))
    course.offset[:] = share
    sim.reset(joint_q=full.keyframes["flat"])
    course.step(1, 0)
    target = sim.port("joint_target_q").numpy()[0]
    for names in finger_joints(full):
        for name in names:
            part = full.q_slice(name)
            np.testing.assert_allclose(target[part], full.keyframes[keyframe][part], atol=2e-6, err_msg=name)


def test_only_hands_that_play_are_made_ready(full):
    before = np.stack([full.start_q, full.start_q])
    after = with_ready_hands(full, before, np.array([False, True]))
    left, right = (
        np.concatenate([np.arange(full.nq)[full.q_slice(n)] for n in side]) for side in finger_joints(full)
    )
    np.testing.assert_array_equal(after[:, right], np.tile(full.keyframes["ready"][right], (2, 1)))
    rest = np.setdiff1d(np.arange(full.nq), right)
    np.testing.assert_array_equal(after[:, rest], before[:, rest])
    assert len(left) == len(right) and not np.array_equal(after[:, right], before[:, right])


def test_a_closed_hand_has_its_tips_near_the_palm(full):
    """Fist and flat hand differ as hands do: the tips come within 7 cm of the palm."""
    palm, tip = full.sites["r_palm"], full.sites["r_middle_tip"]
    far = {}
    for name in ("flat", "fist"):
        body_q = pose.forward(full, full.keyframes[name][None])[0]
        far[name] = np.linalg.norm(_at(body_q, tip) - _at(body_q, palm))
    assert far["fist"] < 0.07 < 0.12 < far["flat"]


def test_a_model_without_fingers_is_refused():
    rigid = Model.load("player", rigid=("*_mcp", "*_pip", "*_dip"))
    with pytest.raises(ValueError, match="no finger 'l_thumb'"):
        finger_signals(rigid)


def _at(body_q, site):
    from scipy.spatial.transform import Rotation

    body, place, _ = site
    return body_q[body, :3] + Rotation.from_quat(body_q[body, 3:]).apply(place)
