import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.warpdribble.conftest import skeleton
from warpdribble.clips.bvh import read_bvh
from warpdribble.clips.errors import ClipError
from warpdribble.clips.space import CMU_UNIT


def length(motion, joint):
    return np.linalg.norm(motion.offsets[motion.index(joint)])


def test_cmu_bone_lengths_of_subject_06(mocap):
    motion, notes = read_bvh(mocap / "cmu" / "06_12.bvh")
    left = {"LeftUpLeg": 0.149, "LeftLeg": 0.401, "LeftFoot": 0.460, "LeftToeBase": 0.117}
    left |= {"LeftToeBase_end": 0.059, "LeftForeArm": 0.286, "LeftHand": 0.199}
    left |= {"LeftFingerBase": 0.099, "LeftHandIndex1": 0.037}
    right = {"RightUpLeg": 0.143, "RightLeg": 0.413, "RightFoot": 0.458, "RightToeBase": 0.125}
    right |= {"RightToeBase_end": 0.062, "RightForeArm": 0.305, "RightHand": 0.177}
    right |= {"RightFingerBase": 0.088, "RightHandIndex1": 0.047}
    for joint, metres in (left | right).items():
        assert length(motion, joint) == pytest.approx(metres, abs=6e-4), joint
    thorax = motion.offsets[motion.index("Neck")]
    assert np.allclose(thorax, [0.015, 0.005, 0.115], atol=6e-4)
    assert any("lost bone lengths" in note and "LeftShoulder" in note for note in notes)


def test_cmu_posture_of_subject_06(mocap):
    motion, _ = read_bvh(mocap / "cmu" / "06_01.bvh")
    positions, _ = motion.forward()
    hips = positions[:, motion.index("Hips"), 2]
    head = positions[:, motion.index("Head_end"), 2]
    assert np.median(hips) == pytest.approx(1.0, abs=0.03)
    assert np.median(head) == pytest.approx(1.63, abs=0.03)


def test_cmu_dribbling_hand_matches_the_table(mocap):
    motion, _ = read_bvh(mocap / "cmu" / "06_12.bvh")
    assert (motion.frame_count, motion.rate) == (1222, pytest.approx(120.0))
    part = motion.slice(400, 1040)
    hand = part.forward()[0][:, motion.index("RightHandIndex1_end"), 2]
    lows = np.array([low.min() for low in np.array_split(hand, 7)])
    assert np.median(lows) == pytest.approx(0.77, abs=0.06)


def test_every_cmu_clip_reads(mocap):
    clips = sorted((mocap / "cmu").glob("*.bvh"))
    assert clips
    for path in clips:
        _, notes = read_bvh(path)
        assert len(notes) == 4, path


def test_the_t_pose_faces_x_with_the_left_side_toward_y(cmu_clip):
    motion, notes = read_bvh(cmu_clip)
    assert motion.frame_count == 121
    places, _ = motion.rest()
    left, right = places[motion.index("LeftHand")], places[motion.index("RightHand")]
    assert left[1] > 0.5 and right[1] < -0.5
    assert places[motion.index("LeftToeBase"), 0] > places[motion.index("LeftFoot"), 0]
    assert places[motion.index("Head_end"), 2] > 0.3
    assert any("T-pose" in note for note in notes)


def test_turning_about_the_file_s_up_axis_turns_about_z(cmu_clip):
    motion, _ = read_bvh(cmu_clip)
    turn = Rotation.from_quat(motion.rotations[0, 0]).as_rotvec()
    assert np.allclose(turn, [0.0, 0.0, np.pi / 2], atol=1e-6)
    assert np.allclose(motion.root_position[0], CMU_UNIT * np.array([40.0, 3.0, 17.0]))


def test_lost_lengths_are_put_back_and_others_left(cmu_clip):
    motion, _ = read_bvh(cmu_clip)
    assert length(motion, "LeftFingerBase") == pytest.approx(0.5 * length(motion, "LeftHand"))
    assert length(motion, "RightShoulder") == pytest.approx(0.115, abs=0.01)
    assert length(motion, "LHipJoint") == length(motion, "LowerBack") == 0.0


