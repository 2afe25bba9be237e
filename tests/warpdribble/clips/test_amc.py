from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.clips.amc import BVH_NAMES, read_amc
from warpdribble.clips.errors import ClipError


def places(path, **reading):
    motion, notes = read_amc(path, **({"units": 1.0, "up": "z"} | reading))
    positions, _ = motion.forward()
    return {name: positions[:, i] for i, name in enumerate(motion.joint_names)}, motion, notes


def test_forward_kinematics_by_hand(amc_clip):
    at, motion, _ = places(amc_clip)
    assert motion.joint_names == ("root", "thigh", "shin", "shin_end")
    # zero pose: thigh along x, shin along y
    assert np.allclose(at["shin"][0], [2, 0, 0])
    assert np.allclose(at["shin_end"][0], [2, 3, 0])
    # the thigh's x axis is the world's y (C = Rz 90): x goes to -z, y stays
    assert np.allclose(at["shin"][1], [10, 20, 28])
    assert np.allclose(at["shin_end"][1], [10, 23, 28])
    # root Rz 90: the thigh along y; shin: first about x (y to z), then about z (z stays)
    assert np.allclose(at["shin"][2], [0, 2, 0], atol=1e-12)
    assert np.allclose(at["shin_end"][2], [0, 2, 3], atol=1e-12)


@pytest.mark.parametrize("order", ["XYZ", "ZYX", "YXZ"])
def test_axis_orders_and_channel_orders_against_matrices(amc_clip, order):
    skeleton = amc_clip.with_name("01.asf")
    text = skeleton.read_text().replace("axis 0 0 0 XYZ", f"axis 20 -35 70 {order}")
    skeleton.write_text(text.replace("dof rx ry rz", "dof rz rx"))
    amc_clip.write_text("1\nroot 1 2 3 10 20 30\nthigh 0\nshin 40 -25\n")
    at, _, _ = places(amc_clip)

    def about(letter, degrees):
        axis = np.eye(3)["XYZ".index(letter)]
        return Rotation.from_rotvec(np.radians(degrees) * axis).as_matrix()

    root = about("Z", 30) @ about("Y", 20) @ about("X", 10)
    values = dict(zip("XYZ", (20, -35, 70)))
    frame = np.eye(3)
    for letter in order:
        frame = about(letter, values[letter]) @ frame
    turn = frame @ (about("X", -25) @ about("Z", 40)) @ frame.T
    knee = np.array([1, 2, 3]) + root @ [2, 0, 0]
    assert np.allclose(at["shin"][0], knee)
    assert np.allclose(at["shin_end"][0], knee + root @ turn @ [0, 3, 0])


def test_radians(amc_clip):
    amc_clip.write_text(amc_clip.read_text().replace(":DEGREES", ":RADIANS").replace("90", "1.5707963268"))
    at, _, _ = places(amc_clip)
    assert np.allclose(at["shin_end"][2], [0, 2, 3], atol=1e-6)


def test_lengths_are_scaled_by_what_is_given_or_by_the_header(amc_clip):
    skeleton = amc_clip.with_name("01.asf")
    at, _, notes = places(amc_clip, units="cm")
    assert np.allclose(at["shin_end"][0], [0.02, 0.03, 0])
    assert any("0.01 m" in note for note in notes)
    skeleton.write_text(skeleton.read_text().replace("length 1.0", "length 0.1"))
    at, _, notes = places(amc_clip, units=None)
    assert np.allclose(at["shin_end"][0], 0.254 * np.array([2, 3, 0]))
    assert any("inches" in note for note in notes)
    skeleton.write_text(skeleton.read_text().replace("length 0.1", "length 0.00001"))
    with pytest.raises(ClipError, match="length unit"):
        places(amc_clip, units=None)


@pytest.mark.parametrize("line", [":SAMPLES-PER-SECOND 60", ":samples-per-second 60.0", ":Frame-Rate 60"])
def test_the_rate_is_the_header_s_or_a_given_one(amc_clip, line):
    bare = amc_clip.read_text()
    _, motion, notes = places(amc_clip)
    assert motion.rate == 120.0 and "rate taken as 120 Hz, the file does not say it" in notes[0]
    amc_clip.write_text(bare.replace(":DEGREES", f":DEGREES\n{line}"))
    _, motion, notes = places(amc_clip)
    assert motion.rate == 60.0 and "rate 60 Hz, as its header says" in notes[0]
    _, motion, notes = places(amc_clip, rate=30.0)
    assert motion.rate == 30.0 and "rate given: 30 Hz" in notes[0]


@pytest.mark.parametrize("word", ["", "0", "-60", "many", "nan", "60 60"])
def test_a_header_s_rate_that_is_none_has_to_be_given(amc_clip, word):
    amc_clip.write_text(amc_clip.read_text().replace(":DEGREES", f":DEGREES\n:SAMPLES-PER-SECOND {word}"))
    with pytest.raises(ClipError, match="frames a second") as refused:
        places(amc_clip)
    assert refused.value.hint == "rate"
    assert places(amc_clip, rate=60.0)[1].rate == 60.0


