"""Palms put onto balls: what the authored clips share beyond trunk and legs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..model import Model, pose
from ..reference.mirror import FLIP
from ..retarget.reach import keep_range

MIRROR = np.array([1.0, -1.0, 1.0])
CLEAR = 0.001
"""[m] between palm and ball."""


def place_palm(
    model: Model,
    joint_q: np.ndarray,
    side: str,
    centre: np.ndarray,
    normal: ArrayLike,
    fingers: ArrayLike,
    elbow: ArrayLike,
    radius: float,
) -> None:
    """Solve an arm of joint_q (frames, nq) in place so that its palm lies on a ball centred at `centre`.

    centre: (frames, 3) [m]; normal: (frames, 3), out of the palm, toward the ball's centre; fingers: (frames,
    3), where they point; elbow: (frames, 3), where the right elbow's axis would point; the left one's is its
    mirror image.
    """
    count = len(joint_q)
    normal, fingers, elbow = (
        np.array(np.broadcast_to(v, (count, 3)), float) for v in (normal, fingers, elbow)
    )
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    outward = np.array([0.0, 1.0 if side == "l" else -1.0, 0.0])
    own = pose.frame_of(np.array([0.0, 0.0, -1.0]), outward)
    turn = pose.frame_of(normal, fingers) * own.inv()
    _, place, _ = model.sites[f"{side}_palm"]
    wrist = np.asarray(centre) - (radius + CLEAR) * normal - turn.apply(place)
    axis = elbow if side == "r" else elbow * FLIP
    pose.place_limb(model, joint_q, f"{side}_elbow", wrist, turn, axis)
    for joint in (f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist"):
        keep_range(model, joint_q, joint)


def shift(joint_q: np.ndarray, rows: int) -> np.ndarray:
    """A cycle (frames, nq), whose last row is its first, begun so many rows later."""
    body = np.roll(joint_q[:-1], -rows, axis=0)
    return np.concatenate([body, body[:1]])
