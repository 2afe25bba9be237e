"""Place and heading over the ground: planar poses (n, 3) [m, m, rad], and what moves over it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation


def planar(joint_q: np.ndarray) -> np.ndarray:
    """Place and heading (n, 3) [m, m, rad] over the ground of roots, joint_q or poses (n, 7 or more); not
    finite where they are not."""
    return np.stack([joint_q[:, 0], joint_q[:, 1], heading(joint_q[:, 3:7])], axis=1)


def heading(quaternions: np.ndarray) -> np.ndarray:
    """[rad] about the vertical (...,) of where unit quaternions (..., 4) xyzw turn +X."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    return np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))


def relative(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Planar poses b as seen from a, all (n, 3)."""
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    x, y = (b - a)[:, :2].T
    return np.stack([c * x + s * y, c * y - s * x, wrapped(b[:, 2] - a[:, 2])], axis=1)


def points_from(a: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (n, k, 3) [m] of the world as seen from planar poses (n, 3); heights stay."""
    c, s = np.cos(a[:, 2, None]), np.sin(a[:, 2, None])
    x, y = np.moveaxis(points[..., :2] - a[:, None, :2], -1, 0)
    return np.stack([c * x + s * y, c * y - s * x, points[..., 2]], axis=-1)


def composed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Planar poses reached by going a and from there b, all (n, 3)."""
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    x, y = a[:, 0] + c * b[:, 0] - s * b[:, 1], a[:, 1] + s * b[:, 0] + c * b[:, 1]
    return np.stack([x, y, a[:, 2] + b[:, 2]], axis=1)


def wrapped(angle: np.ndarray) -> np.ndarray:
    """The same angle within half a turn [rad]."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def rotation(angle: float) -> np.ndarray:
    """The matrix (2, 2) that turns the ground by an angle [rad]."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def over_ground(poses: ArrayLike, pivot: np.ndarray, place: np.ndarray, turn: float) -> np.ndarray:
    """Poses (n, 7) [m, -], or points (n, 3) [m], turned by `turn` [rad] about the vertical through `pivot`
    (2,), which then lies at `place` (2,)."""
    poses = np.array(poses, dtype=float)
    poses[:, :2] = (poses[:, :2] - pivot) @ rotation(turn).T + place
    if poses.shape[1] > 3:
        by = Rotation.from_rotvec([0.0, 0.0, turn])
        poses[:, 3:] = (by * Rotation.from_quat(poses[:, 3:])).as_quat()
    return poses


def turned(
    joint_q: np.ndarray,
    joint_qd: np.ndarray,
    by: np.ndarray,
    place: np.ndarray,
    along: Sequence[tuple[int, int]] = (),
) -> tuple[np.ndarray, np.ndarray]:
    """States (n, nq) and (n, nv) whose first joint is free, each turned by an angle (n,) [rad] about the
    vertical, and put at a place (n, 2) [m] on the ground. along: where the coordinates and the velocities
    of other free joints begin that go with it, as a ball's."""
    joint_q, joint_qd = np.array(joint_q, float), np.array(joint_qd, float)
    turn = Rotation.from_rotvec(np.multiply.outer(by, [0.0, 0.0, 1.0]))
    was = joint_q[:, :2].copy()
    for q, qd in ((0, 0), *along):
        off = joint_q[:, q : q + 3] - np.pad(was, ((0, 0), (0, 1)))
        joint_q[:, q : q + 3] = turn.apply(off) + np.pad(np.broadcast_to(place, was.shape), ((0, 0), (0, 1)))
        joint_q[:, q + 3 : q + 7] = (turn * Rotation.from_quat(joint_q[:, q + 3 : q + 7])).as_quat()
        joint_qd[:, qd : qd + 3] = turn.apply(joint_qd[:, qd : qd + 3])
    return joint_q, joint_qd
