import numpy as np
import pytest

from warpdribble.sims import Model
from warpdribble.sims.authored.catalogue import AUTHORED, authored_clip
from warpdribble.sims.model import gaps, pose
from warpdribble.sims.reference.reference import Cycle, difference
from warpdribble.sims.retarget.accuracy import beyond_limits

R = 0.1193
TRUNK = ("pelvis", "lower_back", "torso", "head", "l_upper_leg", "r_upper_leg")


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module", params=AUTHORED)
def name(request):
    return request.param


@pytest.fixture(scope="module")
def clip(player, name):
    return authored_clip(player, name)


@pytest.fixture(scope="module")
def body_q(player, clip):
    return pose.forward(player, clip.reference.joint_q)


def test_it_closes_and_is_the_same_every_time(player, name, clip):
    joint_q = clip.reference.joint_q
    ahead = Cycle.of(player, clip.reference).repeat(player, 1).joint_q[-1]
    assert np.allclose(ahead, joint_q[-1]) and np.allclose(joint_q[0, 2:7], joint_q[-1, 2:7])
    assert np.allclose(joint_q[-1, :2] - joint_q[0, :2], [1.75, 0.0] if name == "run_dribble" else 0.0)
    assert np.array_equal(authored_clip(player, name).reference.joint_q, joint_q)


def test_feet_are_planted_flat(player, name, body_q):
    if name in ("run_dribble", "between_legs"):
        pytest.skip("its feet move, or rise over their toes: tests of its own")
    for side in "lr":
        foot = player.body(f"{side}_foot")
        assert np.ptp(body_q[:, foot, :3], axis=0).max() < 1e-9
        assert np.abs(gaps.lowest_point(player, body_q, [foot, player.body(f"{side}_toes")])).max() < 1e-6


def test_joints_stay_in_range_and_do_not_jump(player, clip):
    assert beyond_limits(player, clip.reference.joint_q) < 1e-6
    joint_q = np.concatenate([clip.reference.joint_q[:-1]] * 2)
    dofs = np.arange(6, player.dof_slice("ball").start)
    speed = difference(player, joint_q[:-1], joint_q[1:])[:, dofs] / player.timestep
    assert np.abs(speed).max() < 25.0
    assert np.abs(np.diff(speed, axis=0)).max() < 8.0


def test_palms_hold_the_ball_and_nothing_passes_through_it(player, clip, body_q):
    ball = clip.ball.path
    assert clip.ball.touch.any()
    for hand, side in enumerate("lr"):
        palm = gaps.gap_to_bodies(player, body_q, [player.body(f"{side}_hand")], ball) - R
        held = clip.ball.touch[:, hand]
        assert np.abs(palm[held]).max(initial=0.0) < 0.003
        fingers = player.descendants(player.body(f"{side}_hand"))
        assert gaps.gap_to_bodies(player, body_q, fingers, ball).min() - R > -0.008
    trunk = [player.body(name) for name in TRUNK]
    assert gaps.gap_to_bodies(player, body_q, trunk, ball).min() - R > 0.005


def test_hands_stay_outside_the_body(player, body_q):
    trunk = [player.body(name) for name in TRUNK]
    for side in "lr":
        for body in player.descendants(player.body(f"{side}_lower_arm")):
            assert gaps.gap_to_bodies(player, body_q, trunk, body_q[:, body, :3]).min() > 0.03


def test_a_free_ball_falls_and_bounces(player, name, clip):
    free = ~clip.ball.touch.any(axis=1)
    assert free.any() == (name not in ("carry", "waist"))
    height = clip.ball.path[:, 2]
    fall = np.diff(height, 2) / player.timestep**2
    inside = free[:-2] & free[1:-1] & free[2:] & (height[1:-1] > 0.2)
    assert inside.any() == free.any()
    assert np.allclose(fall[inside], -9.81, atol=0.01)
    assert (height.min() < R + 0.05) == free.any()


def test_checkpoints_are_the_ball_s_highest_rows(clip):
    held = clip.ball.path[clip.ball.touch.any(axis=1), 2]
    tops = clip.ball.path[list(clip.ball.checkpoints), 2]
    assert tops == pytest.approx(held.max(), abs=2e-4)  # halves of a cycle may end between rows
    assert clip.ball.heights == pytest.approx(tops, abs=0.005)


def test_changing_hands_is_its_own_mirror_image(player):
    from warpdribble.sims.authored.palm import shift
    from warpdribble.sims.reference.mirror import mirrored

    joint_q = authored_clip(player, "switch_hands").reference.joint_q
    reference = authored_clip(player, "switch_hands").reference
    twin = shift(mirrored(player, reference).joint_q, len(joint_q) // 2)
    assert np.allclose(twin[:, 1:3], joint_q[:, 1:3], atol=1e-6)
    for joint in player.joints:
        if joint.kind != "free":
            assert np.allclose(twin[:, joint.q], joint_q[:, joint.q], atol=1e-6), joint.name
