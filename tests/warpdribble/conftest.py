"""A small clip written like the CMU conversion: same joints, units, T-pose row and lost bone
lengths."""

import numpy as np
import pytest

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
        channels = (
            f"6 Xposition Yposition Zposition {rotations}" if depth == 0 else f"3 {rotations}"
        )
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
