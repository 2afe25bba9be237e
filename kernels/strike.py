"""Impacts with restitution, wherever bodies strike: Newton's law for all of their contacts at once.

A contact strikes when it closes within the step faster than BOUNCE_SPEED. Whatever else of the two bodies,
and of what hangs on them, would touch within a hair of the same step strikes with it, each contact with its
own velocity before: a box that falls flat leaves as flat, whichever of its corners rounding lets be first.
Each contact's way within the step is the parabola of a free flight (see `bounce`), from which come the place
that the step is to end at, `goal`, and the velocity that stays, `kept`.
"""

import warp as wp

from .bounce import BOUNCE_SPEED
from .contact import MARGIN, NEVER, parting, respond, velocity
from .spatial import *
from .tree import GROUND, Tree, World


@wp.struct
class Approach:
    """A contact's way within the step, if no other came between: gap + u t + a t^2 / 2."""

    gap: Real
    u: Real
    a: Real
    """no more than gravity's [m/s^2]"""
    time: Real
    """until it closes, at most the step [s]"""


@wp.func
def approach(tree: Tree, world: World, g: int, slot: int, at: int) -> Approach:
    h = tree.h
    zero = fill(0.0)
    if at == tree.response_room:
        respond(tree, world, g, slot, at)
    u = dot(world.normal[g, slot], parting(tree, world, g, slot, world.point[g, slot]))
    most = fill(wp.length(tree.gravity))
    a = (1.0 / h) * (velocity(tree, world, g, slot, at).x - u)
    a = max(neg(most), min(a, most))
    u = u + 0.5 * h * a  # semi-implicit Euler keeps its velocity half a step behind
    gap = max(world.gap[g, slot], zero)
    inside = u * u - 2.0 * a * gap
    t = 2.0 * gap / max(sqrt(max(inside, zero)) - u, fill(1.0e-9))
    return Approach(gap, u, a, where_lt(inside, zero, fill(h), min(t, fill(h))))


@wp.func
def gap_after(c: Approach, t: Real) -> Real:
    return c.gap + t * (c.u + 0.5 * t * c.a)


@wp.func
def trunk(tree: Tree, i: int) -> int:
    """The link at the ground end of the path from link i."""
    while tree.link_parent[i] != GROUND:
        i = tree.link_parent[i]
    return i


@wp.func
def mark(tree: Tree, world: World, g: int, i: int, value: Real):
    if i != GROUND:
        world.struck[g, trunk(tree, i)] = value


@wp.func
def struck(tree: Tree, world: World, g: int, i: int) -> Real:
    if i == GROUND:
        return fill(0.0)
    return world.struck[g, trunk(tree, i)]


@wp.func
def liveliness(tree: Tree, world: World, g: int, slot: int) -> Real:
    """The restitution of a slot; none where `bounce` sees to it."""
    e = world.restitution[g, tree.slot_pair[slot]]
    if tree.slot_flight[slot] != 0:
        return where_lt(world.touched[g, tree.slot_link_b[slot]], fill(MARGIN), e, fill(0.0))
    return e


@wp.func
def strike(tree: Tree, world: World, g: int):
    """What the slots that strike want, and what they are to be left with."""
    h = tree.h
    zero = fill(0.0)
    count = world.active[g, 2 * tree.slot_count]
    world.struck[g, GROUND] = zero
    lively = zero
    for k in range(count):
        lively = max(lively, liveliness(tree, world, g, world.active[g, 2 * k]))
    if not any_lt(zero, lively):
        return
    for k in range(count):
        slot = world.active[g, 2 * k]
        mark(tree, world, g, tree.slot_link_a[slot], zero)
        mark(tree, world, g, tree.slot_link_b[slot], zero)
    first = zero
    for k in range(count):
        slot = world.active[g, 2 * k]
        e = liveliness(tree, world, g, slot)
        if any_lt(zero, e):
            c = approach(tree, world, g, slot, world.active[g, 2 * k + 1])
            left = where_lt(c.u + c.a * c.time, fill(-BOUNCE_SPEED), h - c.time, zero)
            left = where_lt(fill(NEVER), world.goal[g, slot], where_lt(zero, e, left, zero), zero)
            a = tree.slot_link_a[slot]
            b = tree.slot_link_b[slot]
            mark(tree, world, g, a, max(left, struck(tree, world, g, a)))
            mark(tree, world, g, b, max(left, struck(tree, world, g, b)))
            first = max(first, left)
    world.struck[g, GROUND] = first
    if any_lt(zero, first):
        for k in range(count):
            rebound(tree, world, g, world.active[g, 2 * k], world.active[g, 2 * k + 1])


@wp.func
def rebound(tree: Tree, world: World, g: int, slot: int, at: int):
    """A slot of bodies that strike, if it is near enough and approaches: fall, impact and rise."""
    h = tree.h
    zero = fill(0.0)
    e = liveliness(tree, world, g, slot)
    c = approach(tree, world, g, slot, at)
    a = struck(tree, world, g, tree.slot_link_a[slot])
    b = struck(tree, world, g, tree.slot_link_b[slot])
    left = max(a, b)
    # all at the time of the first, where that is a hair from the contact's own
    t = where_lt(gap_after(c, h - left), fill(MARGIN), h - left, c.time)
    speed = c.u + t * c.a
    left = where_lt(gap_after(c, c.time), fill(MARGIN), where_lt(speed, zero, left, zero), zero)
    left = where_lt(fill(NEVER), world.goal[g, slot], where_lt(zero, e, left, zero), zero)
    up = neg(e * speed)
    rise = h - t
    goal = (1.0 / h) * (gap_after(c, t) - c.gap + rise * (up + 0.5 * rise * c.a))
    goal = max(goal, world.goal[g, slot])
    kept = up + (rise - 0.5 * h) * c.a
    world.goal[g, slot] = where_lt(zero, left, goal, world.goal[g, slot])
    world.kept[g, slot] = where_lt(zero, left, kept, world.kept[g, slot])
