"""A small clip written like the CMU conversion: same joints, units, T-pose row and lost bone
lengths."""

import zipfile

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

SIDE = {
    "{}HipJoint": ("Hips", (0, 0, 0)),
    "{}UpLeg": ("{}HipJoint", (1.6, -1.9, 0.6)),
    "{}Leg": ("{}UpLeg", (0, -7.2, 0)),
    "{}Foot": ("{}Leg", (0, -7.9, 0)),
    "{}ToeBase": ("{}Foot", (0, -0.5, 2.0)),
    "{}Shoulder": ("Spine1", (0, 0, 0)),
    "{}Arm": ("{}Shoulder", (3.1, 1.2, -0.3)),
    "{}ForeArm": ("{}Arm", (5.2, 0, 0)),
    "{}Hand": ("{}ForeArm", (3.3, 0, 0)),
    "{}FingerBase": ("{}Hand", (0, 0, 0)),
    "{}HandIndex1": ("{}FingerBase", (0.7, 0, 0)),
    "{}Thumb": ("{}Hand", (0, 0, 0)),
}
SPECIAL = {"LeftHipJoint": "LHipJoint", "LeftThumb": "LThumb"}
SPECIAL |= {k.replace("Left", "Right"): "R" + v[1:] for k, v in SPECIAL.items()}


def skeleton():
    """name -> (parent, offset) in the order of the file."""
    bones = {"Hips": (None, (0, 0, 0))}
    trunk = {
        "LowerBack": ("Hips", (0, 0, 0)),
        "Spine": ("LowerBack", (0, 2.0, -0.35)),
        "Spine1": ("Spine", (0, 2.02, 0.04)),
        "Neck": ("Spine1", (0, 0, 0)),
        "Neck1": ("Neck", (0, 1.74, 0.13)),
        "Head": ("Neck1", (0, 1.74, -0.24)),
    }
    legs = ("{}HipJoint", "{}UpLeg", "{}Leg", "{}Foot", "{}ToeBase")
    for name, sign in (("Left", 1), ("Right", -1)):
        for part, (parent, (x, y, z)) in SIDE.items():
            if part in legs:
                full, above = part.format(name), parent.format(name)
                bones[SPECIAL.get(full, full)] = (SPECIAL.get(above, above), (sign * x, y, z))
    bones |= trunk
    for name, sign in (("Left", 1), ("Right", -1)):
        for part, (parent, (x, y, z)) in SIDE.items():
            if part not in legs:
                full, above = part.format(name), parent.format(name)
                bones[SPECIAL.get(full, full)] = (above, (sign * x, y, z))
    return bones


def bvh_text(bones, angles, root, frame_time=0.0083333):
    """angles: name -> (frames, 3) [deg] ZYX; root: (frames, 3)."""
    order, lines = [], []

    def write(name, depth):
        order.append(name)
        pad = "\t" * depth
        offset = " ".join(f"{v:.5f}" for v in bones[name][1])
        rotations = "Zrotation Yrotation Xrotation"
        channels = f"6 Xposition Yposition Zposition {rotations}" if depth == 0 else f"3 {rotations}"
        lines.append(f"{pad}{'ROOT' if depth == 0 else 'JOINT'} {name}\n{pad}{{")
        lines.append(f"{pad}\tOFFSET {offset}\n{pad}\tCHANNELS {channels}")
        children = [n for n, (parent, _) in bones.items() if parent == name]
        for child in children:
            write(child, depth + 1)
        if not children:
            lines.append(f"{pad}\tEnd Site\n{pad}\t{{\n{pad}\t\tOFFSET 0 0.4 0.4\n{pad}\t}}")
        lines.append(f"{pad}}}")

    write("Hips", 0)
    rows = [
        " ".join(f"{v:.5f}" for v in [*root[f], *np.concatenate([angles[n][f] for n in order])])
        for f in range(len(root))
    ]
    header = ["HIERARCHY", *lines, "MOTION", f"Frames: {len(rows)}", f"Frame Time: {frame_time}"]
    return "\n".join(header + rows) + "\n"


