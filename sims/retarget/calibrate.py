"""The T-poses of a recording and of a model laid over each other: what turns one into the other, limb by
limb."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model, pose
from ..recording.motion import Motion
from .mapping import Mapping

STRAIGHT = np.radians(8.0)
"""A hinge that never bends more than this shows no axis."""
LEFT = np.array([0.0, 1.0, 0.0])
"""The model's left in its zero pose."""


def since_rest(motion: Motion, frames: np.ndarray) -> Callable[[str], Rotation]:
    """A function: joint -> Rotation (frames,), how far it has turned in the world since the T-pose. frames:
    (frames, joints, 4), joint frames in the world, of `Motion.forward`."""
    _, rest = motion.rest()

    def turned(joint: str) -> Rotation:
        i = motion.index(joint)
        return Rotation.from_quat(frames[:, i]) * Rotation.from_quat(rest[i]).inv()

    return turned


def match_limbs(
    model: Model, motion: Motion, mapping: Mapping, turned: Callable[[str], Rotation]
) -> dict[str, Rotation]:
    """Body of a limb -> what turns the model's zero pose into the recording's T-pose there.

    The limb's line is matched, and about it the hinge's axis, which the recording shows by how it bends.
    Hands continue the line of their arm, feet do not. turned: of `since_rest`.
    """
    match = {}
    rest_at, _ = motion.rest()
    zero = model.zero_pose
    for hinge, (near, middle, far) in mapping.limbs.items():
        upper, lower, end = pose.limb_bodies(model, hinge)
        own = zero[end, :3] - zero[upper, :3]
        theirs = rest_at[motion.index(far)] - rest_at[motion.index(near)]
        axis = model.joint_axis(hinge)
        shown = common_axis((turned(near).inv() * turned(middle)).as_rotvec())
        if shown is None:
            matched = shortest(own, theirs)
        else:
            matched = pose.frame_of(theirs, shown) * pose.frame_of(own, axis).inv()
        match[model.body_names[upper]] = match[model.body_names[lower]] = matched
        if hinge in mapping.arms:
            match[model.body_names[end]] = shortest(own, theirs)
    return match


def common_axis(bends: np.ndarray) -> np.ndarray | None:
    """The axis (3,) about which rotation vectors (frames, 3) [rad] turn, mostly forward; None when they are
    too small to tell."""
    if np.linalg.norm(bends, axis=1).max() < STRAIGHT:
        return None
    axis = np.linalg.eigh(bends.T @ bends)[1][:, -1]
    return axis if np.sum(bends @ axis) > 0.0 else -axis


def shortest(start: np.ndarray, end: np.ndarray) -> Rotation:
    """The smallest rotations that turn directions `start` (3,) or (n, 3) into `end` (3,); half a turn goes
    about the left."""
    axis = np.cross(start, end)
    sine, cosine = np.linalg.norm(axis, axis=-1, keepdims=True), np.sum(start * end, axis=-1, keepdims=True)
    known = sine > 1e-6 * np.linalg.norm(start, axis=-1, keepdims=True) * np.linalg.norm(end)
    axis = np.where(known, axis / np.where(known, sine, 1.0), LEFT)
    return Rotation.from_rotvec(np.where(known, np.arctan2(sine, cosine), np.pi * (cosine < 0.0)) * axis)
