"""One smooth body over a player: a mesh, how its points follow the bodies, and its regions.

The surface is taken in the zero pose, where limbs are apart, then carried to the pose it is bound in (arms
half down: dribbling is nearer to that) and drawn onto the surface there. A point follows the bodies near it
along the surface: the nearest primitive's body, diffused over the mesh, so that what is near only through the
air (two fingers, arm and trunk) stays apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial.transform import Rotation, Slerp

from ..sims.model import Model, pose
from . import flesh
from .implicit import Union
from .meshes import Mesh
from .surface_net import edges, line, neighbours, sew, surface_net

CELL = 0.0125
"""[m] of the grid; fingers and the head have finer ones."""
HAND_CELL = 0.0041
SPREAD = 28
"""Rounds of diffusion of the weights: a joint is smooth over about sqrt(2 x rounds) edges."""
INFLUENCES = 4
"""Bodies that a point follows at most."""
LOWERED = 0.55
"""How far the arms of the bind pose are on the way from the zero pose to the start pose."""


@dataclass(frozen=True)
class Skin:
    mesh: Mesh
    """In the bind pose, in the world [m]."""
    bodies: np.ndarray
    """(points, INFLUENCES) int, indices of the bodies a point follows"""
    weights: np.ndarray
    """(points, INFLUENCES), rows add up to 1"""
    regions: list[str]
    region: np.ndarray
    """(faces,) int, index into regions"""
    colours: dict[str, flesh.Vector]
    """by region"""
    bind_q: np.ndarray
    """(nbody, 7) poses of the bodies in the bind pose"""

    def posed(self, body_q: np.ndarray) -> np.ndarray:
        """Points (points, 3) for body poses (nbody, 7), by linear blending."""
        turn = Rotation.from_quat(body_q[:, 3:]) * Rotation.from_quat(self.bind_q[:, 3:]).inv()
        matrices = turn.as_matrix()
        moved = np.zeros_like(self.mesh.points)
        for k in range(INFLUENCES):
            b = self.bodies[:, k]
            about = self.mesh.points - self.bind_q[b, :3]
            turned = np.einsum("pij,pj->pi", matrices[b], about) + body_q[b, :3]
            moved += self.weights[:, k, None] * turned
        return moved


_built: dict[int, tuple[Model, Skin]] = {}


def of(model: Model) -> Skin:
    """The skin of a model; built once, in about two seconds. Raises ValueError where there is nothing to
    cover."""
    if id(model) not in _built:
        _built[id(model)] = model, _build(model)
    return _built[id(model)][1]


def _build(model: Model) -> Skin:
    lumps = flesh.of(model)
    if not lumps:
        raise ValueError("the model has no shapes to put a skin on")
    zero, bind = poses(model)
    body_of = {name: i for i, name in enumerate(model.body_names)}
    union = Union(lumps, body_of, zero)
    points, faces = _surface(union, body_of, zero)
    points = union.project(points, 1)
    points, border, region, names = _paint(union, points, faces)
    labels = union.bodies[np.argmin(union.distances(points), axis=0)]
    bodies, weights = _weights(labels, faces, model.nbody)

    draft = Skin(Mesh(points, points, faces), bodies, weights, names, region, {}, zero)
    bound = Union(lumps, body_of, bind)
    points = _settle(bound, draft.posed(bind), faces, border)
    slope = -bound.slope(points)[1]
    normals = slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)
    own = flesh.colours(model)
    return Skin(
        Mesh(points, normals, faces), bodies, weights, names, region, {n: own[n] for n in names}, bind
    )


def poses(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Body poses (nbody, 7) of the zero pose and of the bind pose."""
    zero = np.array(model.start_q, float)
    for name in model.joint_names:
        q = model.q_slice(name)
        if model.joint_type(name) == "ball":
            zero[q] = [0.0, 0.0, 0.0, 1.0]
        elif model.joint_type(name) == "hinge":
            zero[q] = 0.0
        else:
            zero[q.start + 3 : q.stop] = [0.0, 0.0, 0.0, 1.0]
    bind = zero.copy()
    for name in ("l_shoulder", "r_shoulder"):
        if name in model.joint_names and model.joint_type(name) == "ball":
            q = model.q_slice(name)
            ends = Rotation.from_quat([zero[q], model.start_q[q]])
            bind[q] = Slerp([0.0, 1.0], ends)(LOWERED).as_quat()
    at_zero, at_bind = pose.forward(model, np.stack([zero, bind]))
    return at_zero, at_bind


