"""Where a recording is broken: places that jump, limbs that stand frozen.

A joint jumps when its step from one frame to the next differs from the steps around it, by more than its
own unrest there explains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..signals import runs
from . import anatomy
from .motion import Motion

WINDOW = 4
"""[frames] before and after a step that say what is usual there."""
JUMP_SPEED = 1.5
"""[m/s] by which a step must differ from those around it; at 120 Hz this is 12 mm."""
JUMP_RATIO, UNREST = 3.0, 0.2
"""A jump is this many times the unrest around it, and no unrest is taken below the second number [m/s]."""
STILL = 0.002
"""[rad/s] A recorded person is never this still: below it a joint is frozen."""
FROZEN = 0.1
"""[s] Shorter than this is no frozen limb."""
LIMBS = {
    "trunk": ("root", "head"),
    "left arm": ("left_shoulder", "left_elbow", "left_wrist"),
    "right arm": ("right_shoulder", "right_elbow", "right_wrist"),
    "left leg": ("left_hip", "left_knee", "left_ankle", "left_toe"),
    "right leg": ("right_hip", "right_knee", "right_ankle", "right_toe"),
}


@dataclass(frozen=True)
class Event:
    """Something wrong in a row of frames."""

    what: str
    """Joints, a limb or a foot."""
    first: int
    last: int
    """Frames, counted from the motion's first, both included."""
    size: float
    """[m] of a jump or of a depth under the ground, [s] of a frozen part."""


def watched(motion: Motion) -> list[int]:
    """Joints looked at: the root and the body's parts, without fingers: noise in most recordings."""
    found = anatomy.parts(motion.joint_names, motion.parents)
    return sorted({0, *(j for part, j in found.items() if not part.endswith("_hand"))})


def odd_steps(steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far each step (frames - 1, joints, 3) is from the median of those around it, and the usual
    distance there: two arrays (frames - 1, joints)."""
    if len(steps) < 3:
        return np.zeros(steps.shape[:2]), np.zeros(steps.shape[:2])
    width = min(WINDOW, len(steps) - 1)
    padded = np.pad(steps, ((width, width), (0, 0), (0, 0)), mode="reflect")
    around = np.stack([padded[i : i + len(steps)] for i in range(2 * width + 1) if i != width])
    usual = np.median(around, axis=0)
    unrest = np.median(np.linalg.norm(around - usual, axis=3), axis=0)
    return np.linalg.norm(steps - usual, axis=2), unrest


def jumps(motion: Motion) -> list[Event]:
    """Sudden changes of place; frame f is the first at the new place. Joints that jump together are one
    event, and so are jumps less than 0.05 s apart."""
    joints = watched(motion)
    apart, unrest = odd_steps(np.diff(motion.places()[:, joints], axis=0))
    limit = np.maximum(JUMP_SPEED, JUMP_RATIO * (unrest * motion.rate + UNREST)) / motion.rate
    broken = apart > limit
    events = []
    for first, last in runs(broken.any(axis=1), join=int(0.05 * motion.rate)):
        part = np.where(broken[first : last + 1], apart[first : last + 1], 0.0).max(axis=0)
        order = [i for i in np.argsort(-part) if part[i] > 0.0]
        what = ", ".join(motion.joint_names[joints[i]] for i in order[:3])
        what += f" and {len(order) - 3} more" if len(order) > 3 else ""
        events.append(Event(what, first + 1, last + 1, float(part.max())))
    return events


def frozen(motion: Motion) -> list[Event]:
    """Limbs that move elsewhere in the motion but not at all for a while."""
    joints = len(motion.joint_names)
    if motion.frame_count < 2:
        return []
    turns = Rotation.from_quat(motion.rotations.reshape(-1, 4))
    count = motion.frame_count
    apart = np.asarray((turns[: (count - 1) * joints].inv() * turns[joints:]).magnitude())
    speed = apart.reshape(count - 1, joints) * motion.rate
    alive = (speed > STILL).mean(axis=0) > 0.02
    found = {"root": 0} | anatomy.parts(motion.joint_names, motion.parents)
    events = []
    for limb, names in LIMBS.items():
        own = [found[n] for n in names if n in found and alive[found[n]]]
        if not own:
            continue
        still = (speed[:, own] <= STILL).all(axis=1)
        for first, last in runs(still):
            if (last - first + 1) / motion.rate >= FROZEN:
                events.append(Event(limb, first, last + 1, (last - first + 1) / motion.rate))
    return events
