"""One motion on skeletons drawn in every way gives one player: zero angles at any pose, bones along one axis,
any order, more joints, another size. The oracle is the same motion on a skeleton with a T-pose."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.sims.retarget.person import about, person
from tests.sims.retarget.rigs import (
    at_its_rest,
    fingers,
    in_a_line,
    on_a_carrier,
    redrawn,
    reordered,
    scaled,
    split,
    with_more,
    without,
    zero_at,
)
from warpdribble.clips import read_clip
from warpdribble.sims import Model
from warpdribble.sims.model import pose
from warpdribble.sims.retarget.mapping import MappingError, find_mapping, read_mapping
from warpdribble.sims.retarget.retarget import retarget, retargeted


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module")
def walk(player):
    """Steps on the spot, arms that swing beside the body, trunk and head that turn against each other; the
    skeleton has fingers and ends of head and toes."""
    frames = 121
    swing = np.sin(2.0 * np.pi * np.arange(frames) / 120.0)
    turns = {"Spine1": about("z", 0.2 * swing), "Head": about("z", -0.2 * swing) * about("x", 0.05 * swing)}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        turns[f"{side}Arm"] = about("y", 0.5 * sign * swing) * about("x", np.full(frames, -1.2 * sign))
        turns[f"{side}ForeArm"] = about("z", -sign * (0.5 + 0.2 * swing))
        turns[f"{side}FingerBase"] = about("x", 0.1 * sign * swing)
        lifted = np.maximum(sign * swing, 0.0)
        turns[f"{side}UpLeg"] = about("y", -0.8 * lifted)
        turns[f"{side}Leg"] = about("y", 1.4 * lifted)
        turns[f"{side}Foot"] = about("y", -0.3 * lifted)
    ends = {"Head_end": ("Head", [0.0, 0.0, 0.2])}
    ends |= {f"{s}ToeBase_end": (f"{s}ToeBase", [0.06, 0.0, 0.0]) for s in ("Left", "Right")}
    return with_more(person(player, frames, turns=turns), ends | fingers())


@pytest.fixture(scope="module")
def plain(player, walk):
    """The walk on the player, from a skeleton with a T-pose."""
    return retargeted(player, walk)


DRAWN = {
    "A": lambda m: zero_at(m, LeftArm=[-45, 0, 0], RightArm=[45, 0, 0]),
    "A, elbows bent": lambda m: zero_at(m, LeftArm=[-45, 0, 0], RightArm=[45, 0, 0], LeftForeArm=[0, 0, -20]),
    "arms hanging": lambda m: zero_at(m, LeftArm=[-85, 0, 0], RightArm=[85, 0, 0]),
    "legs apart on flat feet": lambda m: zero_at(
        m, LeftUpLeg=[30, 0, 0], RightUpLeg=[-30, 0, 0], LeftFoot=[-30, 0, 0], RightFoot=[30, 0, 0]
    ),
    "toes down": lambda m: zero_at(m, LeftFoot=[0, 65, 0], RightFoot=[0, 65, 0], LeftArm=[-80, 0, 0]),
    "turned by 40": lambda m: zero_at(m, Hips=[0, 0, 40]),
    "backward, A": lambda m: zero_at(m, Hips=[0, 0, 180], LeftArm=[45, 0, 0], RightArm=[-45, 0, 0]),
    "lying": lambda m: zero_at(m, Hips=[0, 90, 0]),
    "on the side": lambda m: zero_at(m, Hips=[90, 0, 0]),
    "head down": lambda m: zero_at(m, Hips=[180, 0, 0]),
    "sitting": lambda m: zero_at(
        m, LeftUpLeg=[0, -85, 0], RightUpLeg=[0, -85, 0], LeftLeg=[0, 85, 0], RightLeg=[0, 85, 0]
    ),
}
LINES = {
    "in a line": lambda m: in_a_line(m),
    "right side mirrored": lambda m: in_a_line(m, right=-1.0),
    "quarter turns": lambda m: in_a_line(m, twist=np.random.default_rng(0), by=[0.0, 90.0, 180.0, 270.0]),
    "any turns": lambda m: in_a_line(m, right=-1.0, twist=np.random.default_rng(1)),
    "any frames": lambda m: redrawn(m, list(Rotation.random(len(m.parents), random_state=2))),
}


def apart(player, one, other):
    """[m] mean and largest distance between the bodies of two motions, fingers left out."""
    bodies = [i for i, name in enumerate(player.body_names) if name[-2:-1] != "_" and name != "ball"]
    places = [
        pose.forward(player, q)[:, bodies, :3] for q in (one.reference.joint_q, other.reference.joint_q)
    ]
    far = np.linalg.norm(places[0] - places[1], axis=-1)
    return far.mean(), far.max()


@pytest.mark.parametrize("drawn", DRAWN)
def test_zero_angles_may_be_any_pose(player, walk, plain, drawn):
    """Nothing is lost but what a bent elbow hides of the hand, and it is said."""
    result = retargeted(player, DRAWN[drawn](walk))
    mean, most = apart(player, result, plain)
    assert mean < 0.005 and most < 0.02
    assert len(result.notes) == 1 and result.notes[0].startswith("T-pose: the rest pose, ")


@pytest.mark.parametrize("drawn", LINES)
def test_zero_angles_may_be_nobody_s_pose(player, walk, plain, drawn):
    result = retargeted(player, LINES[drawn](walk))
    mean, most = apart(player, result, plain)
    assert mean < 0.02 and most < 0.06
    assert result.notes[0].startswith("T-pose: built from the bones' directions and the clip")


def test_a_t_pose_is_left_alone_without_a_word(plain):
    assert plain.notes == ()


@pytest.mark.parametrize("drawn", ["A", "in a line"])
def test_order_number_and_size_of_the_joints_do_not_matter(player, walk, drawn):
    """Fingers before legs, more of them than the player has bodies, a person twice as tall."""
    draw = (DRAWN | LINES)[drawn]
    plain = retargeted(player, draw(walk))
    for seed in range(3):
        other = reordered(scaled(draw(walk), 2.0), seed)
        assert apart(player, plain, retargeted(player, other))[1] < 1e-9


def test_toes_are_found_behind_any_number_of_joints(player, walk):
    """The player's number of bodies is no limit to the recording's joints; a longer heel is no toes."""
    more = {f"Marker{i}": ("Head", [0.0, 0.0, 0.1]) for i in range(60)}
    more |= {f"{side}Heel": (f"{side}Foot", [-0.3, 0.0, -0.07]) for side in ("Left", "Right")}
    for drawn in (in_a_line, DRAWN["toes down"]):
        plain = retargeted(player, drawn(walk))
        for seed in range(3):
            assert (
                apart(player, plain, retargeted(player, reordered(with_more(drawn(walk), more), seed)))[1]
                < 1e-9
            )


@pytest.mark.parametrize("drawn", ["A", "in a line", "right side mirrored"])
def test_roll_bones_and_a_root_that_carries_the_person_change_nothing(player, walk, drawn):
    draw, rolled = (DRAWN | LINES)[drawn], on_a_carrier(walk)
    for side in ("Left", "Right"):
        for joint in ("Leg", "Foot", "ForeArm", "FingerBase"):
            rolled = split(rolled, side + joint)
    result = retargeted(player, draw(rolled))
    assert result.scale == pytest.approx(1.0)
    assert apart(player, result, retargeted(player, draw(walk)))[1] < 0.002


def test_feet_without_toes_and_hands_without_fingers(player, walk, plain):
    """Less is known of them, and they still go where they went."""
    bare = without(in_a_line(walk), ("Toe", "Hand", "_end"))
    mean, most = apart(player, retargeted(player, bare), plain)
    assert mean < 0.03 and most < 0.1


def test_the_pose_of_the_clip_does_not_matter(player, walk):
    """Lying on the belly and with the head down as well as upright: nothing is told from where up is."""
    upright = retargeted(player, in_a_line(walk), ik=False)
    for turn in (about("y", [np.pi / 2]), about("x", [np.pi])):
        lying = in_a_line(walk)
        rotations = lying.rotations.copy()
        rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
        result = retargeted(player, replace(lying, rotations=rotations), ik=False)
        bodies = [pose.forward(player, r.reference.joint_q)[:, :, 3:] for r in (upright, result)]
        for name in ("torso", "head", "l_hand", "r_lower_arm", "l_upper_leg", "r_foot"):
            one, other = (Rotation.from_quat(b[:, player.body(name)]) for b in bodies)
            assert ((turn * one).inv() * other).magnitude().max() < np.radians(10.0), name


@pytest.mark.parametrize("clip", ["cmu/02_01.bvh", "cmu/06_03.bvh", "ballplay_m/044_006pickle_lleg_2.pt"])
def test_recordings_on_other_skeletons(player, mocap, clip):
    """Bones along X, mirrored on the right: near the file's own T-pose."""
    motion, _ = read_clip(mocap / clip)
    motion = at_its_rest(replace(motion, positions=None))
    mapping = replace(find_mapping(motion), palms={}, supinated={})
    plain = retargeted(player, motion, mapping)
    for right in (1.0, -1.0):
        mean, most = apart(player, plain, retargeted(player, in_a_line(motion, right), mapping))
        assert mean < 0.03 and most < 0.11


