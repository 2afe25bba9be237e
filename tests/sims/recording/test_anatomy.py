import numpy as np
import pytest

from warpdribble.sims.recording.anatomy import leftward, parts

CHAINS = {
    "mixamo": [f"mixamorig:Left{n}" for n in ("UpLeg", "Leg", "Foot", "ToeBase")],
    "lafan": ["LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe"],
    "ballplay": ["L_Hip", "L_Knee", "L_Ankle", "L_Toe"],
    "asf": ["lfemur", "ltibia", "lfoot", "ltoes"],
    "blender": ["thigh.L", "shin.L", "foot.L", "toe.L"],
}


@pytest.mark.parametrize("style", CHAINS)
def test_legs_of_common_skeletons(style):
    names = ["root", *CHAINS[style], "Head"]
    found = parts(names, [-1, 0, 1, 2, 3, 0])
    assert [found[f"left_{p}"] for p in ("hip", "knee", "ankle", "toe")] == [1, 2, 3, 4]
    assert found["head"] == 5 and "right_hip" not in found


def test_a_collar_bone_is_no_shoulder_and_the_longest_finger_is_the_hand():
    names = ["Hips", "RightShoulder", "RightArm", "RightForeArm", "RightHand", "RightHandThumb1"]
    names += ["RightHandIndex1", "RightHandMiddle1", "RightHandMiddle1_end"]
    found = parts(names, [-1, 0, 1, 2, 3, 4, 4, 4, 7])
    assert {k: names[v] for k, v in found.items()} == {
        "right_shoulder": "RightArm",
        "right_elbow": "RightForeArm",
        "right_wrist": "RightHand",
        "right_hand": "RightHandMiddle1_end",
    }


@pytest.mark.parametrize("seed", range(5))
def test_the_order_of_the_joints_does_not_matter(seed):
    """A foot and a hand that branch, in any order that has parents first."""
    tree = {"Hips": None, "LeftFoot": "Hips", "LeftToeBase": "LeftFoot", "LeftHeel": "LeftFoot"}
    tree |= {"LeftToeBig": "LeftToeBase", "LeftToeBig_end": "LeftToeBig", "LeftToeSmall": "LeftToeBase"}
    tree |= {"LeftHand": "Hips", "LeftHandThumb1": "LeftHand", "LeftHandRing1": "LeftHand"}
    tree |= {"LeftHandRing2": "LeftHandRing1", "LeftHandThumb2": "LeftHandThumb1"}
    rng, names = np.random.default_rng(seed), ["Hips"]
    while len(names) < len(tree):
        names.append(rng.choice([n for n in tree if n not in names and tree[n] in names]))
    found = parts(names, [-1, *(names.index(tree[n]) for n in names[1:])])
    assert names[found["left_toe_tip"]] == "LeftToeBig_end" and names[found["left_hand"]] == "LeftHandRing2"


def test_leftward():
    places = np.array([[0.0, 0, 1], [0, 0.1, 1], [0, -0.1, 1]])
    found = parts(["Hips", "LeftUpLeg", "RightUpLeg"], [-1, 0, 0])
    assert np.allclose(leftward(found, places), [0, 1, 0])
    assert leftward({}, places) is None
