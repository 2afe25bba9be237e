import numpy as np
import pytest

from warpdribble.clips.read import read_clip
from warpdribble.sims.recording.motion import Motion
from warpdribble.sims.retarget.mapping import SHIPPED, MappingError, find_mapping, parse_mapping, read_mapping

SMALL = """
[bodies]
pelvis = "Hips"
[arms]
l_elbow = ["A", "B", "C"]
[legs]
l_knee = ["D", "E", "F"]
"""


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_mappings_name_the_player_s_bodies(name):
    from warpdribble.sims import Model

    mapping = read_mapping(name)
    mapping.check_model(Model.load("player"))
    assert len(mapping.bodies) == 18 and len(mapping.limbs) == 4


@pytest.mark.parametrize(
    ("clip", "name"),
    [("cmu/06_12.bvh", "cmu"), ("cmu/09_01.bvh", "cmu"), ("ballplay_m/013_018pickle_run_3.pt", "ballplay")],
)
def test_the_mapping_is_told_from_the_clip(mocap, clip, name):
    assert find_mapping(read_clip(mocap / clip)[0]).name == name


def still(names):
    """Two frames of a skeleton with these names, all below the first, at a place of its own each."""
    names = tuple(names)
    offsets = np.random.default_rng(0).uniform(-0.1, 0.1, (len(names), 3))
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (2, len(names), 1))
    parents = np.array([-1] + [0] * (len(names) - 1))
    return Motion(names, parents, offsets, turns, np.zeros((2, 3)), 60.0, turns[0])


def joints(name):
    return sorted({*read_mapping(name).joints()})


SPACES = (
    "mixamorig:",
    "mixamorig1:",
    "Character1:",
    "mixamorig_",
    "Character1_",
    "mixamorig",
    "a:rig:",
    "me|",
    "x y ",
)


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("name", ["mixamo", "cmu"])
def test_any_namespace_is_taken_off(name, space):
    motion = still([*(space + joint for joint in joints(name)), "Sword", "Camera"])
    assert find_mapping(motion).name == name
    assert {*joints(name), "Sword"} <= set(find_mapping(motion).plain(motion).joint_names)


def test_a_namespace_may_differ_from_joint_to_joint_and_from_the_mapping_s():
    motion = still(f"{'ab'[i % 2]}:{joint}" for i, joint in enumerate(joints("mixamo")))
    assert find_mapping(motion).name == "mixamo"
    words = SMALL.replace('"Hips"', '"me:Hips"')
    for letter in "ABCDEF":
        words = words.replace(f'"{letter}"', f'"me:{letter}"')
    own = parse_mapping(words, "mine.toml")
    assert own.plain(still(f"you:{n}" for n in ("Hips", *"ABCDEF"))).joint_names[1] == "me:A"


@pytest.mark.parametrize("space", ["", "mixamorig1:"])
def test_all_that_is_missing_is_listed(space):
    names = [space + joint for joint in joints("mixamo") if joint not in ("Spine2", "RightArm")]
    with pytest.raises(
        MappingError, match=r"mixamo comes nearest, and lacks (Spine2, RightArm|RightArm, Spine2);"
    ):
        find_mapping(still(names))
    with pytest.raises(MappingError, match=r"no joint 'Spine2' in this motion, nor RightArm; it has "):
        read_mapping("mixamo").plain(still(names))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("[arms]", "[wings]"), "wings: unknown key"),
        (('["A", "B", "C"]', '["A", "B"]'), r"arms\.l_elbow: should be a list of 3"),
        (('pelvis = "Hips"', "pelvis = 3"), r"bodies\.pelvis: should be the name"),
        (("[bodies]", 'rest = "lying"\n[bodies]'), "rest: told, recorded, directions"),
        (("[bodies]", "description = 1\n[bodies]"), "description: should be a text"),
        (('[legs]\nl_knee = ["D", "E", "F"]\n', ""), "legs: missing"),
        (("[bodies]", "[bodies"), "not TOML"),
        (("[legs]", "[smoothed]\nl_hand = -1\n[legs]"), r"smoothed\.l_hand: should be a frequency"),
        (("[legs]", "[supinated]\nl_hand = 200\n[legs]"), r"supinated\.l_hand: should be an angle from -180"),
    ],
)
def test_a_wrong_file_is_said_with_name_and_key(change, said):
    text = SMALL.replace(*change)
    with pytest.raises(MappingError, match=f"^mine.toml: {said}"):
        parse_mapping(text, "mine.toml")


def test_a_file_of_one_s_own(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(SMALL)
    assert read_mapping(path).arms == {"l_elbow": ("A", "B", "C")}
    with pytest.raises(MappingError, match="no such file"):
        read_mapping(tmp_path / "other.toml")
    with pytest.raises(MappingError, match="a mapping is cmu, ballplay"):
        read_mapping("xsens")
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(MappingError, match="not a TOML file"):
        read_mapping(path)
