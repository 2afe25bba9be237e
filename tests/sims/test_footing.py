import numpy as np
import pytest

from warpdribble.sims import Model, gaps, pose
from warpdribble.sims.footing import ground_height, stand

FEET = ("l_foot", "r_foot")


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def lows(player, joint_q):
    body_q = pose.forward(player, joint_q)
    return [
        gaps.lowest_point(player, body_q, gaps.descendants(player, player.body(foot)))
        for foot in FEET
    ]


def standing(player, height=0.0, frames=60):
    joint_q = np.tile(player.start_q, (frames, 1))
    joint_q[:, 2] += height
    return joint_q


@pytest.mark.parametrize("height", [-0.05, 0.0, 0.3])
def test_a_floating_motion_comes_down_to_the_ground(player, height):
    joint_q = standing(player, height)
    stand(player, joint_q, FEET)
    for low in lows(player, joint_q):
        assert np.abs(low).max() < 0.002


def test_legs_of_different_length_both_stand(player):
    joint_q = standing(player)
    for joint, angle in (("l_hip", 0.0), ("l_knee", 0.0)):
        joint_q[:, player.q_slice(joint)] = [0, 0, 0, 1.0] if joint == "l_hip" else angle
    knee, hip, ankle = (player.q_slice(f"r_{j}") for j in ("knee", "hip", "ankle"))
    half = 0.1
    joint_q[:, knee] = 2.0 * half
    joint_q[:, hip] = joint_q[:, ankle] = [0.0, -np.sin(half / 2), 0.0, np.cos(half / 2)]
    before = lows(player, joint_q)
    assert np.median(before[1] - before[0]) > 0.004
    stand(player, joint_q, FEET)
    for low in lows(player, joint_q):
        assert np.abs(low[10:-10]).max() < 0.003


def test_a_foot_in_the_air_stays_there(player):
    joint_q = standing(player)
    joint_q[:, player.q_slice("r_knee")] = 1.4
    raised = lows(player, joint_q)[1]
    assert raised.min() > 0.1
    stand(player, joint_q, FEET)
    assert np.allclose(lows(player, joint_q)[1], raised, atol=0.02)


def test_ground_is_where_the_feet_are_most_of_the_time(player):
    joint_q = standing(player, 0.04, frames=100)
    joint_q[:15, 2] += 0.3
    joint_q[15:25, 2] -= 0.1
    expected = np.median(np.minimum(*lows(player, joint_q)))
    assert ground_height(player, joint_q, FEET) == pytest.approx(expected, abs=1e-6)
