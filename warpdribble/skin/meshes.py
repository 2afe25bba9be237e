"""Triangle meshes for the shapes of a model: what a viewer shows, since viewers do not draw
analytic shapes alike."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from ..sims.model import Shape
from .cut import Net, cut

BOX_ROUNDING = 0.35
"""Radius of a box's edges, as a share of its smallest half size."""
SEAM_HALF_WIDTH = 0.035
"""Half width of the seams of a ball, as a share of its radius."""


@dataclass(frozen=True)
class Mesh:
    points: np.ndarray
    """(points, 3) [m]."""
    normals: np.ndarray
    """(points, 3), outward, unit length."""
    faces: np.ndarray
    """(faces, 3) int, counter-clockwise seen from outside."""


def shape_mesh(shape: Shape) -> Mesh:
    """The surface of a sphere, capsule or box in the frame of its body. Raises ValueError for other kinds."""
    mesh = _plain(shape.kind, tuple(float(v) for v in shape.size), shape.name)
    turn = Rotation.from_quat(shape.quat)
    return Mesh(turn.apply(mesh.points) + shape.pos, turn.apply(mesh.normals), mesh.faces)


def merge(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    starts = np.cumsum([0, *(len(m.points) for m in meshes[:-1])])
    return Mesh(
        np.concatenate([m.points for m in meshes]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.faces + start for m, start in zip(meshes, starts)]),
    )


def weld(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) without copies of any, and the faces among them."""
    rounded = np.ascontiguousarray(np.round(mesh.points, 7) + 0.0)
    keys = rounded.view([("", rounded.dtype)] * 3).ravel()
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    if len(first) == len(mesh.points):
        return mesh.points, mesh.faces
    return mesh.points[first], inverse.reshape(-1)[mesh.faces]


def normals(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(points, 3), outward, unit length: those of the faces around each point, by area."""
    of_face = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    total = [np.bincount(faces.ravel(), np.repeat(of_face[:, k], 3), len(points)) for k in range(3)]
    return _unit(np.stack(total, axis=1))


def faces_of(mesh: Mesh, chosen: np.ndarray) -> Mesh:
    """The part of a mesh made of the chosen faces (faces,) bool."""
    used, faces = np.unique(mesh.faces[chosen], return_inverse=True)
    return Mesh(mesh.points[used], mesh.normals[used], faces.reshape(-1, 3))


def is_ball(mesh: Mesh) -> bool:
    """Whether a mesh is a sphere around the origin."""
    size = np.linalg.norm(mesh.points, axis=1)
    return bool(np.ptp(size) < 1e-6 * size.max())


def ball_parts(mesh: Mesh) -> tuple[Mesh, Mesh]:
    """The panels and the seams of a ball's mesh, a sphere around the origin that is cut along the seams'
    edges."""
    sphere = _Sphere(float(np.linalg.norm(mesh.points[0])))
    net = cut(Net.of(mesh.points, mesh.faces), sphere, seam_field, 1)
    whole = Mesh(net.points, _unit(net.points), net.faces)
    return faces_of(whole, net.region == 0), faces_of(whole, net.region == 1)


def seam_field(points: np.ndarray) -> np.ndarray:
    """How far (points,) from the edges of a ball's seams points (n, 3) around its centre are, in its radii;
    negative on a seam."""
    x, y, z = _unit(points).T
    opening = np.radians(42.0) + np.radians(10.0) * np.cos(2.0 * np.arctan2(z, x))
    curved = np.abs(np.arccos(np.clip(np.abs(y), 0.0, 1.0)) - opening)
    return np.asarray(np.minimum(np.minimum(np.abs(x), np.abs(z)), curved) - SEAM_HALF_WIDTH)


@dataclass(frozen=True)
class _Sphere:
    """A surface to cut on."""

    radius: float

    def slope(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.linalg.norm(points, axis=1) - self.radius, _unit(points)


@lru_cache(maxsize=256)
def _plain(kind: str, size: tuple[float, ...], name: str) -> Mesh:
    """The surface of a shape in its own frame; made once, as trimesh takes a millisecond for each."""
    if kind == "sphere":
        return _sphere(size[0])
    if kind == "capsule":
        return _capsule(size[0], size[1])
    if kind == "box":
        return _box(np.array(size[:3]))
    raise ValueError(f"shape '{name}': no mesh for the kind '{kind}'")


def _sphere(radius: float) -> Mesh:
    sphere = trimesh.creation.icosphere(subdivisions=5 if radius > 0.1 else 3, radius=1.0)
    points = np.asarray(sphere.vertices)
    return Mesh(radius * points, points, np.asarray(sphere.faces))


def _capsule(radius: float, half_length: float) -> Mesh:
    count = [24, 13] if radius > 0.02 else [12, 7]
    capsule = trimesh.creation.capsule(height=2.0 * half_length, radius=radius, count=count)
    points = np.asarray(capsule.vertices)
    axis = np.zeros_like(points)
    axis[:, 2] = np.clip(points[:, 2], -half_length, half_length)
    return Mesh(points, _unit(points - axis), np.asarray(capsule.faces))


def _box(half: np.ndarray) -> Mesh:
    """A box with rounded edges: the hull of eight balls."""
    radius = BOX_ROUNDING * half.min()
    inner = half - radius
    steps = np.linspace(0.0, np.pi / 2.0, 5)
    theta, phi = (a.ravel() for a in np.meshgrid(steps, steps))
    octant = np.stack([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), np.sin(theta)], axis=1)
    octant = np.unique(np.round(octant, 12), axis=0)
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    normals = np.concatenate([octant * s for s in signs])
    points = np.concatenate([(octant * radius + inner) * s for s in signs])
    hull = trimesh.Trimesh(points, process=False).convex_hull
    points = np.asarray(hull.vertices)
    normals = _unit(points - np.clip(points, -inner, inner))
    return Mesh(points, normals, np.asarray(hull.faces))


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
