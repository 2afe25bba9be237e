import pytest

from warpdribble.sims.recording.anatomy import parts
from warpdribble.sims.recording.names import bare


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        (("mixamorig1:Hips", "mixamorig1:Spine", "Sword"), ("Hips", "Spine", "Sword")),
        (
            ("Bip01", "Bip01 Pelvis", "Bip01 L Thigh", "Bip01 R Thigh"),
            ("Bip01", "Pelvis", "L Thigh", "R Thigh"),
        ),
        (("CC_Base_Hip", "CC_Base_L_Thigh", "CC_Base_R_Thigh"), ("Hip", "L_Thigh", "R_Thigh")),
        (("mixamorigHips", "mixamorigLeftUpLeg", "mixamorigSpine"), ("Hips", "LeftUpLeg", "Spine")),
        (("DEF-thigh.L", "DEF-shin.L", "DEF-spine"), ("thigh.L", "shin.L", "spine")),
        (("a:Hips", "b:Hips"), ("a:Hips", "b:Hips")),
        (("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe"),) * 2,
        (("l_hip", "l_knee", "l_ankle"),) * 2,
        ((), ()),
    ],
)
def test_a_namespace_is_what_stands_before_most_names(names, wanted):
    assert bare(names) == wanted


@pytest.mark.parametrize("space", ["", "mixamorig1:", "mixamorig_", "Character1_", "Bip01 "])
def test_parts_of_a_person_are_found_in_any_namespace(space):
    names = [space + n for n in ("Hips", "LeftUpLeg", "LeftLeg", "RightUpLeg", "RightLeg", "Spine", "Head")]
    found = parts(names, [-1, 0, 1, 0, 3, 0, 5])
    assert found == {"left_hip": 1, "left_knee": 2, "right_hip": 3, "right_knee": 4, "head": 6}
