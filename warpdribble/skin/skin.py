"""One smooth body over a player: a mesh, how its points follow the bodies, and its regions.

The surface is taken and bound in the zero pose, where limbs are apart: drawn onto that of another pose,
the skin of the armpits folds over, and a raised arm shows it inside out. A point follows the bodies near it
along the surface: the nearest primitive's body, diffused over the mesh, so that what is near only through the
air (two fingers, arm and trunk) stays apart. Then the mesh is cut along the borders of the clothes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial.transform import Rotation

from ..sims.model import Model, pose
from . import clothes, flesh
from .clothes import Patch
from .cut import Net, cut, onto, refine
from .implicit import FAR, Union
from .kept import kept
from .meshes import Mesh, normals
from .surface_net import line, neighbours, sew, surface_net

CELL = 0.0125
"""[m] of the grid; fingers and the head have finer ones."""
HAND_CELL = 0.0045
SPREAD = 28
"""Rounds of diffusion of the weights: a joint is smooth over about sqrt(2 x rounds) edges."""
SOFT_SPREAD = 80
"""Rounds more about joints that turn far."""
INFLUENCES = 4
"""Bodies that a point follows at most."""
BENT, FINE = np.radians(30.0), 0.007
"""[rad] between the normals at an edge's ends from which it is halved, and [m] down to which."""


WEIGHT_STEPS = 255
"""A weight is a whole number of shares: numbers that recur are stored small, as bytes on the page."""


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
    """The skin of a model; built once, in some seconds, and kept in the user's cache. Raises ValueError
    where there is nothing to cover."""
    if id(model) not in _built:
        if not flesh.of(model):
            raise ValueError("the model has no shapes to put a skin on")
        bind = zero_pose(model)
        arrays = kept(model, bind, KEPT, lambda: _arrays(_build(model)))
        _built[id(model)] = model, _of_arrays(model, bind, arrays)
    return _built[id(model)][1]


KEPT = ("points", "normals", "faces", "bodies", "weights", "region", "regions")
"""Arrays that take time to build."""


def _arrays(skin: Skin) -> dict[str, np.ndarray]:
    return {name: np.asarray({**vars(skin), **vars(skin.mesh)}[name]) for name in KEPT}


def _of_arrays(model: Model, bind: np.ndarray, arrays: dict[str, np.ndarray]) -> Skin:
    own, regions = flesh.colours(model), [str(name) for name in arrays["regions"]]
    mesh = Mesh(*(arrays[name] for name in ("points", "normals", "faces")))
    colours = {name: own[name] for name in regions}
    return Skin(mesh, arrays["bodies"], arrays["weights"], regions, arrays["region"], colours, bind)


def _build(model: Model) -> Skin:
    lumps = flesh.of(model)
    bind = zero_pose(model)
    body_of = {name: i for i, name in enumerate(model.body_names)}
    union = Union(lumps, body_of, bind)
    points, faces = _surface(union, body_of, bind)
    points = onto(union, None, points, 2)
    labels = union.bodies[np.argmin(union.distances(points), axis=0)]
    wide = flesh.wide_joints(model)
    apart = [np.linalg.norm(points - bind[body_of[body], :3], axis=1) - wide[body] for body in wide]
    soft = np.flatnonzero((np.reshape(apart, (-1, len(points))) < 0.0).any(axis=0))
    net = Net.of(points, faces, _diffused(labels, faces, model.nbody, soft))
    patches = [(patch, bind[body_of[patch.body], :3]) for patch in clothes.of(model)]
    net, names = _painted(_refined(net, union, patches), union, patches)
    slope = -union.slope(net.points)[1]
    outward = slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)
    bodies, weights = _strongest(net.values, model.nbody)
    used, region = np.unique(net.region, return_inverse=True)
    regions, own = [names[k] for k in used], flesh.colours(model)
    mesh = Mesh(net.points, outward, net.faces)
    return Skin(mesh, bodies, weights, regions, region, {n: own[n] for n in regions}, bind)


