from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from tests.sims.retarget.person import about, person
from warpdribble.clips.bvh import read_bvh
from warpdribble.clips.read import read_clip
from warpdribble.sims import Model
from warpdribble.sims.ball.ball import recorded_ball
from warpdribble.sims.model import gaps, pose
from warpdribble.sims.retarget.accuracy import accuracy
from warpdribble.sims.retarget.mapping import MappingError, read_mapping
from warpdribble.sims.retarget.retarget import retarget, retargeted

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
    body_q = pose.forward(player, retarget(player, dribble, ik=False).joint_q)
    positions, _ = dribble.resample(1.0 / player.timestep).forward()
    for body, (next_body, joint, next_joint) in BONES.items():
        ours = body_q[:, player.body(next_body), :3] - body_q[:, player.body(body), :3]
        theirs = positions[:, dribble.index(next_joint)] - positions[:, dribble.index(joint)]
        cosine = np.sum(ours * theirs, axis=1)
        cosine /= np.linalg.norm(ours, axis=1) * np.linalg.norm(theirs, axis=1)
        assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 4.0, body


def test_joints_are_near_the_recording_s_scaled_by_leg_length(player, dribble):
    body_q = pose.forward(player, retarget(player, dribble, ik=False).joint_q)
    motion = dribble.resample(1.0 / player.timestep)
    positions, _ = motion.forward()
    scale = 0.8917 / 0.866
    hips = 0.5 * (positions[:, motion.index("LeftUpLeg")] + positions[:, motion.index("RightUpLeg")])
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


def test_fingers_and_ball_keep_the_start_pose(player, dribble):
    joint_q = retarget(player, dribble).joint_q
    for joint in ("r_index_mcp", "l_thumb_pip", "ball"):
        assert np.allclose(joint_q[:, player.q_slice(joint)], player.start_q[player.q_slice(joint)])


def test_knees_and_elbows_bend_the_way_they_can(player, mocap):
    motion, _ = read_bvh(mocap / "cmu" / "06_12.bvh")
    joint_q = retarget(player, motion.slice(400, 1040)).joint_q
    for joint in ("l_knee", "r_knee", "l_elbow", "r_elbow"):
        angles = joint_q[:, player.q_slice(joint)]
        assert np.radians(-10.0) < angles.min() < angles.max() < np.radians(160.0)


def test_the_t_pose_becomes_the_zero_pose(player, dribble):
    """Except for the arms, which hang 8 degrees in CMU's T-pose and are straight out in ours."""
    still = replace(
        dribble,
        rotations=np.tile(dribble.rest_rotations, (20, 1, 1)),
        root_position=np.tile([0.0, 0.0, 1.0], (20, 1)),
    )
    reference = retarget(player, still, ik=False)
    body_q = pose.forward(player, reference.joint_q)[10]
    for body in ("pelvis", "torso", "head", "l_foot", "r_foot"):
        turn = Rotation.from_quat(body_q[player.body(body), 3:])
        assert np.degrees(turn.magnitude()) < 0.1, body
    drop = body_q[player.body("l_upper_arm"), :3] - body_q[player.body("l_hand"), :3]
    assert np.degrees(np.arctan2(drop[2], -drop[1])) == pytest.approx(8.0, abs=0.1)


def test_an_unknown_joint_is_named(player, dribble):
    names = tuple(n.replace("LeftFoot", "LFoot") for n in dribble.joint_names)
    with pytest.raises(MappingError, match=r"cmu: bodies\.l_foot: no joint 'LeftFoot'"):
        retarget(player, replace(dribble, joint_names=names), read_mapping("cmu"))
    with pytest.raises(MappingError, match="cmu comes nearest, and lacks LeftFoot"):
        retarget(player, replace(dribble, joint_names=names))


def test_an_unknown_body_is_named(player, dribble):
    cmu = read_mapping("cmu")
    with pytest.raises(MappingError, match="no body 'tail'"):
        retarget(player, dribble, replace(cmu, bodies=cmu.bodies | {"tail": "Hips"}))


