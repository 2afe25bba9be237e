"""What happens inside a fragment, kept as one number for each world: gaps, heights and bad contacts after
every step, folded to the least, the most, a weighted sum, the last, or the step of the first."""

import warp as wp

from .kinematics import kinematics
from .port import choose, give, take
from .spatial import *
from .tree import Tree, World

# what is seen
GAP = wp.constant(0)
HEIGHT = wp.constant(1)
BAD = wp.constant(2)

# what becomes of it
LEAST = wp.constant(0)
MOST = wp.constant(1)
SUM = wp.constant(2)
LAST = wp.constant(3)
FIRST = wp.constant(4)

FAR = wp.constant(1.0e6)
"""Least and most of nothing."""


@wp.struct
class Watch:
    kind: wp.array(dtype=int)
    fold: wp.array(dtype=int)
    link: wp.array2d(dtype=int)
    """of the two places, `(n, 2)`"""
    point: wp.array2d(dtype=wp.vec3)
    """on their links [m]"""
    less: wp.array(dtype=float)
    """[m] taken off, as a ball's radius"""
    weight: wp.array2d(dtype=float)
    """by row of the course's table, `(rows, n)`; 0: it does not count then"""
    out: wp.array2d(dtype=float)
    """`(worlds, n)`"""


@wp.func
def spot(world: World, g: int, link: int, point: wp.vec3) -> Vec3:
    """A place on a link in the world [m]."""
    return world.pos[g, link] + rotate(world.R[g, link], point)


@wp.func
def seen(world: World, watch: Watch, g: int, c: int) -> Real:
    kind = watch.kind[c]
    if kind == BAD:
        return world.fumbled[g, 0] + world.fallen[g, 0] + world.broken[g, 0]
    a = spot(world, g, watch.link[c, 0], watch.point[c, 0])
    if kind == HEIGHT:
        return a.z - watch.less[c]
    b = spot(world, g, watch.link[c, 1], watch.point[c, 1])
    return norm(b - a) - watch.less[c]


@wp.func
def begin(watch: Watch, g: int):
    for c in range(watch.kind.shape[0]):
        value = fill(0.0)
        fold = watch.fold[c]
        if fold == LEAST:
            value = fill(FAR)
        elif fold == MOST:
            value = fill(-FAR)
        elif fold == FIRST:
            value = fill(-1.0)
        give(watch.out, g, c, value)


@wp.func
def look(tree: Tree, world: World, watch: Watch, row: wp.array(dtype=int), g: int, later: int):
    """After a step, the one from row `later` of each world's course on."""
    kinematics(tree, world, g)
    none = fill(0.0)
    for c in range(watch.kind.shape[0]):
        weight = choose(watch.weight, row, g, later, c)
        value = seen(world, watch, g, c)
        old = take(watch.out, g, c)
        fold = watch.fold[c]
        if fold == LEAST:
            value = min(old, value)
        elif fold == MOST:
            value = max(old, value)
        elif fold == SUM:
            value = old + weight * value
        elif fold == FIRST:
            now = where_lt(none, value, fill(float(later)), fill(-1.0))
            value = where_lt(old, none, now, old)
        give(watch.out, g, c, where_lt(none, weight, value, old))
