from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model
from warpdribble.sims.authored.dribble import Dribble, dribble_right, release_speed
from warpdribble.sims.model import gaps, pose
from warpdribble.sims.reference.reference import difference


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module")
def clip(player):
    return dribble_right(player)


@pytest.fixture(scope="module")
def body_q(player, clip):
    return pose.forward(player, clip.reference.joint_q)


def test_the_last_row_is_the_first(player, clip):
    first, last = clip.reference.joint_q[[0, -1]]
    assert np.array_equal(first, last)
    assert clip.reference.duration == pytest.approx(0.70)


def test_it_is_the_same_every_time(player, clip):
    assert np.array_equal(dribble_right(player).reference.joint_q, clip.reference.joint_q)


def test_feet_are_planted_flat(player, body_q):
    for side in "lr":
        foot = player.body(f"{side}_foot")
        assert np.ptp(body_q[:, foot, :3], axis=0).max() < 1e-9
        up = Rotation.from_quat(body_q[:, foot, 3:]).apply([0.0, 0.0, 1.0])
        assert np.allclose(up, [0.0, 0.0, 1.0])
        bodies = [foot, player.body(f"{side}_toes")]
        assert np.abs(gaps.lowest_point(player, body_q, bodies)).max() < 1e-6


def test_the_hand_stays_within_a_dribble_s_heights(player, body_q):
    hand = body_q[:, player.body("r_hand"), 2]
    assert 0.75 < hand.min() < 0.9 and 1.0 < hand.max() < 1.2


def test_the_ball_obeys_gravity_and_the_bounce(player, clip, body_q):
    """Read off the path alone, not from the formulas that made it."""
    height = body_q[:, player.body("ball"), 2]
    h = player.timestep
    speed = np.diff(height) / h
    bounce = int(height.argmin())
    flight = np.arange(2, round(clip.contact[0] / h) - 1)
    free = [k for k in flight if abs(k - bounce) > 2]
    assert np.allclose((speed[1:] - speed[:-1])[np.array(free) - 1] / h, -9.81, atol=1e-6)
    before, after = speed[bounce - 3] - 9.81 * 2.5 * h, speed[bounce + 2] + 9.81 * 2.5 * h
    assert -after / before == pytest.approx(clip.restitution, abs=0.03)
    assert height.min() > 0.1193


def test_the_palm_is_on_the_ball_while_the_hand_has_it(player, clip, body_q):
    centre = body_q[:, player.body("ball"), :3]
    gap = gaps.gap_to_bodies(player, body_q, [player.body("r_hand")], centre) - 0.1193
    times = np.arange(len(gap)) * player.timestep
    held = (times > clip.contact[0]) | (times == 0.0)
    assert np.abs(gap[held]).max() < 0.002
    assert gap[~held].min() > -0.002 and gap[~held].max() > 0.3


def test_the_hand_pushes_and_never_pulls(player, clip, body_q):
    height = body_q[:, player.body("ball"), 2]
    fall = np.diff(height, 2) / player.timestep**2
    held = slice(round(clip.contact[0] / player.timestep) + 1, -1)
    assert np.all(fall[held] < -9.8)


def test_no_joint_jumps_or_leaves_its_range(player, clip):
    speed = clip.reference.velocity(player)
    joints = [joint for joint in player.joints if joint.kind != "free"]
    assert len(joints) == 49
    for joint in joints:
        assert np.abs(speed[:, joint.dof]).max() < 20.0, joint.name
        q, (low, high) = clip.reference.joint_q[:, joint.q], joint.limits
        if joint.kind == "ball":
            assert Rotation.from_quat(q).magnitude().max() < high, joint.name
        else:
            assert low < q.min() and q.max() < high, joint.name


def test_the_motion_is_smooth_over_the_seam(player, clip):
    joint_q = np.concatenate([clip.reference.joint_q[:-1]] * 2)
    speed = difference(player, joint_q[:-1], joint_q[1:]) / player.timestep
    dofs = np.arange(6, player.dof_slice("ball").start)
    change = np.abs(np.diff(speed[:, dofs], axis=0)).max(axis=1)
    seam = len(joint_q) // 2
    assert change[seam - 3 : seam + 3].max() < 4.0


@pytest.mark.parametrize("change", [{"hold": 0.69}, {"restitution": 0.2}])
def test_a_dribble_that_no_ball_can_do_is_refused(player, change):
    with pytest.raises(ValueError, match="this dribble"):
        dribble_right(player, replace(Dribble(), **change))


def test_a_livelier_ball_needs_less_of_a_push():
    dull, lively = (release_speed(replace(Dribble(), restitution=e), 0.1193) for e in (0.7, 0.9))
    assert 0.0 < lively < dull < 8.0
