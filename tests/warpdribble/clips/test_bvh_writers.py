"""BVH as it is written in the world: the same motion from all of it, or a note, or a refusal."""

import re

import numpy as np
import pytest

from tests.warpdribble.clips.writer import PERSON, SIX, TURNS, Clip
from warpdribble.clips.bvh import read_bvh
from warpdribble.clips.errors import ClipError
from warpdribble.clips.read import read_clip
from warpdribble.sims.errors import InputError

ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")


def turns(letters):
    return " ".join(f"{letter}rotation" for letter in letters)


@pytest.fixture
def written(tmp_path):
    def write(text, encoding="utf-8"):
        path = tmp_path / "clip.bvh"
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        return path

    return write


def check(motion, clip, **how):
    at = motion.places()
    for name, wanted in clip.places(**how).items():
        if name in motion.joint_names:
            assert np.allclose(at[:, motion.index(name)], wanted, atol=2e-6), name


KINDS = {
    "six at every joint": dict.fromkeys(PERSON, SIX),
    "rotations first": dict.fromkeys(PERSON, f"{TURNS} Xposition Yposition Zposition"),
    "mixed up": dict.fromkeys(PERSON, "Yrotation Zposition Xrotation Xposition Yposition Zrotation"),
    "an order for each": {n: turns(ORDERS[i % 6]) for i, n in enumerate(list(PERSON)[1:])},
    "hinges": {"LeftLeg": "Xrotation", "RightLeg": "Xrotation", "LeftHand": turns("ZX"), "Head": turns("YX")},
    "true Euler angles": {"LeftUpLeg": turns("ZXZ"), "RightUpLeg": turns("YXY")},
    "nothing at the hand": {"LeftHand": "", "RightHand": ""},
    "one position": {"Spine": f"Yposition {TURNS}"},
}


@pytest.mark.parametrize("kind", KINDS)
def test_any_channels_at_any_joint(written, kind):
    clip = Clip(channels=KINDS[kind])
    motion, notes = read_bvh(written(clip.text()), "cm", "y")
    check(motion, clip)
    assert motion.positions is None and not any("positions" in note for note in notes)


def wrapped(text):
    head, _, rows = text.partition("Frame Time: 0.0166667\n")
    words = rows.split()
    lines = [" ".join(words[i : i + 7]) for i in range(0, len(words), 7)]
    return f"{head}Frame Time: 0.0166667\n" + "\n".join(lines) + "\n"


FORMS = {
    "CRLF": lambda t: t.replace("\n", "\r\n"),
    "CR": lambda t: t.replace("\n", "\r"),
    "byte-order mark": lambda t: t.encode("utf-8-sig"),
    "UTF-16": lambda t: t.encode("utf-16"),
    "blanks": lambda t: re.sub(r"[ \t]+", " \t  ", t).replace("\n", "  \n\n"),
    "no blanks before lines": lambda t: re.sub(r"\n[ \t]+", "\n", t),
    "braces beside the names": lambda t: re.sub(r"\n[ \t]*\{", " {", t),
    "no blanks at braces": lambda t: re.sub(r"\s*([{}])\s*", r"\1", t).replace("}MOTION", "}\nMOTION"),
    "small letters": lambda t: re.sub(
        r"[A-Z]{4,}|[XYZ](?=rot|pos)|End Site|Frame", lambda m: m[0].lower(), t
    ),
    "wrapped rows": wrapped,
    "decimal commas": lambda t: t.replace(".", ","),
    "no line end": lambda t: t.rstrip("\n"),
    "no colons": lambda t: t.replace(":", ""),
    "Latin-1": lambda t: t.replace("Chest", "Br\xfcst").encode("latin-1"),
    "exponents": lambda t: re.sub(r"(\d+)\.(\d+)", r"\1.\2e+00", t),
}


@pytest.mark.parametrize("form", FORMS)
def test_any_form_of_text(written, form):
    clip = Clip()
    motion, _ = read_bvh(written(FORMS[form](clip.text())), "cm", "y")
    assert (motion.frame_count, motion.rate) == (5, 60.0)
    assert ("Br\xfcst" if form == "Latin-1" else "Chest") in motion.joint_names
    check(motion, clip)


