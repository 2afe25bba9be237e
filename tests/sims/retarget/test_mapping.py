from dataclasses import replace

import pytest

from warpdribble.clips.read import read_clip
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


def test_a_prefix_may_be_there_or_not(mocap):
    motion, _ = read_clip(mocap / "cmu" / "06_01.bvh")
    mapping = replace(read_mapping("cmu"), prefix="rig:")
    named = replace(motion, joint_names=tuple("rig:" + n for n in motion.joint_names))
    assert mapping.fits(motion) and mapping.fits(named)
    assert mapping.plain(named).joint_names == motion.joint_names


def test_lafan_and_mixamo_share_names_and_are_told_apart_by_their_bones():
    import numpy as np

    from warpdribble.sims.recording.motion import Motion

    names = sorted({*read_mapping("mixamo").joints()}, key=lambda n: n != "Hips")
    parents = np.array([-1] + [0] * (len(names) - 1))

    def motion(offset):
        offsets = np.tile([0.1, 0.0, 0.0], (len(names), 1))
        offsets[names.index("LeftForeArm")] = offset
        still = np.tile([0.0, 0.0, 0.0, 1.0], (2, len(names), 1))
        return Motion(tuple(names), parents, offsets, still, np.zeros((2, 3)), 60.0, still[0])

    assert find_mapping(motion([0.2, 0.0, 0.0])).name == "lafan"
    assert find_mapping(motion([0.0, 0.2, 0.0])).name == "mixamo"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("[arms]", "[wings]"), "wings: unknown key"),
        (('["A", "B", "C"]', '["A", "B"]'), r"arms\.l_elbow: should be a list of 3"),
        (('pelvis = "Hips"', "pelvis = 3"), r"bodies\.pelvis: should be the name"),
        (("[bodies]", 'rest = "lying"\n[bodies]'), "rest: recorded or directions"),
        (("[bodies]", "prefix = 1\n[bodies]"), "prefix: should be a text"),
        (('[legs]\nl_knee = ["D", "E", "F"]\n', ""), "legs: missing"),
        (("[bodies]", "[bodies"), "not TOML"),
        (("[legs]", "[smoothed]\nl_hand = -1\n[legs]"), r"smoothed\.l_hand: should be a frequency"),
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
