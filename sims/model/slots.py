"""Contact candidates: which shape may touch which, at which points, fixed once from the model.

Nothing is allocated while stepping, so nothing can overflow: every slot has its place for the gap, the
impulse and the response of the dofs between the two bodies.
"""

from __future__ import annotations

import itertools
import warnings
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from .flights import Place, flyer_tables, lone_balls, told
from .joints import DOF_SIZE
from .mjcf import Shape, Tables

if TYPE_CHECKING:
    import mujoco

POINT_PLANE, SPHERE_CAPSULE, SPHERE_BOX, CAPSULE_CAPSULE, PARALLEL = range(5)


class Pair(TypedDict):
    """Contact properties of two shapes that may touch."""

    shapes: tuple[int, int]
    """their indices"""
    friction: float
    restitution: float
    erp: float
    cfm: float


class Chains:
    """Paths through the tree of links."""

    def __init__(self, tables: Tables):
        self.parent, self.joint = tables.link_parent, tables.link_joint
        self.dof, self.offset = tables.link_dof, tables.link_offset

    def links(self, i: int, stop: int = 0) -> list[int]:
        """i and its ancestors, below `stop`."""
        path = []
        while i != stop:
            path.append(i)
            i = self.parent[i]
        return path

    def meet(self, a: int, b: int) -> int:
        """Nearest common ancestor."""
        above = {0, *self.links(a)}
        while b not in above:
            b = self.parent[b]
        return b

    def dofs(self, i: int) -> list[int]:
        """Dofs of a link's joint, last first, the order in which a force meets them."""
        return list(range(self.dof[i] + DOF_SIZE[self.joint[i]] - 1, self.dof[i] - 1, -1))

    def response(self, a: int, b: int) -> list[int]:
        """Dofs that answer to a contact of links a and b: b's side, a's side, then both's."""
        meet = self.meet(a, b)
        links = self.links(b, meet) + self.links(a, meet) + self.links(meet)
        return [dof for i in links for dof in self.dofs(i)]


def may_touch(m: mujoco.MjModel, a: int, b: int) -> bool:
    """MuJoCo's filter for two geoms."""
    if not (m.geom_contype[a] & m.geom_conaffinity[b] or m.geom_contype[b] & m.geom_conaffinity[a]):
        return False
    body_a, body_b = m.geom_bodyid[a], m.geom_bodyid[b]
    weld_a, weld_b = m.body_weldid[body_a], m.body_weldid[body_b]
    if weld_a == weld_b:
        return False
    excluded = (min(body_a, body_b) << 16) + max(body_a, body_b)
    if excluded in set(m.exclude_signature):
        return False
    up_a = m.body_weldid[m.body_parentid[weld_a]]
    up_b = m.body_weldid[m.body_parentid[weld_b]]
    return not (weld_a and weld_b and (up_a == weld_b or up_b == weld_a))


def touch_points(shape: Shape) -> list[tuple[np.ndarray, float]]:
    """Points of a shape (body frame) and a radius around each, of which one is nearest to any plane."""
    R = Rotation.from_quat(shape.quat)
    if shape.kind == "sphere":
        return [(shape.pos, shape.size[0])]
    if shape.kind == "capsule":
        end = R.apply([0, 0, shape.size[1]])
        return [(shape.pos + end, shape.size[0]), (shape.pos - end, shape.size[0])]
    corners = itertools.product((-1, 1), repeat=3)
    return [(shape.pos + R.apply(shape.size * c), 0.0) for c in corners]


def drop_shared(
    points: list[tuple[np.ndarray, float]],
    link: int,
    place: list[Place],
    shapes: list[Shape],
    chains: Chains,
) -> list[tuple[np.ndarray, float]]:
    """Touch points less those at the link's own joint where the parent link ends in one as well: the
    phalanges of a finger need one contact per knuckle, not two."""
    parent = chains.parent[link]
    if parent == 0:
        return points
    above = [
        place[k][1] + place[k][2].apply(point)
        for k, s in enumerate(shapes)
        if place[k][0] == parent and s.kind == "capsule" and s.contype | s.conaffinity
        for point, _ in touch_points(s)
    ]
    anchor = chains.offset[link]
    return [
        (point, radius)
        for point, radius in points
        if np.linalg.norm(point) > radius
        or not any(np.linalg.norm(anchor - other) < radius for other in above)
    ]


