"""Where two shapes are nearest: gap, point and normal of a contact slot."""

import warp as wp

from .spatial import *
from .tree import PARALLEL, POINT_PLANE, SPHERE_BOX, SPHERE_CAPSULE, Tree, World

APART = wp.constant(1.0e3)
"""Gap of a slot that its pair has no use for [m]."""


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


SLACK = wp.constant(0.001)
"""How much deeper than at its ends a contact of nearly parallel capsules may be in between, in parts of the
sum of their radii."""
CROSSED = wp.constant(4.0)
"""1 / sin of the angle, about 15 degrees, from which on capsules have one contact."""


@wp.func
def capsule_capsule(tree: Tree, world: World, g: int, slot: int, side: float) -> Touch:
    """Nearest points of two segments (Ericson 2005, 5.1.9), or, where they are nearly parallel, one end of
    the stretch in which they are about as near: the one towards the end of a's axis where `side` is 1, the
    other where it is -1. Both draw together as the angle grows, until there is one contact, `side` -1."""
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
    du = dot(d, u)
    s = (du * vv - dot(d, v) * uv) / max(uu * vv - uv * uv, 1.0e-6 * (uu * vv))
    s = max(neg(one), min(one, s))
    t = (s * uv - dot(d, v)) / vv
    t = max(neg(one), min(one, t))
    s = (t * uv + du) / uu
    s = max(neg(one), min(one, s))
    # the ends: no further from s than SLACK allows, nor than the segments lie side by side
    w = cross(u, v)
    crossed = sqrt(uu * vv / max(dot(w, w), 1.0e-12 * (uu * vv)))
    radii = tree.shape_radius[a] + tree.shape_radius[b]
    reach = wp.sqrt(2.0 * SLACK) * radii * max(crossed - CROSSED, fill(0.0)) / sqrt(uu)
    half = abs(uv) / uu
    low = max(s - reach, max(neg(one), du / uu - half))
    high = min(s + reach, min(one, du / uu + half))
    low = min(s, low)
    high = max(s, high)
    end = low
    if side > 0.0:
        end = high
    t_end = max(neg(one), min(one, (end * uv - dot(d, v)) / vv))
    t = where_lt(high, low + tiny, t, t_end)
    touch = between(xa + end * u, xb + t * v, tree.shape_radius[a], tree.shape_radius[b])
    if side > 0.0:
        same = (high - low) * sqrt(uu) - 0.01 * radii
        touch.gap = where_lt(same, fill(0.0), fill(APART), touch.gap)
    return touch


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
    if kind == PARALLEL:
        return capsule_capsule(tree, world, g, slot, 1.0)
    return capsule_capsule(tree, world, g, slot, -1.0)
