"""A recorded person of the player's own measures, with the joints of the CMU conversion."""

import numpy as np
from scipy.spatial.transform import Rotation

from warpdribble.sims.recording.motion import Motion
from warpdribble.sims.retarget.mapping import read_mapping
from warpdribble.sims.retarget.retarget import goal_joints

TOES = {"l_toes": "LeftToeBase", "r_toes": "RightToeBase"}


def person(model, frames, rate=120.0, turns=None, root=None):
    """A Motion of `frames` rows at `rate` [Hz] in the T-pose.

    turns: joint -> its rotation (frames,) in its parent; root: (frames, 3) [m] of the hips.
    """
    mapping = read_mapping("cmu")
    at = {joint: body for body, joint in mapping.bodies.items()} | {j: b for b, j in TOES.items()}
    at |= {joint: body for body, joint in goal_joints(model, mapping).items()}
    zero = model.zero_pose[:, :3]
    bodies = sorted((model.body(body), joint) for joint, body in at.items())
    names = tuple(joint for _, joint in bodies)
    parents, offsets = [], []
    for body, _ in bodies:
        before = [b for b, _ in bodies if b != body and body in model.descendants(b)]
        parents.append([b for b, _ in bodies].index(max(before)) if before else -1)
        offsets.append(zero[body] - zero[max(before)] if before else np.zeros(3))
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(names), 1))
    for joint, turn in (turns or {}).items():
        rotations[:, names.index(joint)] = turn.as_quat()
    root = np.tile(zero[bodies[0][0]], (frames, 1)) if root is None else root
    rest = np.tile([0.0, 0.0, 0.0, 1.0], (len(names), 1))
    return Motion(names, np.array(parents), np.array(offsets), rotations, root, rate, rest)


def about(axis, angles):
    """Rotations (frames,) about "x", "y" or "z" by angles (frames,) [rad]."""
    return Rotation.from_euler(axis, np.asarray(angles)[:, None])
