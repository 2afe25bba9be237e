"""How far shapes are from the ground and from a ball, from recorded body frames alone: an
outside view of contact."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from .slots import touch_points

if TYPE_CHECKING:
    from .mjcf import Shape
    from .model import Model


def lowest_point(model: Model, body_q: np.ndarray, bodies: Collection[int]) -> np.ndarray:
    """Height (frames,) [m] of the lowest point of the shapes of `bodies` (indices), body_q
    (frames, nbody, 7)."""
    heights = []
    for shape in (s for s in model.shapes if s.body in bodies and s.kind != "plane"):
        centre, turn = _place(shape, body_q)
        up = turn.inv().apply([0.0, 0.0, 1.0])
        if shape.kind == "box":
            reach = np.abs(up) @ np.asarray(shape.size[:3])
        elif shape.kind == "capsule":
            reach = shape.size[0] + np.abs(up[:, 2]) * shape.size[1]
        else:
            reach = np.full(len(up), shape.size[0])
        heights.append(centre[:, 2] - reach)
    return np.min(heights, axis=0)


def gap_to_bodies(
    model: Model, body_q: np.ndarray, bodies: Collection[int], points: np.ndarray
) -> np.ndarray:
    """Distance (frames,) [m] from points (frames, 3) to the nearest surface of the shapes of
    `bodies` (indices)."""
    distances = []
    for shape in (s for s in model.shapes if s.body in bodies and s.kind != "plane"):
        centre, turn = _place(shape, body_q)
        local = turn.inv().apply(points - centre)
        if shape.kind == "box":
            outside = np.abs(local) - shape.size[:3]
            inside = np.minimum(outside.max(axis=1), 0.0)
            distances.append(np.linalg.norm(np.maximum(outside, 0.0), axis=1) + inside)
        else:
            if shape.kind == "capsule":
                local[:, 2] -= np.clip(local[:, 2], -shape.size[1], shape.size[1])
            distances.append(np.linalg.norm(local, axis=1) - shape.size[0])
    return np.min(distances, axis=0)


def sliding(
    model: Model, body_q: np.ndarray, bodies: Collection[int], timestep: float, touch: float
) -> np.ndarray:
    """Speed (frames - 1,) [m/s] over the ground of what touches it: of the slowest among the points of the
    shapes of `bodies` that are within `touch` [m] of it before a step and after, as feet roll; NaN where none
    is."""
    speeds = []
    for shape in (s for s in model.shapes if s.body in bodies and s.kind != "plane"):
        turn = Rotation.from_quat(body_q[:, shape.body, 3:])
        for point, radius in touch_points(shape):
            at = body_q[:, shape.body, :3] + turn.apply(point) - [0.0, 0.0, radius]
            down = at[:, 2] < touch
            v = np.linalg.norm(np.diff(at[:, :2], axis=0), axis=1) / timestep
            speeds.append(np.where(down[1:] & down[:-1], v, np.inf))
    slowest = np.min(speeds, axis=0)
    return np.where(np.isfinite(slowest), slowest, np.nan)


def _place(shape: Shape, body_q: np.ndarray) -> tuple[np.ndarray, Rotation]:
    body = Rotation.from_quat(body_q[:, shape.body, 3:])
    return body_q[:, shape.body, :3] + body.apply(shape.pos), body * Rotation.from_quat(shape.quat)