def test_a_mapping_may_say_what_the_rest_pose_is(player, walk, plain):
    hanging = DRAWN["arms hanging"](walk)
    result = retargeted(player, hanging, replace(read_mapping("cmu"), rest="recorded"))
    assert result.notes == (
        "T-pose: the rest pose, as the mapping says, though off by degrees: LeftArm 85, RightArm 85",
    )
    result = retargeted(player, hanging, replace(read_mapping("cmu"), rest="directions"))
    assert result.notes[0].endswith("; the mapping asks for it")
    assert apart(player, result, plain)[0] < 0.02


def test_a_mapping_without_collar_bones(player, walk):
    cmu = read_mapping("cmu")
    mapping = replace(
        cmu, bodies={body: joint for body, joint in cmu.bodies.items() if "clavicle" not in body}
    )
    plain = retargeted(player, walk, mapping)
    for drawn in ("A", "in a line"):
        assert apart(player, plain, retargeted(player, (DRAWN | LINES)[drawn](walk), mapping))[0] < 0.02


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"bodies": "pelvis"}, r"bodies\.pelvis: missing"),
        ({"arms": "l_elbow"}, "arms: should be a left and a right one"),
        ({"bodies": "head"}, "bodies: names no head; a T-pose from directions needs it"),
    ],
)
def test_what_a_mapping_must_name(player, walk, change, said):
    cmu = read_mapping("cmu")
    ((table, key),) = change.items()
    rest = {k: v for k, v in getattr(cmu, table).items() if k != key}
    with pytest.raises(MappingError, match=f"^cmu: {said}$"):
        retarget(player, in_a_line(walk), replace(cmu, **{table: rest}))


