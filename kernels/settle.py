"""One contact by itself: non-penetration and Coulomb's law."""

import warp as wp

from .contact import respond, velocity
from .spatial import *
from .tree import Tree, World


@wp.func
def settle(world: World, g: int, at: int, u: Vec3, old: Vec3, goal: Real, friction: Real) -> Vec3:
    """The impulse that suits a slot by itself, u being its velocity with the impulse `old`: sticking
    where friction allows it; else slipping, normal and friction found together, as friction may lift
    or press."""
    a = world.y[g, at]
    b = world.y[g, at + 1]
    more = world.y[g, at + 4]
    zero = fill(0.0)
    # what the velocity lacks, were the impulse taken away
    n0 = goal - (u.x - a.x * old.x - a.y * old.y - a.z * old.z)
    t0 = a.y * old.x + b.x * old.y + b.y * old.z - u.y
    s0 = a.z * old.x + b.y * old.y + b.z * old.z - u.z
    # sticking: G x = (n0, t0, s0)
    c = world.y[g, at + 2]
    d = world.y[g, at + 3]
    n = c.x * n0 + c.y * t0 + c.z * s0
    t = c.y * n0 + d.x * t0 + d.y * s0
    s = c.z * n0 + d.y * t0 + d.z * s0
    grip = friction * max(n, zero)
    slips = t * t + s * s - grip * grip
    # slipping: against the slip, by as long a step as is stable
    dt = old.y - more.y * u.y
    ds = old.z - more.y * u.z
    unit = 1.0 / sqrt(max(dt * dt + ds * ds, fill(1.0e-24)))
    dt = unit * dt
    ds = unit * ds
    n_slip = max(n0, zero) / max(more.x + friction * (a.y * dt + a.z * ds), 0.5 * more.x)
    grip = friction * n_slip
    return Vec3(
        where_lt(slips, zero, n, n_slip),
        where_lt(slips, zero, t, grip * dt),
        where_lt(slips, zero, s, grip * ds),
    )


@wp.func
def residual(tree: Tree, world: World, g: int) -> Real:
    """Largest velocity [m/s] by which a slot misses non-penetration or Coulomb's law: the step of the
    natural map, times the slot's inverse inertia."""
    worst = fill(0.0)
    for k in range(world.active[g, 2 * tree.slot_count]):
        slot = world.active[g, 2 * k]
        at = world.active[g, 2 * k + 1]
        if at == tree.response_room:
            respond(tree, world, g, slot, at)
        u = velocity(tree, world, g, slot, at)
        x = world.impulse[g, slot]
        pair = tree.slot_pair[slot]
        soft = tree.pair_cfm[pair] / tree.h
        nn = world.y[g, at].x
        n = max(fill(0.0), x.x - (u.x + soft * x.x - world.goal[g, slot]) / nn)
        stiff = world.y[g, at + 4].z
        t = x.y - u.y / stiff
        s = x.z - u.z / stiff
        grip = world.friction[g, pair] * x.x
        back = min(grip / sqrt(max(t * t + s * s, fill(1.0e-24))), fill(1.0))
        t = back * t - x.y
        s = back * s - x.z
        worst = max(worst, nn * abs(n - x.x))
        worst = max(worst, stiff * sqrt(t * t + s * s))
    return worst