def zero_pose(model: Model) -> np.ndarray:
    """Body poses (nbody, 7) with all joints at zero."""
    zero = np.array(model.start_q, float)
    for name in model.joint_names:
        q = model.q_slice(name)
        if model.joint_type(name) == "ball":
            zero[q] = [0.0, 0.0, 0.0, 1.0]
        elif model.joint_type(name) == "hinge":
            zero[q] = 0.0
        else:
            zero[q.start + 3 : q.stop] = [0.0, 0.0, 0.0, 1.0]
    return np.asarray(pose.forward(model, zero[None])[0])


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


def _diffused(labels: np.ndarray, faces: np.ndarray, nbody: int, soft: np.ndarray) -> np.ndarray:
    """Weights (points, nbody or more) from the label of each point, diffused; further at the `soft` points
    (n,): skin that bends within less than its own length folds over."""
    count = len(labels)
    weights = coo_matrix(
        (np.ones(count), (np.arange(count), labels)), shape=(count, max(nbody, INFLUENCES))
    ).toarray()
    mean = neighbours(faces, count)
    for _ in range(SPREAD):
        weights = 0.5 * (weights + mean @ weights)
    about = mean[soft]
    for _ in range(SOFT_SPREAD):
        weights[soft] = 0.5 * (weights[soft] + about @ weights)
    return weights


def _strongest(weights: np.ndarray, nbody: int) -> tuple[np.ndarray, np.ndarray]:
    """Bodies and weights (points, INFLUENCES), the strongest first."""
    order = np.argsort(-weights, axis=1, kind="stable")[:, :INFLUENCES]
    kept = np.take_along_axis(weights, order, axis=1)
    kept = np.round(WEIGHT_STEPS * kept / kept.sum(axis=1, keepdims=True))
    kept[:, 0] += WEIGHT_STEPS - kept.sum(axis=1)
    return np.minimum(order, nbody - 1), kept / WEIGHT_STEPS


def _refined(net: Net, union: Union, patches: list[tuple[Patch, np.ndarray]]) -> Net:
    """Finer where a border will be cut, and where the surface turns quickly."""

    def wanted(net: Net, pairs: np.ndarray) -> np.ndarray:
        length = np.linalg.norm(net.points[pairs[:, 0]] - net.points[pairs[:, 1]], axis=1)
        normal = normals(net.points, net.faces)
        bent = np.sum(normal[pairs[:, 0]] * normal[pairs[:, 1]], axis=1) < np.cos(BENT)
        found = bent & (length > FINE)
        for patch, origin in patches:
            value = np.full(len(net.points), FAR)
            near = patch.about(net.points - origin)
            value[near] = np.abs(patch.field(net.points[near] - origin))
            found |= (length > patch.edge) & (value[pairs].min(axis=1) < 0.8 * length)
        return found

    return refine(net, union, wanted, 6)


def _painted(net: Net, union: Union, patches: list[tuple[Patch, np.ndarray]]) -> tuple[Net, list[str]]:
    """The mesh cut into regions: those of the nearest primitives, and patches upon them; the regions'
    names."""
    own = [lump.region for lump in union.lumps]
    names = list(dict.fromkeys([*own, *(patch.region for patch, _ in patches)]))
    for number in range(1, len(set(own))):
        mine = np.array([region == names[number] for region in own])

        def nearer(points: np.ndarray, mine: np.ndarray = mine) -> np.ndarray:
            distances = union.distances(points)
            return np.asarray(distances[mine].min(axis=0) - distances[~mine].min(axis=0))

        net = cut(net, union, nearer, number)
    for patch, origin in patches:

        def worn(points: np.ndarray, patch: Patch = patch, origin: np.ndarray = origin) -> np.ndarray:
            return patch.field(points - origin)

        net = cut(net, union, worn, names.index(patch.region))
    return net, names
