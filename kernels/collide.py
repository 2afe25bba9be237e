"""Where two shapes are nearest: gap, point and normal of a contact slot."""

import warp as wp

from .spatial import *
from .tree import POINT_PLANE, SPHERE_BOX, SPHERE_CAPSULE, Tree, World


@wp.struct
class Touch:
    gap: Real
    """[m], negative: overlap"""
    point: Vec3
    """half way between the surfaces [m]"""
    normal: Vec3
    """unit, from a to b"""


@wp.func
def between(near: Vec3, far: Vec3, radius_a: float, radius_b: float) -> Touch:
    """Touch of two balls."""
    apart = far - near
    distance = norm(apart)
    up = Vec3(fill(0.0), fill(0.0), fill(1.0))
    tiny = fill(1.0e-9)
    n = where_lt(tiny, distance, (1.0 / max(distance, tiny)) * apart, up)
    gap = distance - (radius_a + radius_b)
    return Touch(gap, near + (radius_a + 0.5 * gap) * n, n)


@wp.func
def centre(tree: Tree, world: World, g: int, shape: int) -> Vec3:
    i = tree.shape_link[shape]
    return world.pos[g, i] + rotate(world.R[g, i], tree.shape_pos[shape])


@wp.func
def point_plane(tree: Tree, world: World, g: int, slot: int) -> Touch:
    i = tree.slot_link_b[slot]
    plane = tree.slot_plane[slot]
    n = vec3(wp.vec3(plane[0], plane[1], plane[2]))
    x = world.pos[g, i] + rotate(world.R[g, i], tree.slot_point[slot])
    radius = tree.slot_radius[slot]
    gap = dot(n, x) - (plane[3] + radius)
    return Touch(gap, x - (radius + 0.5 * gap) * n, n)


@wp.func
def sphere_capsule(tree: Tree, world: World, g: int, slot: int) -> Touch:
    a = tree.slot_a[slot]
    b = tree.slot_b[slot]
    x = centre(tree, world, g, a)
    s = centre(tree, world, g, b)
    axis = rotate(world.R[g, tree.shape_link[a]], tree.shape_half[a])
    t = dot(s - x, axis) / max(dot(axis, axis), fill(1.0e-12))
    t = max(fill(-1.0), min(fill(1.0), t))
    return between(x + t * axis, s, tree.shape_radius[a], tree.shape_radius[b])


@wp.func
def capsule_capsule(tree: Tree, world: World, g: int, slot: int) -> Touch:
    """Nearest points of two segments (Ericson 2005, 5.1.9)."""
    a = tree.slot_a[slot]
    b = tree.slot_b[slot]
    xa = centre(tree, world, g, a)
    xb = centre(tree, world, g, b)
    u = rotate(world.R[g, tree.shape_link[a]], tree.shape_half[a])
    v = rotate(world.R[g, tree.shape_link[b]], tree.shape_half[b])
    d = xb - xa
    one = fill(1.0)
    tiny = fill(1.0e-12)
    uu = max(dot(u, u), tiny)
    vv = max(dot(v, v), tiny)
    uv = dot(u, v)
    s = (dot(d, u) * vv - dot(d, v) * uv) / max(uu * vv - uv * uv, 1.0e-6 * (uu * vv))
    s = max(neg(one), min(one, s))
    t = (s * uv - dot(d, v)) / vv
    t = max(neg(one), min(one, t))
    s = (t * uv + dot(d, u)) / uu
    s = max(neg(one), min(one, s))
    return between(xa + s * u, xb + t * v, tree.shape_radius[a], tree.shape_radius[b])


@wp.func
def sphere_box(tree: Tree, world: World, g: int, slot: int) -> Touch:
    a = tree.slot_a[slot]
    b = tree.slot_b[slot]
    i = tree.shape_link[a]
    R = rotation(world.turn[g, i] * quat(tree.shape_turn[a]))
    s = centre(tree, world, g, b)
    x = mul_t(R, s - centre(tree, world, g, a))
    half = vec3(tree.shape_half[a])
    # outside: from the nearest point of the box
    c = Vec3(
        max(neg(half.x), min(half.x, x.x)),
        max(neg(half.y), min(half.y, x.y)),
        max(neg(half.z), min(half.z, x.z)),
    )
    d = x - c
    distance = norm(d)
    # inside: out through the nearest face
    zero = fill(0.0)
    px = half.x - abs(x.x)
    py = half.y - abs(x.y)
    pz = half.z - abs(x.z)
    depth = min(px, min(py, pz))
    one = fill(1.0)
    sx = where_lt(x.x, zero, neg(one), one)
    sy = where_lt(x.y, zero, neg(one), one)
    sz = where_lt(x.z, zero, neg(one), one)
    z_or = Vec3(zero, zero, sz)
    y_or = where_lt(pz, py, z_or, Vec3(zero, sy, zero))
    face = where_lt(min(py, pz), px, y_or, Vec3(sx, zero, zero))
    tiny = fill(1.0e-7)
    n = where_lt(tiny, distance, (1.0 / max(distance, tiny)) * d, face)
    out = where_lt(tiny, distance, distance, neg(depth))
    gap = out - tree.shape_radius[b]
    n = R * n
    return Touch(gap, s - (tree.shape_radius[b] + 0.5 * gap) * n, n)


@wp.func
def probe(tree: Tree, world: World, g: int, slot: int) -> Touch:
    kind = tree.slot_kind[slot]
    if kind == POINT_PLANE:
        return point_plane(tree, world, g, slot)
    if kind == SPHERE_CAPSULE:
        return sphere_capsule(tree, world, g, slot)
    if kind == SPHERE_BOX:
        return sphere_box(tree, world, g, slot)
    return capsule_capsule(tree, world, g, slot)
