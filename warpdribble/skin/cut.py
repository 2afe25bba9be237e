"""Meshes cut along curves on their surface, so that a border between two regions is a row of edges.

A curve is where a field is zero. Points near it move onto it, edges that still cross it are split there, and
every new point is brought, by Newton's method, to where both the field and the surface's own are zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from .surface_net import edges

Field = Callable[[np.ndarray], np.ndarray]
"""points (n, 3) [m] -> (n,) [m] or so, negative inside a region."""
SNAP = 0.25
"""Share of an edge up to which its end moves onto a curve that crosses it there."""
STEP = 1e-5
"""[m] of the differences that slopes are taken from."""


class Surface(Protocol):
    """What a mesh lies on."""

    def slope(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A field (n,) that is zero on the surface, and its gradient (n, 3), at points (n, 3)."""


@dataclass(frozen=True)
class Net:
    """A mesh whose faces belong to regions."""

    points: np.ndarray
    """(n, 3) [m]"""
    faces: np.ndarray
    """(m, 3) int"""
    values: np.ndarray
    """(n, k) what points carry; linear along an edge that is split"""
    region: np.ndarray
    """(m,) int"""
    border: np.ndarray
    """(n,) bool, points on a curve"""

    @classmethod
    def of(cls, points: np.ndarray, faces: np.ndarray, values: np.ndarray | None = None) -> Net:
        values = np.zeros((len(points), 0)) if values is None else values
        return cls(points, faces, values, np.zeros(len(faces), int), np.zeros(len(points), bool))


Choice = Callable[[Net, np.ndarray], np.ndarray]
"""A mesh and edges of it (n, 2) -> which of them (n,) bool."""


def cut(net: Net, surface: Surface, field: Field, region: int) -> Net:
    """The same mesh with its faces where the field is negative in a region, their border on the surface where
    the field is zero."""
    value, points, border = field(net.points), net.points.copy(), net.border.copy()
    value[np.abs(value) < 1e-9] = 0.0
    near = net.faces[(value[net.faces].min(axis=1) < 0.0) & (value[net.faces].max(axis=1) > 0.0)]
    if len(near):
        pairs, share = _crossed(near, value)
        who = np.concatenate([pairs[share < SNAP, 0], pairs[share > 1.0 - SNAP, 1]])
        who = np.unique(who[~border[who]])
        there = onto(surface, field, points[who])
        close = np.linalg.norm(there - points[who], axis=1) < 2.0 * SNAP * _shortest(near, points)[who]
        points[who[close]] = there[close]
        value[who[close]] = 0.0
        border[who[close]] = True
        pairs, share = _crossed(near, value)
        net = replace(net, points=points, border=border)
        at = points[pairs[:, 0]] + share[:, None] * (points[pairs[:, 1]] - points[pairs[:, 0]])
        free = ~border[pairs].all(axis=1)
        at[free] = onto(surface, field, at[free])
        net = split(net, pairs, share, at, border=True)
        value = np.concatenate([value, np.zeros(len(pairs))])
    side = value[net.faces].sum(axis=1)
    flat = np.abs(side) < 1e-12
    side[flat] = field(net.points[net.faces[flat]].mean(axis=1))
    return replace(net, region=np.where(side < 0.0, region, net.region))


def refine(net: Net, surface: Surface, wanted: Choice, rounds: int) -> Net:
    """The same mesh with edges halved that are wanted, the longest of a face first (Rivara 1984), in so many
    rounds at most."""
    for _ in range(rounds):
        pairs, _counts = edges(net.faces)
        marked = wanted(net, pairs)
        if not marked.any():
            break
        length = np.linalg.norm(net.points[pairs[:, 0]] - net.points[pairs[:, 1]], axis=1)
        of_face = _edges_of_faces(net.faces, pairs)
        longest = np.take_along_axis(of_face, np.argmax(length[of_face], axis=1)[:, None], axis=1)[:, 0]
        for _ in range(20):
            also = longest[marked[of_face].any(axis=1)]
            if marked[also].all():
                break
            marked[also] = True
        chosen = pairs[marked]
        net = split(
            net, chosen, np.full(len(chosen), 0.5), onto(surface, None, net.points[chosen].mean(axis=1), 2)
        )
    return net