def _surface(union: Union, body_of: dict[str, int], zero: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The surface in the zero pose: trunk and limbs on one grid, each hand on a finer one, sewn at the
    wrist."""
    ends = [
        (union.origins[i] + np.stack([lump.p, lump.q]) @ union.turns[i].T, max(lump.r) * max(lump.scale))
        for i, lump in enumerate(union.lumps)
    ]
    low = np.min([e.min(axis=0) - r for e, r in ends], axis=0) - 0.03
    high = np.max([e.max(axis=0) + r for e, r in ends], axis=0) + 0.03
    hands = {side: zero[body_of[f"{side}_hand"], :3] for side in "lr" if f"{side}_hand" in body_of}
    if len(hands) < 2 or not np.allclose(hands["l"] * [1, -1, 1], hands["r"], atol=1e-6):
        return surface_net(union.on_grid(axes := [line(a, b, CELL) for a, b in zip(low, high)]), axes)
    wrist = hands["l"][1] - 0.03
    axes = [line(low[0], high[0], 0.8 * CELL), line(-wrist, wrist, CELL), line(low[2], high[2], CELL)]
    if "head" in body_of:
        chin = zero[body_of["head"], 2]
        axes[1] = np.concatenate(
            [line(-wrist, -0.09, CELL), line(-0.09, 0.09, 0.0075)[1:-1], line(0.09, wrist, CELL)]
        )
        axes[2] = np.concatenate([line(low[2], chin, CELL), line(chin, high[2], 0.0068)[1:]])
    points, faces = surface_net(union.on_grid(axes), axes)
    for side, centre in hands.items():
        reach = (wrist, high[1]) if side == "l" else (low[1], -wrist)
        around = [centre[[0, 2]] - [0.08, 0.075], centre[[0, 2]] + [0.13, 0.075]]
        grid = [
            line(around[0][0], around[1][0], HAND_CELL),
            line(*reach, HAND_CELL),
            line(around[0][1], around[1][1], HAND_CELL),
        ]
        more, hand = surface_net(union.on_grid(grid), grid)
        points, faces = sew(points, faces, more, hand, centre)
    return points, faces


def _weights(labels: np.ndarray, faces: np.ndarray, nbody: int) -> tuple[np.ndarray, np.ndarray]:
    """Bodies and weights (points, INFLUENCES) from the label of each point, diffused."""
    count = len(labels)
    weights = coo_matrix(
        (np.ones(count), (np.arange(count), labels)), shape=(count, max(nbody, INFLUENCES))
    ).toarray()
    mean = neighbours(faces, count)
    for _ in range(SPREAD):
        weights = 0.5 * (weights + mean @ weights)
    order = np.argsort(-weights, axis=1, kind="stable")[:, :INFLUENCES]
    kept = np.take_along_axis(weights, order, axis=1)
    kept[kept < 0.005] = 0.0
    return np.minimum(order, nbody - 1), kept / kept.sum(axis=1, keepdims=True)


def _settle(union: Union, points: np.ndarray, faces: np.ndarray, border: np.ndarray) -> np.ndarray:
    """Carried points evened out along the surface, but for those on a border, and drawn onto it."""
    mean, near = neighbours(faces, len(points)), union.near(points)
    for _ in range(2):
        slope = union.slope(points, near)[1]
        normal = slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)
        move = mean @ points - points
        move -= np.sum(move * normal, axis=1, keepdims=True) * normal
        move[border] = 0.0
        points = union.project(points + 0.25 * move, 1, near=near)
    return union.project(points, 1, near=near)


def _paint(
    union: Union, points: np.ndarray, faces: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Points moved a little so that edges follow the borders of regions; which were moved; the region of each
    face; the regions' names."""
    names = sorted({r for lump in union.lumps for r in (lump.region, *(p[0] for p in lump.paint))})
    best = np.full((len(names), len(points)), np.inf)
    distances = union.distances(points)
    for lump, d, i in zip(union.lumps, distances - distances.min(axis=0), range(len(distances))):
        x = union.local(i, points)
        if lump.fold:
            x[:, 1] = np.abs(x[:, 1])
        behind = np.full(len(points), -np.inf)
        for region, normal, offset in reversed(lump.paint):
            h = x @ np.asarray(normal) - offset
            k = names.index(region)
            best[k] = np.minimum(best[k], np.maximum(d, np.maximum(behind, -h)))
            behind = np.maximum(behind, h)
        k = names.index(lump.region)
        best[k] = np.minimum(best[k], np.maximum(d, behind))
    label = np.argmin(best, axis=0)
    pairs, _ = edges(faces)
    a, b = pairs[label[pairs[:, 0]] != label[pairs[:, 1]]].T
    fa = best[label[a], a] - best[label[b], a]
    fb = best[label[a], b] - best[label[b], b]
    t = np.clip(fa / np.where(np.abs(fa - fb) > 1e-12, fa - fb, 1.0), 0.0, 1.0)
    crossing = points[a] + t[:, None] * (points[b] - points[a])
    near = np.concatenate([np.stack([a, t], 1)[t < 0.5], np.stack([b, 1.0 - t], 1)[t >= 0.5]])
    spot = np.concatenate([crossing[t < 0.5], crossing[t >= 0.5]])
    who = near[:, 0].astype(int)
    total, weight = np.zeros_like(points), np.zeros(len(points))
    np.add.at(total, who, spot)
    np.add.at(weight, who, 1.0)
    moved = np.where(weight[:, None] > 0, total / np.maximum(weight, 1.0)[:, None], points)
    votes = np.where(weight[faces] > 0, 0.01, 1.0)
    tally = np.zeros((len(faces), len(names)))
    for corner in range(3):
        np.add.at(tally, (np.arange(len(faces)), label[faces[:, corner]]), votes[:, corner])
    region = np.argmax(tally, axis=1)
    used = np.unique(region)
    return moved, weight > 0.0, np.searchsorted(used, region), [names[k] for k in used]
