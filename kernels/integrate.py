"""Semi-implicit Euler on the group: q+ = q + h v+, rotations by the quaternion exponential."""

import warp as wp

from .contact import MARGIN
from .kinematics import load3, load4, store3, store4
from .spatial import *
from .tree import BALL, FREE, Tree, World


@wp.func
def turn_joint(world: World, g: int, iq: int, v: Vec3, h: Real):
    store4(world.q, g, iq, normalize(load4(world.q, g, iq) * exponential(h * v)))


@wp.func
def integrate(tree: Tree, world: World, g: int):
    h = fill(tree.h)
    for i in range(1, tree.link_count + 1):
        joint = tree.link_joint[i]
        iq = tree.link_q[i]
        iv = tree.link_dof[i]
        if joint == FREE:
            x = load3(world.q, g, iq) + h * load3(world.qd, g, iv)
            w = load3(world.qd, g, iv + 3)
            t = tree.link_tumbler[i]
            if t >= 0:
                lag = world.lag[g, t]
                apart = world.touched[g, i]
                x = x + where_lt(apart, fill(MARGIN), zero3(), lag.v)
                w = w - where_lt(apart, fill(MARGIN), zero3(), lag.w)
            store3(world.q, g, iq, x)
            away = max(abs(x.x), max(abs(x.y), abs(x.z)))
            world.strayed[g, 0] = where_lt(fill(tree.far), away, fill(1.0), world.strayed[g, 0])
            turn_joint(world, g, iq + 3, w, h)
        elif joint == BALL:
            turn_joint(world, g, iq, load3(world.qd, g, iv), h)
        else:
            world.q[g, iq] = world.q[g, iq] + h * world.qd[g, iv]
    check(tree, world, g)


@wp.func
def check(tree: Tree, world: World, g: int):
    """Flag worlds whose state has stopped being finite; a comparison with a NaN is false."""
    total = fill(0.0)
    for k in range(tree.q_count):
        x = world.q[g, k]
        total = total + x * x
    for k in range(tree.dof_count):
        v = world.qd[g, k]
        total = total + v * v
    world.broken[g, 0] = where_lt(total, fill(1.0e12), world.broken[g, 0], fill(1.0))