@pytest.mark.parametrize(
    ("clip", "frames"),
    [
        ("cmu/06_12.bvh", (500, 800)),
        ("cmu/02_01.bvh", (10, 300)),
        ("cmu/09_01.bvh", (0, 120)),
        ("ballplay_m/044_006pickle_lleg_2.pt", (0, 168)),
        ("ballplay_m/001_007pickle_pick_011.pt", (80, 200)),
    ],
)
def test_joints_feet_and_ground_keep_to_the_recording(player, mocap, clip, frames):
    motion, _ = read_clip(mocap / clip)
    fit = accuracy(player, retargeted(player, motion.slice(*frames)))
    assert fit.mean < 0.041 and fit.limbs["hands"][0] < 0.03
    assert fit.sliding < 0.005 and fit.off_ground < 0.01
    assert max(fit.penetration, fit.body_penetration) < 0.005
    assert fit.limits < 1e-6


def test_palms_follow_recorded_knuckles(player, mocap):
    motion, _ = read_clip(mocap / "ballplay_m" / "044_006pickle_lleg_2.pt")
    mapping = replace(read_mapping("ballplay"), supinated={})
    body_q = pose.forward(player, retarget(player, motion, mapping).joint_q)
    motion = motion.resample(1.0 / player.timestep)
    across = [motion.positions[:, motion.index(f"R_{f}1")] for f in ("Index", "Pinky")]
    ours = [body_q[:, player.body(f"r_{f}_1"), :3] for f in ("index", "pinky")]
    a, b = across[0] - across[1], ours[0] - ours[1]
    cosine = np.sum(a * b, axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    # 12 degrees are the shapes of the two palms
    assert np.median(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))) < 13.0


@pytest.mark.parametrize("angle", [0.0, 20.0, -30.0])
def test_hands_are_supinated_about_their_fingers(player, mocap, angle):
    """By so many degrees, each palm to its thumb's side."""
    motion, _ = read_clip(mocap / "ballplay_m" / "044_006pickle_lleg_2.pt")
    mapping = read_mapping("ballplay")
    seen = []
    for turned in (0.0, angle):
        own = replace(mapping, supinated=dict.fromkeys(mapping.palms, turned))
        seen.append(pose.forward(player, retargeted(player, motion, own, ik=False).reference.joint_q))
    before, after = seen
    for side in "lr":
        index, middle, little = (player.body(f"{side}_{f}_1") for f in ("index", "middle", "pinky"))
        hand = player.body(f"{side}_hand")
        turn = Rotation.from_quat(before[:, hand, 3:]).inv() * Rotation.from_quat(after[:, hand, 3:])
        by = np.degrees(turn.magnitude())
        np.testing.assert_allclose(np.median(by), abs(angle), atol=1.0)  # the wrist's range may end it
        palm = player.sites[f"{side}_palm"][2]
        out = Rotation.from_quat(before[:, hand, 3:]) * Rotation.from_quat(palm)
        now = (Rotation.from_quat(after[:, hand, 3:]) * Rotation.from_quat(palm)).apply([0.0, 0.0, 1.0])
        thumb = before[:, index, :3] - before[:, little, :3]
        along = before[:, middle, :3] - before[:, hand, :3]
        thumb -= along * (np.sum(thumb * along, axis=1) / np.sum(along**2, axis=1))[:, None]
        thumb /= np.linalg.norm(thumb, axis=1)[:, None]
        out = out.apply([0.0, 0.0, 1.0])
        leans = np.degrees(np.arctan2(np.sum(now * thumb, axis=1), np.sum(now * out, axis=1)))
        np.testing.assert_allclose(np.median(leans), angle, atol=3.0)


