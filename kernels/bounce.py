"""A free ball over the ground, its impact solved within the step.

A restitution that only sees velocities at steps of 0.01 s loses or gains per cents of height at every
bounce. A ball that touches nothing but the ground flies a parabola, so the time of impact is the root of
a quadratic and the bounce is exact. Semi-implicit Euler keeps its velocity half a step behind: the true
velocity at a step's start is v + a h / 2, which is what the parabola needs, and what the reflected
velocity is turned back from.
"""

import warp as wp

from .collide import Touch
from .kinematics import load3, store3
from .spatial import *
from .tree import Tree, World

BOUNCE_SPEED = wp.constant(0.1)
"""Slower impacts do not bounce [m/s]."""


@wp.func
def bounce(tree: Tree, world: World, g: int, i: int, slot: int, touch: Touch, free: Real) -> Real:
    """Bounce the ball of link i off the ground in the lanes where `free` is positive and it strikes
    within the step; returns 1 there, else 0. Sets w, and moves q by what a step with the new velocity
    would leave out."""
    h = tree.h
    pair = tree.slot_pair[slot]
    j = tree.link_dof[i]
    iq = tree.link_q[i]
    n = touch.normal
    d = world.d[g, j]
    V = world.V[g, i]
    v = V.v
    a = (1.0 / h) * (d * load3(world.w, g, j) - v)
    an = dot(n, a)
    vt = v - dot(n, v) * n + 0.5 * h * (a - an * n)
    at = a - an * n

    # fall: gap + u t + an t^2 / 2 = 0
    u = dot(n, v) + 0.5 * h * an
    gap = max(touch.gap, fill(0.0))
    inside = u * u - 2.0 * an * gap
    t = 2.0 * gap / max(sqrt(max(inside, fill(0.0))) - u, fill(1.0e-9))
    strike = u + an * t
    zero = fill(0.0)
    one = fill(1.0)
    hits = where_lt(t, fill(h), where_lt(strike, fill(-BOUNCE_SPEED), one, zero), zero)
    hits = where_lt(zero, inside, where_lt(zero, free, hits, zero), zero)

    # impact: restitution, and friction that at most stops the surface's slip
    e = world.restitution[g, pair]
    radius = tree.slot_radius[slot]
    k = world.mass_scale[g, i]
    mass = k * tree.link_mass[i]
    moments = tree.link_moments[i]
    moment = k * moments[0]
    spin = V.w
    slip = vt + t * at - radius * cross(spin, n)
    stick = 1.0 / (1.0 / mass + (radius * radius) / moment)
    grip = world.friction[g, pair] * (1.0 + e) * mass * neg(strike)
    wanted = stick * norm(slip)
    J = neg(where_lt(grip, wanted, grip / max(wanted, fill(1.0e-12)), one) * stick) * slip
    vt_new = vt + t * at + (1.0 / mass) * J
    spin_new = spin - (radius / moment) * cross(n, J)

    # rise for the rest of the step
    s = h - t
    up = neg(e * strike)
    normal_move = u * t + 0.5 * an * t * t + up * s + 0.5 * an * s * s
    move = normal_move * n + (t * vt + 0.5 * t * t * at + s * vt_new + 0.5 * s * s * at)
    v_new = (up + an * s - 0.5 * h * an) * n + vt_new + (s - 0.5 * h) * at

    store3(
        world.q,
        g,
        iq,
        load3(world.q, g, iq) + where_lt(zero, hits, move - fill(h) * v_new, zero3()),
    )
    old = load3(world.w, g, j)
    store3(world.w, g, j, where_lt(zero, hits, (1.0 / d) * v_new, old))
    for k3 in range(3):
        dof = j + 3 + k3
        turned = dot(world.s[g, dof], spin_new) / world.d[g, dof]
        world.w[g, dof] = where_lt(zero, hits, turned, world.w[g, dof])
    world.knock[g, i] = where_lt(zero, hits, mass * (up - strike), zero)
    return hits