def test_positions_that_are_the_bones_true_lengths(written):
    clip = Clip(channels=dict.fromkeys(PERSON, SIX))
    clip.values["LeftLeg"]["Yposition"] += 3.0
    clip.values["RightArm"]["Xposition"] -= 1.0
    path = written(clip.text())
    motion, notes = read_bvh(path, "cm", "y")
    check(motion, clip)
    assert motion.positions is None
    assert any(
        "positions of RightArm, LeftLeg differ from their offsets" in n
        and "3 cm at LeftLeg: used as lengths" in n
        for n in notes
    ), notes
    dropped, notes = read_bvh(path, "cm", "y", drop_positions=True)
    check(dropped, clip, positions=False)
    assert any("3 cm at LeftLeg: dropped" in n for n in notes)


def test_positions_that_change_are_recorded_places(written):
    clip = Clip(channels=dict.fromkeys(PERSON, SIX), frames=9)
    clip.values["LeftForeArm"]["Xposition"] += np.linspace(0.0, 2.0, 9)
    path = written(clip.text())
    for up, units in (("y", "cm"), (None, None)):
        motion, notes = read_bvh(path, units, up)
        check(motion, clip)
        assert motion.positions is not None
        assert any("2 cm at LeftForeArm: used as recorded places" in n for n in notes)
    dropped, _ = read_bvh(path, "cm", "y", drop_positions=True)
    assert dropped.positions is None
    check(dropped, clip, positions=False)


def test_positions_that_are_added_to_the_offsets(written):
    clip = Clip(channels=dict.fromkeys(PERSON, SIX))
    text = clip.text()
    moved = Clip(channels=dict.fromkeys(PERSON, SIX))
    for name, (parent, _) in PERSON.items():
        if parent:
            moved.values[name] |= {f"{axis}position": np.zeros(5) for axis in "XYZ"}
    motion, notes = read_bvh(written(moved.text()), "cm", "y")
    check(motion, clip)
    assert any("taken as added to the offsets" in note for note in notes)
    assert not any("added" in note for note in read_bvh(written(text), "cm", "y")[1])


def carried_by(*above, beside=()):
    """The person below further joints, with helpers beside the hips."""
    bones, parent = {}, ""
    for name in above:
        bones[name] = (parent, (0, 0, 0))
        parent = name
    bones |= {name: (above[-1], (0, 0, 0)) for name in beside}
    return bones | PERSON | {"Hips": (parent, (0, 0, 0))}


@pytest.mark.parametrize("beside", [(), ("ik_foot_l", "camera")])
@pytest.mark.parametrize("above", [("Reference",), ("Armature", "Root")])
@pytest.mark.parametrize("ahead", [0.0, 0.5, 30.0])
def test_a_root_that_only_carries_the_hips_moves_with_them(written, above, beside, ahead):
    bones = carried_by(*above, beside=beside)
    clip = Clip(bones, dict.fromkeys(bones, SIX))
    first = clip.values[above[0]]
    first |= {"Yposition": np.zeros(5), "Zposition": np.zeros(5)}
    clip.values["Hips"] |= {"Yposition": np.full(5, 96.0), "Zposition": ahead * np.arange(5)}
    for drop in (True, False):
        motion, notes = read_bvh(written(clip.text()), "cm", "y", drop_positions=drop)
        assert motion.joint_names[0] == "Hips" and not set(above) & set(motion.joint_names)
        assert any("root taken as 'Hips'" in note and above[0] in note for note in notes)
        assert motion.positions is None
        check(motion, clip)


def test_hips_that_only_give_stay_below_their_root(written):
    clip = Clip(channels=dict.fromkeys(PERSON, SIX))
    clip.values["Spine"]["Yposition"] += 10.0 * np.arange(5)
    motion, _ = read_bvh(written(clip.text()), "cm", "y")
    assert motion.joint_names[0] == "Hips" and "LeftFoot" in motion.joint_names


def test_a_root_without_positions_stays(written):
    clip = Clip(channels={"Hips": TURNS})
    motion, notes = read_bvh(written(clip.text()), "cm", "y")
    check(motion, clip)
    assert any("'Hips' has no positions" in note for note in notes)


def test_names_are_all_that_follows(written):
    text = Clip().text().replace("LeftArm", "Left Arm").replace("RightArm", "Bip01 R  Arm\t")
    names = read_bvh(written(re.sub(r"\n[ \t]*\{", " {", text)), "cm", "y")[0].joint_names
    assert {"Left Arm", "Bip01 R  Arm"} <= set(names)