def test_recorded_balls_lie_ahead_of_the_palms(player, mocap):
    """Of whoever has one: the other half of the clips than the angle was chosen on; without it they lie 26 to
    50 degrees to the thumb's side."""
    clips = ("009_006pickle_dribble2shot", "041_018pickle_pick2back_7", "001_009pickle_pick_002")
    aside = []
    for clip in clips:
        motion, _ = read_clip(mocap / "ballplay_m" / f"{clip}.pt")
        result = retargeted(player, motion)
        ball = recorded_ball(player, result, motion)
        body_q = pose.forward(player, result.reference.joint_q)
        for hand, side in enumerate("lr"):
            body, at, _ = player.sites[f"{side}_palm"]
            own = Rotation.from_quat(body_q[:, body, 3:])
            off = own.inv().apply(ball.path - body_q[:, body, :3]) - at
            aside += [np.degrees(np.arctan2(off[:, 0], -off[:, 2]))[ball.touch[:, hand]]]
    assert abs(np.median(np.concatenate(aside))) < 15.0


def in_other_frames(motion, seed=0):
    """The same motion with every joint's own axes turned at random, its T-pose lost: LAFAN1's trouble."""
    rng = np.random.default_rng(seed)
    turns = Rotation.random(len(motion.joint_names), rng)
    _, world = motion.forward()
    _, rest_world = motion.rest()
    frames = [Rotation.from_quat(world[:, j]) * turns[j] for j in range(len(motion.joint_names))]
    rest = [Rotation.from_quat(rest_world[j]) * turns[j] for j in range(len(motion.joint_names))]
    local, offsets, rest_local = [frames[0]], motion.offsets.copy(), [rest[0]]
    for j in range(1, len(frames)):
        parent = motion.parents[j]
        local.append(frames[parent].inv() * frames[j])
        rest_local.append(rest[parent].inv() * rest[j])
        offsets[j] = turns[parent].inv().apply(motion.offsets[j])
    stack = np.stack([r.as_quat() for r in local], axis=1)
    return replace(
        motion, rotations=stack, offsets=offsets, rest_rotations=np.stack([r.as_quat() for r in rest_local])
    )


def test_joint_frames_do_not_matter(player, dribble):
    ours = retarget(player, dribble).joint_q
    theirs = retarget(player, in_other_frames(dribble)).joint_q
    assert np.abs(pose.forward(player, ours) - pose.forward(player, theirs))[..., :3].max() < 1e-6


@pytest.mark.parametrize("turns", [3.0, -3.0])
def test_hands_stay_on_through_three_full_turns(player, turns):
    """Hands are low-passed, and their heading passes half a turn: they still only turn with the body."""
    frames = 361
    angle = 2.0 * np.pi * turns * np.arange(frames) / (frames - 1)
    joint_q = retarget(player, person(player, frames, turns={"Hips": about("z", angle)})).joint_q
    body_q = pose.forward(player, joint_q)
    steady = 2.0 * np.pi * abs(turns) / (len(joint_q) - 1)
    for hand in player.roles.hands:
        turn = Rotation.from_quat(body_q[:, player.body(hand), 3:])
        assert (turn[:-1].inv() * turn[1:]).magnitude()[10:-10] == pytest.approx(steady, rel=0.02)


def walk(player, frames=241, rate=120.0):
    """A person of the player's measures that goes 1.2 m/s: hips and knees swing, ankles and toes too."""
    phase = 2.0 * np.pi * np.arange(frames) / rate
    turns = {"Hips": about("y", 0.0 * phase)}
    for side, shift in (("Left", 0.0), ("Right", np.pi)):
        hip = -0.1 - 0.35 * np.sin(phase + shift)
        knee = 0.25 + 0.45 * (1.0 + np.cos(phase + shift + 0.2)) ** 2 / 2.0
        turns[f"{side}UpLeg"], turns[f"{side}Leg"] = about("y", hip), about("y", knee)
        turns[f"{side}Foot"] = about("y", -hip - knee + 0.25 * (1.0 + np.cos(phase + shift - 0.9)))
        turns[f"{side}ToeBase"] = about("y", -0.2 * (1.0 + np.cos(phase + shift - 0.9)))
    root = np.stack([1.2 * np.arange(frames) / rate, 0 * phase, 0.9 + 0 * phase], axis=1)
    return person(player, frames, rate, turns, root)