def split(net: Net, pairs: np.ndarray, share: np.ndarray, at: np.ndarray, border: bool = False) -> Net:
    """The same mesh with a new point at `at` (n, 3) on each edge of `pairs` (n, 2), `share` (n,) of its way.
    border: whether these points lie on a curve."""
    if not len(pairs):
        return net
    a, b = net.values[pairs[:, 0]], net.values[pairs[:, 1]]
    points = np.concatenate([net.points, at])
    at_end = np.zeros(len(net.points), bool)
    at_end[pairs] = True
    met = at_end[net.faces].sum(axis=1) >= 2
    faces, parent = _divide(net.faces[met], pairs, points)
    faces = np.concatenate([net.faces[~met], faces])
    parent = np.concatenate([np.flatnonzero(~met), np.flatnonzero(met)[parent]])
    return Net(
        points,
        faces,
        np.concatenate([net.values, a + share[:, None] * (b - a)]),
        net.region[parent],
        np.concatenate([net.border, np.full(len(at), border)]),
    )


def onto(surface: Surface, field: Field | None, points: np.ndarray, rounds: int = 3) -> np.ndarray:
    """Points (n, 3) moved to where the surface's field and the given one are zero, the shortest way: x <- x -
    J^T (J J^T)^-1 f."""
    for _ in range(rounds if len(points) else 0):
        level, slope = _scaled(*surface.slope(points))
        jacobian, value = slope[:, None], level[:, None]
        if field is not None:
            here = field(points)
            ahead = np.stack([field(points + STEP * e) for e in np.eye(3)], axis=1)
            level, slope = _scaled(here, (ahead - here[:, None]) / STEP)
            jacobian = np.stack([jacobian[:, 0], slope], axis=1)
            value = np.stack([value[:, 0], level], axis=1)
        square = jacobian @ jacobian.transpose(0, 2, 1) + 1e-6 * np.eye(value.shape[1])
        move = (jacobian.transpose(0, 2, 1) @ np.linalg.solve(square, value[..., None]))[..., 0]
        size = np.linalg.norm(move, axis=1, keepdims=True)
        points = points - move * np.minimum(1.0, 0.004 / np.maximum(size, 1e-12))
    return points


def _scaled(level: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A field and its gradient, divided by the gradient's length."""
    size = np.maximum(np.linalg.norm(slope, axis=1), 1e-9)
    return level / size, slope / size[:, None]


def _crossed(faces: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges (n, 2) whose ends have values of unlike sign, and the share (n,) of each at which it is zero."""
    pairs, _ = edges(faces)
    a, b = value[pairs].T
    across = a * b < 0.0
    return pairs[across], a[across] / (a[across] - b[across])


def _shortest(faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(points,) [m] length of a point's shortest edge."""
    pairs, _ = edges(faces)
    length = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    least = np.full(len(points), np.inf)
    for end in (0, 1):
        np.minimum.at(least, pairs[:, end], length)
    return least


def _edges_of_faces(faces: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """(m, 3) which of `pairs` (n, 2), sorted, is each face's edge from corner i to i + 1; -1 for none."""
    count = int(max(faces.max(), pairs.max())) + 1
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1)
    keys = pairs[:, 0].astype(np.int64) * count + pairs[:, 1]
    wanted = ends[..., 0].astype(np.int64) * count + ends[..., 1]
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return np.where(keys[at] == wanted, at, -1)


def _divide(faces: np.ndarray, pairs: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Faces (m, 3) with the edges `pairs` split at the last of `points`, and which face each comes from."""
    split_at = _edges_of_faces(faces, pairs)
    count = (split_at >= 0).sum(axis=1)
    # Turned so that of one split edge it is the first, of two the third that is whole.
    first = np.where(count == 2, np.argmin(split_at >= 0, axis=1) + 1, np.argmax(split_at >= 0, axis=1))
    turn = (np.arange(3) + first[:, None]) % 3
    corner = np.take_along_axis(faces, turn, axis=1)
    middle = np.take_along_axis(split_at, turn, axis=1) + len(points) - len(pairs)
    (u, v, w), (a, b, c) = corner.T, middle.T
    across = np.linalg.norm(points[a] - points[w], axis=1) < np.linalg.norm(points[u] - points[b], axis=1)
    pieces = [
        (count == 0, ((u, v, w),)),
        (count == 1, ((u, a, w), (a, v, w))),
        (count == 2, ((a, v, b),)),
        ((count == 2) & across, ((u, a, w), (a, b, w))),
        ((count == 2) & ~across, ((u, a, b), (u, b, w))),
        (count == 3, ((u, a, c), (a, v, b), (c, b, w), (a, b, c))),
    ]
    made = [(np.stack(piece, axis=1)[on], np.flatnonzero(on)) for on, group in pieces for piece in group]
    return np.concatenate([f for f, _ in made]), np.concatenate([p for _, p in made])