def dribbling_angles(frames):
    """Standing with the arms down; the right forearm goes up and down once a second."""
    bones = skeleton()
    angles = {name: np.zeros((frames + 1, 3)) for name in bones}
    time = np.arange(frames) / 120.0
    angles["LeftArm"][:, 0], angles["RightArm"][:, 0] = -8.0, 8.0
    angles["LeftArm"][1:, 0], angles["RightArm"][1:, 0] = -70.0, 70.0
    angles["LeftForeArm"][1:, 1] = -30.0
    angles["RightForeArm"][1:, 1] = 60.0 + 30.0 * np.cos(2.0 * np.pi * time)
    angles["Hips"][1:, 1] = 90.0
    for side in ("Left", "Right"):
        for part, angle in (("UpLeg", -20.0), ("Leg", 40.0), ("Foot", -20.0)):
            angles[side + part][1:, 2] = angle
    return angles


@pytest.fixture
def cmu_clip(tmp_path):
    """Path of a clip of 121 frames at 120 Hz, standing and dribbling, one second a cycle."""
    frames = 121
    root = np.tile([3.0, 17.0, 40.0], (frames + 1, 1))
    path = tmp_path / "clip.bvh"
    path.write_text(bvh_text(skeleton(), dribbling_angles(frames), root))
    return path


@pytest.fixture
def ballplay_clip(tmp_path):
    """Path of a BallPlay-M clip of 30 frames: arms spread, turned a quarter about the vertical, the ball
    falling, in hand for the first 10 frames."""
    from warpdribble.clips.ballplay import COLUMNS, SKELETON, TO_MOTION

    rows = np.zeros((30, COLUMNS), np.float32)
    turn = Rotation.from_rotvec([0.0, 0.0, np.pi / 2]) * Rotation.from_matrix(TO_MOTION)
    rows[:, 3:6] = rows[:, 6:9] = turn.as_rotvec()
    at = {}
    for name, (parent, offset) in SKELETON.items():
        side = 1.0 if name.startswith("L_") else -1.0
        offset = (0.03 * side, 0.0, 0.0) if offset is None else offset
        at[name] = turn.apply(offset) + (at[parent] if parent else [1.0, 2.0, 0.95])
    rows[:, 165:324] = np.concatenate(list(at.values()))
    rows[:, 324:327] = np.array([1.3, 2.0, 1.2]) - np.arange(30)[:, None] * [0.0, 0.0, 0.02]
    rows[:10, 336] = 1.0
    path = tmp_path / "clip.pt"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("archive/data.pkl", b"\x80\x02ctorch\nFloatStorage\nq\x02.")
        archive.writestr("archive/data/0", rows.tobytes())
        archive.writestr("archive/version", b"3\n")
    return path


ASF = """# a pelvis with a leg of two bones
:version 1.10
:units
  mass 1.0
  length 1.0
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name thigh
    direction 1 0 0
    length 2
    axis 0 0 90 XYZ
    dof rx
    limits (-160.0 20.0)
  end
  begin
    id 2
    name shin
    direction 0 1 0
    length 3
    axis 0 0 0 XYZ
    dof rx ry rz
    limits (-10.0 170.0)
           (-10.0 170.0)
           (-10.0 170.0)
  end
:hierarchy
  begin
    root thigh
    thigh shin
  end
"""
AMC = """#!OML:ASF
:FULLY-SPECIFIED
:DEGREES
1
root 0 0 0 0 0 0
thigh 0
shin 0 0 0
2
root 10 20 30 0 0 0
thigh 90
shin 0 0 0
3
root 0 0 0 0 0 90
thigh 0
shin 90 0 90
"""


@pytest.fixture
def amc_clip(tmp_path):
    """Path of a clip of 3 frames, its skeleton beside it."""
    (tmp_path / "01.asf").write_text(ASF)
    path = tmp_path / "01_01.amc"
    path.write_text(AMC)
    return path


@pytest.fixture(scope="session")
def shipped_player():
    from warpdribble.sims import Model

    return Model.load("player")


@pytest.fixture(scope="session")
def dribble_take(shipped_player):
    """The authored dribble as a take of 36 frames at 50 fps, with its physics."""
    from warpdribble.sims.authored.dribble import dribble_right
    from warpdribble.sims.model import pose
    from warpdribble.takes.take import Take

    joint_q = dribble_right(shipped_player).reference.joint_q[::2]
    return Take.of(shipped_player, pose.forward(shipped_player, joint_q), 50.0, notes={"clip": "authored"})