def test_names_that_are_there_twice_are_told_apart(written):
    text = (
        Clip().text().replace("JOINT RightHand", "JOINT LeftHand").replace("JOINT LeftArm", "JOINT Head_end")
    )
    motion, notes = read_bvh(written(text), "cm", "y")
    assert len(set(motion.joint_names)) == len(motion.joint_names)
    assert {"LeftHand", "LeftHand_2", "LeftHand_end", "LeftHand_2_end", "Head_end"} <= set(motion.joint_names)
    assert "Head_end_2" in motion.joint_names
    assert [n for n in notes if "same name" in n] == ["joints of the same name, told apart as LeftHand_2"]


@pytest.mark.parametrize("stated", [0, 3, 4, 9])
def test_a_count_of_frames_that_is_wrong_is_said(written, stated):
    clip = Clip()
    motion, notes = read_bvh(written(clip.text(frames=stated)), "cm", "y")
    check(motion, clip)
    assert f"the header says {stated} frames, there are 5: all of these are read" in notes


@pytest.mark.parametrize(
    ("written_time", "rate", "said"),
    [
        ("0.0083333", 120.0, False), ("0.033", 30.0, True), ("0.03", 30.0, True), ("0.017", 60.0, True),
        ("0.016", 60.0, True), ("0.008", 125.0, False), ("0.01", 100.0, False), ("0.04", 25.0, False),
        ("0.0333667", 29.97, False), ("0.005", 200.0, False), ("1.6667e-2", 60.0, False),
    ],
)  # fmt: skip
def test_a_frame_time_of_few_digits_is_the_customary_rate_it_stands_for(written, written_time, rate, said):
    motion, notes = read_bvh(written(Clip().text(written_time)), "cm", "y")
    assert motion.rate == pytest.approx(rate, rel=1e-6)
    assert any("rounded" in note for note in notes) == said


@pytest.mark.parametrize("written_time", ["0", "-0.01", "0.000", "30", "nan", "", "soon", "1e-9"])
def test_a_rate_that_is_none_has_to_be_given(written, written_time):
    path = written(Clip().text(written_time))
    with pytest.raises(ClipError) as refused:
        read_bvh(path, "cm", "y")
    assert refused.value.hint == "rate"
    motion, notes = read_clip(path, "cm", "y", rate=50.0)
    assert motion.rate == 50.0 and "rate given: 50 Hz" in notes


@pytest.mark.parametrize("rate", [0.0, -1.0, 1e4, float("nan"), float("inf")])
def test_a_given_rate_that_is_none(written, rate):
    with pytest.raises(InputError, match="not the rate of a motion") as refused:
        read_clip(written(Clip().text()), "cm", "y", rate=rate)
    assert refused.value.hint == "rate"


REFUSED = {
    "a row too short": (lambda t: t[: t.rstrip().rfind(" ")] + "\n", "row 5 of 5 has 56 numbers"),
    "a row cut": (lambda t: t[: t.rstrip().rfind("\n") - 3], "cut short, it ends in row 4 of 5"),
    "a scale": (lambda t: t.replace("3 Zrotation", "4 Xscale Zrotation", 1), "'Xscale' is no channel"),
    "a channel too few": (lambda t: t.replace("CHANNELS 3", "CHANNELS 4", 1), "'JOINT' is no channel"),
    "a channel twice": (lambda t: t.replace("3 Zrotation X", "3 Zrotation Z", 1), "stands there twice"),
    "two roots": (lambda t: t.replace("MOTION", "ROOT Other\n{\n}\nMOTION"), "a second ROOT"),
    "no name": (lambda t: t.replace("JOINT Chest", "JOINT"), "JOINT without a name"),
    "no offset": (lambda t: re.sub(r"OFFSET 0.0 5.0 5.0", "", t, count=1), "has no OFFSET"),
    "no brace": (lambda t: t.replace("}\nMOTION", "MOTION"), "braces of the hierarchy do not match"),
    "no frames": (lambda t: t[: t.index("Frames")], "should follow MOTION"),
    "no hierarchy": (lambda t: t[10:], "does not begin with HIERARCHY"),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_what_cannot_be_read_is_said_in_our_words(written, kind):
    change, said = REFUSED[kind]
    path = written(change(Clip().text()))
    with pytest.raises(ClipError, match=re.escape(said)) as refused:
        read_bvh(path, "cm", "y")
    assert str(refused.value).startswith(f"{path}: ") and "\n" not in str(refused.value)


def test_a_motion_of_positions_only_is_refused(written):
    places = "Xposition Yposition Zposition"
    with pytest.raises(ClipError, match="no joint has rotations"):
        read_bvh(written(Clip(channels=dict.fromkeys(PERSON, places)).text()), "cm", "y")
