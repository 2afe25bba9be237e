"""A smooth union of primitives, as a field that is zero on its surface.

The field is F(x) = log sum_i exp(-d_i(x) / k_i), with d_i the distance to primitive i and k_i how far it
blends: 0 on the surface, positive inside (Wyvill's soft objects with an exponential fall-off).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from .flesh import Lump

OUTSIDE = -12.0
"""F where no primitive is near."""
FAR = 1.0
"""[m]"""
FIRM = 3.0
"""A cut's distance counts so many times, so that where primitives that it cuts overlap, it bulges less."""
STEP = 2e-4
"""[m] of differences."""


class Union:
    """Primitives placed in space. body_of: a body's name -> its index; frames: (nbody, 7), by index."""

    def __init__(self, lumps: list[Lump], body_of: dict[str, int], frames: np.ndarray) -> None:
        self.lumps = lumps
        self.bodies = np.array([body_of[lump.body] for lump in lumps])
        self.origins = frames[self.bodies, :3]
        self.turns = Rotation.from_quat(frames[self.bodies, 3:]).as_matrix()
        ends = np.array([[lump.p, lump.q] for lump in lumps]) @ self.turns.transpose(0, 2, 1)
        reach = [max(lump.r) * max(lump.scale) + 5.0 * lump.blend + 0.02 for lump in lumps]
        self.low = self.origins + ends.min(axis=1) - np.array(reach)[:, None]
        self.high = self.origins + ends.max(axis=1) + np.array(reach)[:, None]

    def local(self, i: int, points: np.ndarray) -> np.ndarray:
        return (points - self.origins[i]) @ self.turns[i]

    def distances(self, points: np.ndarray) -> np.ndarray:
        """(primitives, points) [m], negative inside; FAR where a primitive is not near."""
        found = np.full((len(self.lumps), len(points)), FAR)
        for i, near in enumerate(self.near(points)):
            found[i, near] = distance(self.lumps[i], self.local(i, points[near]))
        return found

    def near(self, points: np.ndarray) -> list[np.ndarray]:
        """For each primitive, the indices of the points that it may matter to."""
        inside = np.ones((len(self.lumps), len(points)), bool)
        for axis in range(3):
            x = points[:, axis]
            inside &= (x > self.low[:, axis, None]) & (x < self.high[:, axis, None])
        return [np.flatnonzero(row) for row in inside]

    def slope(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """F (points,) and its gradient (points, 3) [1/m], by differences."""
        spots = points + np.concatenate([np.zeros((1, 3)), STEP * np.eye(3)])[:, None]
        total = np.full(spots.shape[:2], np.exp(OUTSIDE))
        for i, who in enumerate(self.near(points)):
            if len(who):
                d = distance(self.lumps[i], self.local(i, spots[:, who].reshape(-1, 3))).reshape(4, -1)
                total[:, who] += np.exp(np.minimum(-d / self.lumps[i].blend, 60.0))
        here, *ahead = np.log(total)
        return here, np.stack([(a - here) / STEP for a in ahead], axis=1)

    def on_grid(self, axes: list[np.ndarray]) -> np.ndarray:
        """F on the grid of three rising coordinate lists; only the box around each primitive is visited."""
        total = np.zeros([len(a) for a in axes], np.float32)
        for i, lump in enumerate(self.lumps):
            size = max(lump.r) * max(lump.scale)
            reach = size + 5.0 * lump.blend
            ends = self.origins[i] + np.stack([lump.p, lump.q]) @ self.turns[i].T
            low, high = ends.min(axis=0) - reach, ends.max(axis=0) + reach
            box = tuple(slice(*np.searchsorted(a, [lo, hi])) for a, lo, hi in zip(axes, low, high))
            cut = [a[s] for a, s in zip(axes, box)]
            if not all(map(len, cut)):
                continue
            points = np.stack(np.meshgrid(*cut, indexing="ij"), axis=-1).reshape(-1, 3)
            d = distance(lump, self.local(i, points)).reshape([len(c) for c in cut])
            total[box] += np.exp(np.minimum(-d / lump.blend, 60.0))
        return np.log(np.maximum(total, np.exp(OUTSIDE)))


def distance(lump: Lump, x: np.ndarray) -> np.ndarray:
    """(points,) [m] to a primitive from points (points, 3) in its body's axes; near the surface to first
    order."""
    scale, p, q = np.asarray(lump.scale), np.asarray(lump.p), np.asarray(lump.q)
    along = (q - p) / scale
    size = max(float(along @ along), 1e-12)
    y = (x - p) / scale
    t = np.clip(y @ along / size, 0.0, 1.0)
    away = y - t[:, None] * along
    length = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
    radius = lump.r[0] + t * (lump.r[1] - lump.r[0])
    d = (length - radius) * length / np.maximum(np.linalg.norm(away / scale, axis=1), 1e-9)
    if lump.cut is not None:
        over = FIRM * (x @ np.asarray(lump.cut[0]) - lump.cut[1])
        d = np.maximum(d, over) + np.maximum(lump.hem - np.abs(d - over), 0.0) ** 2 / (4.0 * lump.hem)
    return d
