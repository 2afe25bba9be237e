"""The sole of a model's foot, and where it is: heights, heading, lowest point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model, gaps


@dataclass(frozen=True)
class Foot:
    """The sole of one foot of a model. Points are in the foot's frame [m]."""

    body: int
    toes: int
    toe_joint: str
    heel: np.ndarray
    """(3,) rear edge of the sole."""
    ball: np.ndarray
    """(3,) toe joint."""
    drop: float
    """[m] from the toe joint to the ground under a flat foot."""
    corners: np.ndarray
    """(4, 3) of the sole."""
    tips: np.ndarray
    """(2, 3) middles of the round ends of the toes, in the toes' frame; `drop` is their radius too."""


def find_foot(model: Model, body: str) -> Foot:
    """The sole of a foot body. Raises ValueError when no toes hang from it or it has no shape."""
    zero = model.zero_pose[None]
    foot = model.body(body)
    toes = model.children(foot)
    boxes = [s for s in model.shapes if s.body == foot]
    if not toes or not boxes:
        raise ValueError(f"the body '{body}' is no foot: it needs a shape, and toes that hang from it")
    bottom = gaps.lowest_point(model, zero, [foot, toes[0]])[0]
    half = boxes[0].size if boxes[0].kind == "box" else np.zeros(3)
    ankle, ball = zero[0, foot, :3], zero[0, toes[0], :3] - zero[0, foot, :3]
    corners = [[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)] * np.array(half[:3]) + boxes[0].pos
    heel = np.array([corners[0, 0], 0.0, bottom - ankle[2]])
    drop = zero[0, toes[0], 2] - bottom
    tips = np.zeros((2, 3))
    for shape in (s for s in model.shapes if s.body == toes[0] and s.kind == "capsule"):
        along = Rotation.from_quat(shape.quat).apply([0.0, 0.0, shape.size[1]])
        tips = np.array([shape.pos - along, shape.pos + along])
    return Foot(foot, toes[0], model.body_joint(toes[0]), heel, ball, drop, corners, tips)


def sole_heights(foot: Foot, ankle: np.ndarray, turn: Rotation) -> np.ndarray:
    """Heights (frames, 2) [m] of the sole at the heel and under the ball, with the foot at ankle (frames,
    3)."""
    heel = ankle[:, 2] + turn.apply(foot.heel)[:, 2]
    return np.stack([heel, ankle[:, 2] + turn.apply(foot.ball)[:, 2] - foot.drop], axis=1)


def heading(turn: Rotation) -> tuple[np.ndarray, np.ndarray]:
    """Yaw and pitch (frames,) [rad] of a foot: where its toes point, and how far down."""
    forward = turn.apply([1.0, 0.0, 0.0])
    return np.arctan2(forward[:, 1], forward[:, 0]), np.arcsin(np.clip(-forward[:, 2], -1.0, 1.0))


def lowest(foot: Foot, ankle: np.ndarray, turn: Rotation, toes: np.ndarray) -> np.ndarray:
    """Height (frames,) [m] of the lowest point of a foot: corners of its sole, tips of its toes."""
    bent = turn * Rotation.from_euler("y", toes[:, None])
    joint = ankle + turn.apply(foot.ball)
    points = [ankle[:, 2] + turn.apply(corner)[:, 2] for corner in foot.corners]
    points += [joint[:, 2] + bent.apply(tip)[:, 2] - foot.drop for tip in foot.tips]
    return np.min(points, axis=0)