def test_one_pose_is_enough(player, walk):
    """A clip that stands still shows no axis of a knee or elbow."""
    still = replace(
        walk, rotations=walk.rotations[:1].repeat(5, axis=0), root_position=walk.root_position[:5]
    )
    assert apart(player, retargeted(player, in_a_line(still)), retargeted(player, still))[1] < 0.06


def test_exchanged_sides_are_refused(player, walk):
    names = tuple(
        n.replace("Left", "?").replace("Right", "Left").replace("?", "Right") for n in walk.joint_names
    )
    with pytest.raises(MappingError, match="cmu: the feet point backward: LeftUpLeg is on the right"):
        retarget(player, replace(walk, joint_names=names))


@pytest.mark.parametrize(
    ("joint", "said"),
    [
        ("LeftForeArm", r"arms\.l_elbow: no bone leads from LeftArm to LeftForeArm"),
        ("RightFoot", r"legs\.r_knee: no bone leads from RightLeg to RightFoot"),
    ],
)
def test_a_limb_without_length_is_refused(player, walk, joint, said):
    offsets = walk.offsets.copy()
    offsets[walk.index(joint)] = 0.0
    with pytest.raises(MappingError, match=f"^cmu: {said}$"):
        retarget(player, replace(walk, offsets=offsets))


def test_hips_in_one_place_are_refused(player, walk):
    flat = in_a_line(walk)
    offsets = flat.offsets.copy()
    offsets[flat.index("LeftUpLeg")] = offsets[flat.index("RightUpLeg")]
    with pytest.raises(MappingError, match="cmu: the hips and the spine do not show which way is left"):
        retarget(player, replace(flat, offsets=offsets))