def test_the_conversion_is_known_in_any_namespace_and_with_positions_everywhere(cmu_clip):
    wanted, notes = read_bvh(cmu_clip)
    text = re.sub(r"(ROOT|JOINT) ", r"\1 me1:", cmu_clip.read_text())
    text = text.replace("CHANNELS 3", "CHANNELS 6 Xposition Yposition Zposition")
    offsets = [" ".join(map(str, one)) for one in (offset for _, offset in skeleton().values())]
    lines = text.splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    for i, line in enumerate(lines[first:], first):
        words = line.split()
        turns = [" ".join(words[j : j + 3]) for j in range(6, len(words), 3)]
        bones = [f"{place} {turn}" for place, turn in zip(in_order(offsets), turns, strict=True)]
        lines[i] = " ".join([*words[:6], *bones])
    cmu_clip.write_text("\n".join(lines) + "\n")
    motion, said = read_bvh(cmu_clip)
    assert said == notes and motion.positions is None
    assert motion.joint_names[0] == "me1:Hips"
    assert np.allclose(motion.forward()[0], wanted.forward()[0], atol=1e-5)


def in_order(offsets):
    """Of the joints below the root, as the file has them: depth first."""
    names, parents = list(skeleton()), [parent for parent, _ in skeleton().values()]

    def below(name):
        for i, parent in enumerate(parents):
            if parent == name:
                yield offsets[i]
                yield from below(names[i])

    return list(below("Hips"))


def test_centimetres_are_told_from_metres(cmu_clip, tmp_path):
    text = cmu_clip.read_text().replace("LowerBack", "Abdomen")
    scaled = tmp_path / "scaled.bvh"
    lines = []
    for line in text.splitlines():
        head, _, rest = line.partition("OFFSET")
        if rest:
            line = f"{head}OFFSET " + " ".join(str(5.6 * float(v)) for v in rest.split())
        lines.append(line)
    scaled.write_text("\n".join(lines) + "\n")
    motion, notes = read_bvh(scaled)
    assert any("centimetre" in note for note in notes)
    assert length(motion, "LeftLeg") == pytest.approx(0.403, abs=0.01)


def test_a_unit_that_cannot_be_told_is_refused(cmu_clip, tmp_path):
    odd = tmp_path / "odd.bvh"
    odd.write_text(cmu_clip.read_text().replace("LowerBack", "Abdomen"))
    with pytest.raises(ClipError, match="length unit"):
        read_bvh(odd)


def cut(text, share):
    return text[: int(len(text) * share)]


BROKEN = {
    "cut in a number": lambda t: cut(t, 0.9),
    "cut in the hierarchy": lambda t: cut(t, 0.02),
    "a row too short": lambda t: t.rsplit(" ", 1)[0] + "\n",
    "no motion": lambda t: t.split("MOTION")[0],
    "a word among the numbers": lambda t: t.replace("3.00000 17.00000", "3.00000 high", 1),
    "not a number": lambda t: t.replace("17.00000", "nan", 1),
    "infinite": lambda t: t.replace("17.00000", "inf", 1),
    "no frames": lambda t: "\n".join(t.splitlines()[:-122]) + "\n",
    "no frame time": lambda t: t.replace("Frame Time: 0.0083333", "Frame Time: 0"),
    "negative frame time": lambda t: t.replace("Frame Time: 0.0083333", "Frame Time: -0.01"),
    "empty": lambda t: "",
    "another text": lambda t: "hello, this is no motion\n",
    "offset of two numbers": lambda t: t.replace("OFFSET 0.00000 0.00000 0.00000", "OFFSET 0 0", 1),
    "unbalanced braces": lambda t: t.replace("}", "", 3),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_broken_files_are_refused_in_one_line(cmu_clip, kind):
    cmu_clip.write_text(BROKEN[kind](cmu_clip.read_text()))
    with pytest.raises(ClipError) as refused:
        read_bvh(cmu_clip)
    assert str(cmu_clip) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_random_bytes_are_refused(tmp_path):
    path = tmp_path / "noise.bvh"
    path.write_bytes(np.random.default_rng(0).bytes(4000))
    with pytest.raises(ClipError):
        read_bvh(path)


@pytest.mark.parametrize("name", ["missing.bvh", "folder.bvh", "clip.fbx"])
def test_what_is_no_bvh_file_is_refused(tmp_path, name):
    path = tmp_path / name
    if name.startswith("folder"):
        path.mkdir()
    elif not name.startswith("missing"):
        path.write_text("x")
    with pytest.raises(ClipError):
        read_bvh(path)