def cmu_skeleton():
    """ASF text with CMU's bones, a standing person, Y up."""
    spine = ["lowerback", "upperback", "thorax", "lowerneck", "upperneck", "head"]
    bones = {name: (0, 1, 0, 2.0 if i < 3 else 1.2) for i, name in enumerate(spine)}
    chains = [["root", *spine]]
    for side, x in (("l", 1), ("r", -1)):
        leg = [f"{side}{n}" for n in ("hipjoint", "femur", "tibia", "foot", "toes")]
        arm = [f"{side}{n}" for n in ("clavicle", "humerus", "radius", "wrist", "hand", "fingers")]
        down = ((x, 0, 0, 1.7), (0, -1, 0, 7), (0, -1, 0, 8), (0, 0, 1, 2), (0, 0, 1, 1))
        bones |= dict(zip(leg, down))
        for name, length in zip(arm, (3, 5, 3.3, 1.7, 0.7, 0.5)):
            bones[name] = (x, 0, 0, length)
        bones[f"{side}thumb"] = (0, 0, 1, 0.8)
        chains += [["root", *leg], ["thorax", *arm], [f"{side}wrist", f"{side}thumb"]]
    data = "".join(
        f"  begin\n  name {n}\n  direction {x} {y} {z}\n  length {s}\n  axis 0 0 0 XYZ\n  end\n"
        for n, (x, y, z, s) in bones.items()
    )
    links = "".join(f"  {a} {b}\n" for chain in chains for a, b in pairwise(chain))
    return (
        ":units\n  length 0.45\n  angle deg\n:root\n  order TX TY TZ RX RY RZ\n  axis XYZ\n"
        f":bonedata\n{data}:hierarchy\n  begin\n{links}  end\n"
    )


def test_a_cmu_skeleton_reads_like_its_bvh_conversion(tmp_path):
    (tmp_path / "06.asf").write_text(cmu_skeleton())
    clip = tmp_path / "06_01.amc"
    clip.write_text("".join(f"{f}\nroot 0 17 {f} 0 0 0\n" for f in (1, 2, 3)))
    motion, notes = read_amc(clip)
    assert set(BVH_NAMES.values()) <= set(motion.joint_names)
    assert any("CMU, inches over 0.45" in note for note in notes)
    assert "Y points up" in notes
    at, _ = motion.forward()
    left, head = (at[0, motion.index(n)] for n in ("LeftFingerBase", "Head"))
    assert left[1] > 0.5 and head[2] > motion.root_position[0, 2] + 0.3
    assert motion.root_position[0] == pytest.approx([0.056444, 0, 17 * 0.056444], abs=1e-4)


BROKEN = {
    "a number missing": lambda t: t.replace("shin 90 0 90", "shin 90 0"),
    "a word": lambda t: t.replace("thigh 90", "thigh up"),
    "not a number": lambda t: t.replace("thigh 90", "thigh nan"),
    "a bone missing": lambda t: t.replace("thigh 90\n", ""),
    "a bone twice": lambda t: t.replace("thigh 90\n", "thigh 90\nthigh 90\n"),
    "an unknown bone": lambda t: t.replace("thigh 90", "tail 90"),
    "cut": lambda t: t[:-20],
    "no frames": lambda t: t.split("\n1\n")[0],
    "empty": lambda t: "",
}
BROKEN_SKELETONS = {
    "no hierarchy": lambda t: t.split(":hierarchy")[0],
    "a bone left out": lambda t: t.replace("thigh shin\n", ""),
    "a loop": lambda t: t.replace("thigh shin", "shin shin"),
    "a root of itself": lambda t: t.replace("thigh shin", "thigh root"),
    "a wrong order": lambda t: t.replace("axis 0 0 90 XYZ", "axis 0 0 90 XXZ"),
    "a shifting bone": lambda t: t.replace("dof rx ry rz", "dof tx ry rz"),
    "a name missing": lambda t: t.replace("name shin", ""),
    "no end": lambda t: t.replace("  end\n:hierarchy", ":hierarchy"),
    "a length of none": lambda t: t.replace("length 1.0", "length 0"),
    "two bones of a name": lambda t: t.replace("name shin", "name thigh"),
    "a huge length": lambda t: t.replace("length 3", "length 1e300"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_broken_clips_are_refused_in_one_line(amc_clip, kind):
    amc_clip.write_text(BROKEN[kind](amc_clip.read_text()))
    with pytest.raises(ClipError) as refused:
        read_amc(amc_clip)
    assert str(amc_clip) in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("kind", BROKEN_SKELETONS)
def test_broken_skeletons_are_refused_in_one_line(amc_clip, kind):
    skeleton = amc_clip.with_name("01.asf")
    skeleton.write_text(BROKEN_SKELETONS[kind](skeleton.read_text()))
    with pytest.raises(ClipError) as refused:
        read_amc(amc_clip, units="m", up="z")
    assert str(skeleton) in str(refused.value) and "\n" not in str(refused.value)


def test_the_skeleton_is_found_beside_or_given(amc_clip, tmp_path):
    skeleton = amc_clip.with_name("01.asf")
    text = skeleton.read_text()
    skeleton.rename(tmp_path / "other.asf")
    places(amc_clip)  # the only one there
    (tmp_path / "another.asf").write_text(text)
    with pytest.raises(ClipError, match=r"needs its skeleton, 01.asf.*another.asf, other.asf"):
        places(amc_clip)
    places(amc_clip, asf=tmp_path / "other.asf")
    for path in tmp_path.glob("*.asf"):
        path.unlink()
    with pytest.raises(ClipError, match="there is none"):
        places(amc_clip)
