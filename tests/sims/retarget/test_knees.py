"""Legs against a pose that reaches by construction, and one whose knees are nearly straight."""

import numpy as np
import pytest

from warpdribble.sims import Model
from warpdribble.sims.model import pose
from warpdribble.sims.retarget.knees import Leg, ease_knees


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def standing(player, bends):
    """Rows of the player with both knees bent (frames,) [rad], its feet where they are then, and the legs."""
    joint_q = np.tile(player.zero_q, (len(bends), 1))
    for side in "lr":
        joint_q[:, player.q_slice(f"{side}_knee")] = bends[:, None]
    body_q = pose.forward(player, joint_q)
    stood = np.ones(len(bends), bool)
    legs = [Leg(f"{s}_knee", body_q[:, player.body(f"{s}_foot"), :3], stood) for s in "lr"]
    return joint_q, legs


def test_a_leg_s_length_is_that_of_its_pose(player):
    bends = np.linspace(0.1, 2.0, 20)
    joint_q, legs = standing(player, bends)
    body_q = pose.forward(player, joint_q)
    far = np.linalg.norm(legs[0].ankle - body_q[:, player.body("l_upper_leg"), :3], axis=1)
    limb = pose.limb(player, "l_knee")
    length, slope = limb.length(bends)
    assert length == pytest.approx(far)
    assert limb.bend_for(far) == pytest.approx(bends)
    step = 1e-6
    assert slope == pytest.approx((limb.length(bends + step)[0] - length) / step, abs=1e-5)


def test_what_reaches_stays(player):
    joint_q, legs = standing(player, 0.8 + 0.2 * np.sin(np.arange(100) / 10.0))
    before = joint_q.copy()
    moved, ankles = ease_knees(player, joint_q, legs)
    assert np.abs(moved).max() < 0.006 and np.abs(joint_q - before).max() < 0.006
    assert ankles[0] == pytest.approx(legs[0].ankle, abs=1e-9)


def test_a_foot_that_is_set_down_does_not_jerk_a_straight_knee(player):
    """Feet 5 mm off for a while under nearly straight legs: 9 degrees of the knee, were the root to stay."""
    joint_q, legs = standing(player, np.full(150, 0.2))
    off = 0.005 * (np.abs(np.arange(150) - 75) < 30)[:, None] * [0.0, 0.0, 1.0]
    goals = [Leg(leg.hinge, leg.ankle + off, leg.stands) for leg in legs]

    def shake(joint_q):
        hip = pose.forward(player, joint_q)[:, player.body("l_upper_leg"), :3]
        bend = pose.limb(player, "l_knee").bend_for(np.linalg.norm(goals[0].ankle - hip, axis=1))
        return np.abs(np.diff(bend, 2)).max()

    before = shake(joint_q)
    moved, ankles = ease_knees(player, joint_q, goals)
    assert shake(joint_q) < 0.15 * before
    assert np.abs(moved).max() < 0.02 and ankles[0] == pytest.approx(goals[0].ankle)