def build_slots(
    m: mujoco.MjModel,
    geoms: list[int],
    shapes: list[Shape],
    tables: Tables,
    bodies: dict[str, np.ndarray],
    inertia: dict[str, np.ndarray],
) -> tuple[dict[str, np.ndarray], list[Pair], list[str]]:
    """Arrays `slot_*`, `response_dof`, `shape_*`, `flyer_*`, `flight_*` for the kernels, the pairs of
    shapes that may touch, and notes; `geoms[k]` is the geom of shape k."""
    chains = Chains(tables)
    place = [
        (
            bodies["body_link"][s.body + 1],
            bodies["body_offset"][s.body + 1],
            Rotation.from_quat(bodies["body_turn"][s.body + 1]),
        )
        for s in shapes
    ]
    rows: list[dict[str, Any]] = []
    pairs: list[Pair] = []
    responses: list[list[int]] = []
    balls = lone_balls(shapes, place, tables, inertia["link_com"])
    flights: dict[int, list[int]] = {ball: [] for ball in balls}

    def add(
        kind: int,
        a: int,
        b: int,
        plane: ArrayLike = (0, 0, 1, 0),
        point: ArrayLike = (0, 0, 0),
        radius: float = 0.0,
    ) -> None:
        link_a = 0 if kind == POINT_PLANE else int(place[a][0])
        link_b = int(place[b][0])
        dofs = chains.response(link_a, link_b)
        rows.append(
            dict(
                slot_kind=kind,
                slot_pair=len(pairs) - 1,
                slot_a=a,
                slot_b=b,
                slot_link_a=link_a,
                slot_link_b=link_b,
                slot_meet=chains.meet(link_a, link_b),
                slot_dof=sum(len(dofs) for dofs in responses),
                slot_length=len(dofs),
                slot_plane=np.asarray(plane, float),
                slot_point=np.asarray(point, float),
                slot_radius=radius,
            )
        )
        responses.append(dofs)

    left_out = []
    for a, b in itertools.combinations(range(len(shapes)), 2):
        if not may_touch(m, geoms[a], geoms[b]) or (place[a][0] == 0 and place[b][0] == 0):
            continue
        order = {"plane": 0, "sphere": 3, "capsule": 1, "box": 2}
        if order[shapes[b].kind] < order[shapes[a].kind]:
            a, b = b, a
        kinds = (shapes[a].kind, shapes[b].kind)
        if kinds in (("capsule", "box"), ("box", "box")):
            left_out.append(f"{shapes[a].name} and {shapes[b].name}")
            continue
        pairs.append(combine(m, geoms[a], geoms[b], shapes[a], shapes[b], a, b))
        if kinds[0] == "plane":
            link_b, offset, turn = place[b]
            n = (place[a][2] * Rotation.from_quat(shapes[a].quat)).apply([0, 0, 1])
            at = place[a][1] + place[a][2].apply(shapes[a].pos)
            points = [(offset + turn.apply(p), radius) for p, radius in touch_points(shapes[b])]
            for point, radius in drop_shared(points, link_b, place, shapes, chains):
                if b in flights:
                    flights[b].append(len(rows))
                add(POINT_PLANE, a, b, (*n, n @ at), point, radius)
        elif kinds[1] == "sphere":
            add(SPHERE_BOX if kinds[0] == "box" else SPHERE_CAPSULE, a, b)
        else:
            add(CAPSULE_CAPSULE, a, b)
            add(PARALLEL, a, b)
    if left_out:
        warnings.warn(
            f"contacts between boxes and boxes or capsules are not simulated: {len(left_out)} pairs, "
            f"first {left_out[0]}; set contype and conaffinity to say that they do not collide",
            stacklevel=4,
        )
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]} if rows else {}
    table |= flyer_tables({int(place[ball][0]): slots for ball, slots in flights.items() if slots}, inertia)
    table["slot_flight"] = np.isin(np.arange(len(rows)), table["flight_slot"]).astype(int)
    table["response_dof"] = np.array([dof for dofs in responses for dof in dofs], int)
    return table | shape_tables(shapes, place), pairs, told(shapes, pairs, balls)


def combine(m: mujoco.MjModel, ga: int, gb: int, a: Shape, b: Shape, ia: int, ib: int) -> Pair:
    """Contact properties of two shapes: friction as MuJoCo (the larger, or the one with priority),
    restitution the product, erp and cfm the mean."""
    friction = max(a.friction, b.friction)
    condim = max(a.condim, b.condim)
    if m.geom_priority[ga] != m.geom_priority[gb]:
        chief = a if m.geom_priority[ga] > m.geom_priority[gb] else b
        friction, condim = chief.friction, chief.condim
    return Pair(
        shapes=(ia, ib),
        friction=friction if condim == 3 else 0.0,
        restitution=a.restitution * b.restitution,
        erp=0.5 * (a.erp + b.erp),
        cfm=0.5 * (a.cfm + b.cfm),
    )


def shape_tables(shapes: list[Shape], place: list[Place]) -> dict[str, np.ndarray]:
    """Shapes in their links' frames."""
    names = ("shape_link", "shape_pos", "shape_turn", "shape_half", "shape_radius")
    table: dict[str, list[Any]] = {name: [] for name in names}
    for s, (link, offset, frame) in zip(shapes, place, strict=True):
        turn = frame * Rotation.from_quat(s.quat)
        half = np.zeros(3)
        if s.kind == "box":
            half = s.size
        elif s.kind == "capsule":
            half = turn.apply([0, 0, s.size[1]])
        table["shape_link"].append(link)
        table["shape_pos"].append(offset + frame.apply(s.pos))
        table["shape_turn"].append(turn.as_quat())
        table["shape_half"].append(half)
        table["shape_radius"].append(s.size[0] if s.kind in ("sphere", "capsule") else 0.0)
    return {name: np.array(rows) for name, rows in table.items()}
