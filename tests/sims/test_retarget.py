import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.bvh import read_bvh
from warpdribble.sims import Model, gaps, pose
from warpdribble.sims.retarget import CMU, retarget

BONES = {
    "l_upper_arm": ("l_lower_arm", "LeftArm", "LeftForeArm"),
    "r_upper_arm": ("r_lower_arm", "RightArm", "RightForeArm"),
    "l_lower_arm": ("l_hand", "LeftForeArm", "LeftHand"),
    "r_lower_arm": ("r_hand", "RightForeArm", "RightHand"),
    "l_upper_leg": ("l_lower_leg", "LeftUpLeg", "LeftLeg"),
    "r_upper_leg": ("r_lower_leg", "RightUpLeg", "RightLeg"),
    "l_lower_leg": ("l_foot", "LeftLeg", "LeftFoot"),
    "r_lower_leg": ("r_foot", "RightLeg", "RightFoot"),
}
PLACES = {"l_foot": "LeftFoot", "r_foot": "RightFoot", "l_lower_leg": "LeftLeg"}
PLACES |= {"torso": "Spine1", "head": "Neck1", "l_hand": "LeftFingerBase"}
PLACES |= {"r_lower_leg": "RightLeg", "r_hand": "RightFingerBase"}


def soles(model):
    return [model.body(f"{side}_{part}") for side in "lr" for part in ("foot", "toes")]


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module")
def dribble(mocap):
    motion, _ = read_bvh(mocap / "cmu" / "06_12.bvh")
    return motion.slice(597, 684)


def test_limbs_point_where_the_recording_s_do(player, dribble):
    body_q = pose.forward(player, retarget(player, dribble).joint_q)
    positions, _ = dribble.resample(1.0 / player.timestep).forward()
    for body, (next_body, joint, next_joint) in BONES.items():
        ours = body_q[:, player.body(next_body), :3] - body_q[:, player.body(body), :3]
        theirs = positions[:, dribble.index(next_joint)] - positions[:, dribble.index(joint)]
        cosine = np.sum(ours * theirs, axis=1)
        cosine /= np.linalg.norm(ours, axis=1) * np.linalg.norm(theirs, axis=1)
        assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 4.0, body


def test_joints_are_near_the_recording_s_scaled_by_leg_length(player, dribble):
    body_q = pose.forward(player, retarget(player, dribble).joint_q)
    motion = dribble.resample(1.0 / player.timestep)
    positions, _ = motion.forward()
    scale = 0.8917 / 0.866
    hips = 0.5 * (
        positions[:, motion.index("LeftUpLeg")] + positions[:, motion.index("RightUpLeg")]
    )
    root = body_q[:, player.body("pelvis"), :3]
    for body, joint in PLACES.items():
        ours = body_q[:, player.body(body), :3] - root
        theirs = scale * (positions[:, motion.index(joint)] - hips)
        error = np.linalg.norm(ours - theirs, axis=1).mean()
        assert error < (0.03 if "leg" in body or "foot" in body else 0.09), body


@pytest.mark.parametrize(
    ("clip", "frames"),
    [("06_12", (597, 684)), ("06_02", (413, 533)), ("02_01", (10, 300)), ("08_01", (10, 200))],
)
def test_feet_stand_on_the_ground(player, mocap, clip, frames):
    motion, _ = read_bvh(mocap / "cmu" / f"{clip}.bvh")
    reference = retarget(player, motion.slice(*frames))
    body_q = pose.forward(player, reference.joint_q)
    lowest = gaps.lowest_point(player, body_q, soles(player))
    assert np.median(lowest) == pytest.approx(0.0, abs=0.03)
    assert lowest.min() > -0.05


def test_one_row_per_time_step(player, dribble):
    reference = retarget(player, dribble)
    assert reference.joint_q.shape == (73, player.nq)
    assert reference.timestep == player.timestep
    for k in player.quaternions():
        assert np.allclose(np.linalg.norm(reference.joint_q[:, k : k + 4], axis=1), 1.0)


def test_fingers_toes_and_ball_keep_the_start_pose(player, dribble):
    joint_q = retarget(player, dribble).joint_q
    for joint in ("r_index_mcp", "l_thumb_pip", "l_toes", "ball"):
        assert np.allclose(joint_q[:, player.q_slice(joint)], player.start_q[player.q_slice(joint)])


def test_knees_and_elbows_bend_the_way_they_can(player, mocap):
    motion, _ = read_bvh(mocap / "cmu" / "06_12.bvh")
    joint_q = retarget(player, motion.slice(400, 1040)).joint_q
    for joint in ("l_knee", "r_knee", "l_elbow", "r_elbow"):
        angles = joint_q[:, player.q_slice(joint)]
        assert np.radians(-10.0) < angles.min() < angles.max() < np.radians(160.0)


def test_the_t_pose_becomes_the_zero_pose(player, dribble):
    """Except for the arms, which hang 8 degrees in CMU's T-pose and are straight out in ours."""
    from dataclasses import replace

    still = replace(
        dribble,
        rotations=np.tile(dribble.rest_rotations, (20, 1, 1)),
        root_position=np.tile([0.0, 0.0, 1.0], (20, 1)),
    )
    reference = retarget(player, still)
    body_q = pose.forward(player, reference.joint_q)[10]
    for body in ("pelvis", "torso", "head", "l_foot", "r_foot"):
        turn = Rotation.from_quat(body_q[player.body(body), 3:])
        assert np.degrees(turn.magnitude()) < 0.1, body
    drop = body_q[player.body("l_upper_arm"), :3] - body_q[player.body("l_hand"), :3]
    assert np.degrees(np.arctan2(drop[2], -drop[1])) == pytest.approx(8.0, abs=0.1)


def test_an_unknown_joint_is_named(player, dribble):
    from dataclasses import replace

    names = tuple(n.replace("LeftFoot", "LFoot") for n in dribble.joint_names)
    with pytest.raises(ValueError, match="LeftFoot"):
        retarget(player, replace(dribble, joint_names=names))


def test_an_unknown_body_is_named(player, dribble):
    from dataclasses import replace

    with pytest.raises(ValueError, match="no body 'tail'"):
        retarget(player, dribble, replace(CMU, bodies=CMU.bodies | {"tail": "Hips"}))
