"""Puts the feet of a retargeted motion on the ground.

The recording's ground is not at zero, its feet float or sink by a few centimetres, and our legs are
not the recorded person's. First the whole motion is moved so that it stands on z = 0, then the root
is lifted where a foot would reach below, then each leg is bent or stretched until its own foot
touches when it nearly does.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from . import gaps, pose
from .reference import root_joint

CUT_OFF = 4.0
"""[Hz] of the corrections: slower than a step's landing, so that nothing jerks."""
NEAR = (0.025, 0.05)
"""[m] A foot this low may stand; one above the second number is in the air."""
SLOW = (0.2, 0.5)
"""[m/s] A foot this slow may stand; one faster than the second number swings."""
LARGEST = 0.06
"""[m]"""


def stand(model, joint_q: np.ndarray, feet) -> None:
    """Correct joint_q (frames, nq) in place; feet: names of the foot bodies, toes hang from
    them."""
    up = model.q_slice(root_joint(model)).start + 2
    joint_q[:, up] -= ground_height(model, joint_q, feet)
    joint_q[:, up] += _smooth(model, np.clip(-_lowest(model, joint_q, feet), -0.01, LARGEST))
    for foot in feet:
        _plant(model, joint_q, foot)


def ground_height(model, joint_q: np.ndarray, feet, share: float = 0.2) -> float:
    """[m] height that the lowest sole point stays above in all but `share` of the frames.

    Somebody stands or pushes off most of the time, so this is the ground the feet were on, within
    their noise.
    """
    return float(np.quantile(_lowest(model, joint_q, feet), share))


def _plant(model, joint_q: np.ndarray, foot: str) -> None:
    """Bend or stretch a leg, in place, so that its foot touches the ground where it nearly does."""
    low, last = _lowest(model, joint_q, [foot]), model.body(foot)
    ankles = pose.forward(model, joint_q)[:, last, :3]
    speed = np.linalg.norm(np.gradient(ankles, model.timestep, axis=0)[:, :2], axis=1)
    stands = np.clip((NEAR[1] - low) / (NEAR[1] - NEAR[0]), 0.0, 1.0)
    stands *= np.clip((SLOW[1] - speed) / (SLOW[1] - SLOW[0]), 0.0, 1.0)
    down = -np.minimum(low, LARGEST) * np.where(low > 0.0, stands, 1.0)
    raised = _smooth(model, np.minimum(down, LARGEST))
    lower = int(model.body_parent[last])
    knee = pose.body_joint(model, lower)
    body_q = pose.forward(model, joint_q)
    ankle = body_q[:, last, :3] + raised[:, None] * [0.0, 0.0, 1.0]
    axis = Rotation.from_quat(body_q[:, lower, 3:]).apply(model.joint_axis(knee))
    pose.place_limb(model, joint_q, knee, ankle, Rotation.from_quat(body_q[:, last, 3:]), axis)


def _lowest(model, joint_q: np.ndarray, feet) -> np.ndarray:
    bodies = [body for foot in feet for body in gaps.descendants(model, model.body(foot))]
    return gaps.lowest_point(model, pose.forward(model, joint_q), bodies)


def _smooth(model, values: np.ndarray) -> np.ndarray:
    if len(values) < 16:
        return np.full_like(values, values.mean())
    return sosfiltfilt(butter(2, CUT_OFF, fs=1.0 / model.timestep, output="sos"), values)