def shakes(player, result):
    """[rad/s^2] root mean square of each knee's acceleration between 5 and 30 Hz."""
    band = butter(2, (5.0, 30.0), btype="band", fs=1.0 / player.timestep, output="sos")
    for knee in ("l_knee", "r_knee"):
        angle = result.reference.joint_q[:, player.q_slice(knee)][:, 0]
        faster = sosfiltfilt(band, np.diff(angle, 2)) / player.timestep**2
        yield np.sqrt(np.mean(faster[20:-20] ** 2))


@pytest.mark.parametrize(
    "clip", ["cmu/06_01.bvh", "cmu/09_11.bvh", "ballplay_m/042_018pickle_rturnover_30.pt"]
)
def test_planting_shakes_no_knee_and_drags_no_foot(player, mocap, clip):
    """A walk, a run and a spin."""
    motion, _ = read_clip(mocap / clip)
    result = retargeted(player, motion)
    copied = retargeted(player, motion, ik=False)
    assert np.mean(list(shakes(player, result))) < 1.5 * np.mean(list(shakes(player, copied)))
    assert accuracy(player, result).skimming < 0.05


def test_planting_a_walk_shakes_no_knee_and_drags_no_foot(player):
    motion = walk(player)
    result = retargeted(player, motion)
    copied = retargeted(player, motion, ik=False)
    fit = accuracy(player, result)
    assert all(len(stands) >= 2 for stands in result.stands.values())
    assert fit.sliding < 0.001 and fit.skimming < 0.06 and fit.penetration < 0.002
    assert max(shakes(player, result)) < 1.5 * max(shakes(player, copied)) + 5.0


def test_toes_follow_the_recording_and_it_is_said_which(player):
    motion = walk(player)
    assert retargeted(player, motion).toes == {"l_foot": "LeftToeBase", "r_foot": "RightToeBase"}
    names = tuple(name.replace("ToeBase", "Spur") for name in motion.joint_names)
    without = retargeted(player, replace(motion, joint_names=names))
    assert without.toes == {"l_foot": None, "r_foot": None}
    given = replace(read_mapping("cmu"), bodies=read_mapping("cmu").bodies | {"l_toes": "LeftSpur"})
    assert retargeted(player, replace(motion, joint_names=names), given).toes["l_foot"] == "LeftSpur"


def test_hips_that_shake_from_frame_to_frame_are_still(player):
    """By half a centimetre, as CMU's do, on a sway that stays."""
    times = np.arange(360) / 120.0
    sway = np.zeros((360, 3))
    sway[:, 1] = 0.05 * np.sin(2.0 * np.pi * times)
    shaken = sway + 0.005 * np.where(np.arange(360) % 2, 1.0, -1.0)[:, None] * [1.0, 0.0, 0.0]
    root = player.q_slice("root")
    at = player.zero_pose[player.body("pelvis"), :3]
    clean, noisy = (retarget(player, person(player, 360, root=at + way), ik=False) for way in (sway, shaken))
    off = (noisy.joint_q - clean.joint_q)[:, root]
    assert np.abs(off[20:-20]).max() < 5e-4
    bare = read_mapping("cmu")
    bare = replace(bare, smoothed={k: v for k, v in bare.smoothed.items() if k != "pelvis"})
    raw = retarget(player, person(player, 360, root=at + sway), bare, ik=False)
    assert np.abs((clean.joint_q - raw.joint_q)[20:-20, root]).max() < 1e-3


def test_a_hand_that_is_recorded_the_wrong_way_round_does_not_flip(player):
    """A wrist beyond its range, up to half a turn and over: broken, but no reason to turn over in a row."""
    angle = np.pi + 0.6 * np.sin(np.arange(241) / 20.0)
    motion = person(player, 241, turns={"LeftFingerBase": about("x", angle)})
    for ik in (True, False):
        body_q = pose.forward(player, retarget(player, motion, ik=ik).joint_q)
        turn = Rotation.from_quat(body_q[:, player.body("l_hand"), 3:])
        assert np.degrees((turn[:-1].inv() * turn[1:]).magnitude()).max() < 20.0
