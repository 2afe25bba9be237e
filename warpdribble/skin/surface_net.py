"""Triangle meshes from grids: a surface net, two of them sewn together, and who is next to whom."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags


def surface_net(values: np.ndarray, axes: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and triangles (m, 3), counter-clockwise from outside, where values (nx, ny, nz) cross 0:
    a point per cell that the surface crosses, a quad per crossed edge of the grid (surface nets, Gibson
    1998).

    values are positive inside. The surface stays open where it leaves the grid.
    """
    inside = values > 0.0
    count = np.sum(
        [
            inside[i : len(inside) - 1 + i, j : inside.shape[1] - 1 + j, k : inside.shape[2] - 1 + k]
            for i in (0, 1)
            for j in (0, 1)
            for k in (0, 1)
        ],
        axis=0,
        dtype=np.int8,
    )
    cells = np.argwhere((count > 0) & (count < 8))
    number = np.full(count.shape, -1)
    number[tuple(cells.T)] = np.arange(len(cells))
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    total, crossings = np.zeros((len(cells), 3)), np.zeros(len(cells))
    for a in range(8):
        for b in range(a + 1, 8):
            if np.abs(corners[a] - corners[b]).sum() != 1:
                continue
            at_a, at_b = cells + corners[a], cells + corners[b]
            va, vb = values[tuple(at_a.T)], values[tuple(at_b.T)]
            on = (va > 0) != (vb > 0)
            t = np.where(on, va / np.where(on, va - vb, 1.0), 0.0)[:, None]
            xa, xb = (np.stack([axes[d][at[:, d]] for d in range(3)], axis=1) for at in (at_a, at_b))
            total += on[:, None] * (xa + t * (xb - xa))
            crossings += on
    points = total / crossings[:, None]

    triangles = []
    for d in range(3):
        u, v = (d + 1) % 3, (d + 2) % 3
        low, high = (np.take(inside, range(s, inside.shape[d] - 1 + s), axis=d) for s in (0, 1))
        edge = np.argwhere(low != high)
        edge = edge[
            np.all((edge[:, [u, v]] > 0) & (edge[:, [u, v]] < np.array(inside.shape)[[u, v]] - 1), axis=1)
        ]
        quad = np.stack(
            [
                number[tuple((edge - du * np.eye(3, dtype=int)[u] - dv * np.eye(3, dtype=int)[v]).T)]
                for du, dv in ((1, 1), (0, 1), (0, 0), (1, 0))
            ],
            axis=1,
        )
        outward = low[tuple(edge.T)]
        quad = np.where(outward[:, None], quad, quad[:, ::-1])
        across = np.linalg.norm(points[quad[:, 0]] - points[quad[:, 2]], axis=1)
        other = np.linalg.norm(points[quad[:, 1]] - points[quad[:, 3]], axis=1)
        split = np.where((across <= other)[:, None], quad[:, [0, 1, 2, 0, 2, 3]], quad[:, [0, 1, 3, 1, 2, 3]])
        triangles.append(split.reshape(-1, 3))
    return points, np.concatenate(triangles)


def line(low: float, high: float, step: float) -> np.ndarray:
    return np.linspace(low, high, max(2, round((high - low) / step) + 1))


def sew(
    points: np.ndarray, faces: np.ndarray, more: np.ndarray, hand: np.ndarray, centre: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Two surfaces as one: their open edges around the axis Y through `centre` (3,) are joined by a strip of
    triangles. points, more: (n, 3); faces, hand: (m, 3), into each surface's own points."""
    side = np.sign(centre[1])
    rim = open_points(faces)
    rim = rim[(points[rim, 1] * side) > 0.0]
    start = len(points)
    points, faces = np.concatenate([points, more]), np.concatenate([faces, hand + start])
    loops = []
    for loop in (rim, open_points(hand) + start):
        about = points[loop] - centre
        loops.append(loop[np.argsort(np.arctan2(about[:, 2], about[:, 0]))])
    angle = [np.arctan2(*(points[loop] - centre)[:, [2, 0]].T) for loop in loops]
    a, b, strip = 0, 0, []
    while a < len(loops[0]) or b < len(loops[1]):
        i, j = loops[0][a % len(loops[0])], loops[1][b % len(loops[1])]
        next_a = angle[0][a + 1] if a + 1 < len(loops[0]) else (np.inf if a >= len(loops[0]) else np.pi)
        next_b = angle[1][b + 1] if b + 1 < len(loops[1]) else (np.inf if b >= len(loops[1]) else np.pi)
        if next_a <= next_b:
            a += 1
            strip.append([i, j, loops[0][a % len(loops[0])]])
        else:
            b += 1
            strip.append([i, j, loops[1][b % len(loops[1])]])
    joint = np.array(strip)
    return points, np.concatenate([faces, joint if side > 0 else joint[:, ::-1]])


def open_points(faces: np.ndarray) -> np.ndarray:
    """Points on edges that only one face has."""
    pairs, counts = edges(faces)
    return np.unique(pairs[counts == 1])


def edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges (n, 2), lower index first, and how many faces have each."""
    pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    count = int(faces.max()) + 1
    keys, counts = np.unique(pairs[:, 0].astype(np.int64) * count + pairs[:, 1], return_counts=True)
    return np.stack(np.divmod(keys, count), axis=1), counts


def neighbours(faces: np.ndarray, count: int) -> csr_matrix:
    """Mean over the points at the other ends of a point's edges, as a sparse (count, count) matrix."""
    pairs, _ = edges(faces)
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    joined = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(count, count)).tocsr()
    share = diags(1.0 / np.maximum(np.asarray(joined.sum(axis=1)).ravel(), 1.0))
    return (share @ joined).tocsr()
