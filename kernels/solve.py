"""All contacts at once: projected Gauss-Seidel in whitened coordinates, accelerated.

A sweep visits the slots in use one after the other and gives each the impulse that suits it, the others as
they are. Alone it is slow where a light body carries a heavy one: each sweep then does nearly what the last
did, about as many times as one is heavier than the other. So after a sweep the impulses go on along the way
between the last two sweeps' ends, as far as makes the change smallest if the problem is linear (Anderson
1965, of depth one):

    x + theta (x - x'),   theta = -<f, f - f'> / <f - f', f - f'>,

f being what a sweep changes, primes the sweep before. A lane always ends with a plain sweep.

A step is solved twice where it must be. The first solution moves the bodies: gaps close, some of an overlap
is taken back. The second is the velocity that stays: the push is not kept, and what struck flies off (see
`strike`).
"""

import warp as wp

from .contact import SOFT, add_impulse, respond, velocity
from .rows import row_ahead
from .settle import settle
from .spatial import *
from .tree import GROUND, Tree, World

FINE = wp.constant(1.0e-5)
"""A lane is solved when a sweep changes no slot's velocity by more than this [m/s]."""
ROUGH = wp.constant(0.2)
"""Lanes that change by more than this after `tree.sweeps` go on while they get better [m/s]."""
EXACT = wp.constant(3.0e-5)
"""The same at impacts, so that what is symmetric before is so after [m/s]."""
HARD = wp.constant(1.0)
"""It is an impact where the first sweep changes a velocity by more than this and nothing was in touch before
[m/s], or where something strikes."""
MOST = wp.constant(8)
"""Times `tree.sweeps`, no more."""
HARMLESS = wp.constant(0.05)
"""A push of this may stay as velocity: it lifts by 0.13 mm [m/s]."""
LONGEST = wp.constant(1000.0)
"""Largest theta."""


@wp.func
def held(tree: Tree, world: World, g: int, slot: int) -> Real:
    """How fast a contact that is no spring yields to its load [m/s]."""
    cfm = tree.pair_cfm[tree.slot_pair[slot]]
    if cfm > SOFT:
        return fill(0.0)
    return (cfm / tree.h) * world.impulse[g, slot].x


@wp.struct
class Change:
    """What a sweep changed."""

    most: Real
    """the square of the largest change of a slot's velocity [m^2/s^2]"""
    across: Real
    """<f, f - f'>, in the metric of the slots' own inertias"""
    along: Real
    """<f - f', f - f'>"""


@wp.func
def sweep(tree: Tree, world: World, g: int, going: Real, hard: int) -> Change:
    """Settle every slot in use once, in the lanes where `going` is positive; `hard`: 1 so that contacts do
    not yield, but for springs; else 0."""
    zero = fill(0.0)
    total = Change(zero, zero, zero)
    for k in range(world.active[g, 2 * tree.slot_count]):
        slot = world.active[g, 2 * k]
        at = world.active[g, 2 * k + 1]
        if at == tree.response_room:
            respond(tree, world, g, slot, at)
        old = world.impulse[g, slot]
        u = velocity(tree, world, g, slot, at)
        friction = world.friction[g, tree.slot_pair[slot]]
        goal = world.goal[g, slot]
        if hard != 0:
            goal = goal + held(tree, world, g, slot)  # once the impulse changes no more, it does not yield
        new = settle(world, g, at, u, old, goal, friction)
        f = where_lt(zero, going, new - old, zero3())
        d = f - world.change[g, slot]
        world.change[g, slot] = f
        world.impulse[g, slot] = old + f
        add_impulse(tree, world, g, slot, at, f)
        nn = world.y[g, at].x
        tt = world.y[g, at + 4].z
        fn = nn * f.x
        fy = tt * f.y
        fz = tt * f.z
        total.most = max(total.most, max(fn * fn, fy * fy + fz * fz))
        total.across = total.across + fn * d.x + fy * d.y + fz * d.z
        total.along = total.along + nn * d.x * d.x + tt * (d.y * d.y + d.z * d.z)
    return total


@wp.func
def remember(tree: Tree, world: World, g: int):
    """What the first sweep settled on."""
    for k in range(world.active[g, 2 * tree.slot_count]):
        slot = world.active[g, 2 * k]
        world.settled[g, slot] = world.impulse[g, slot]
    for j in range(tree.dof_count):
        world.w_settled[g, j] = world.w[g, j]


@wp.func
def go_on(tree: Tree, world: World, g: int, theta: Real):
    """Further along the way of the last two sweeps, theta times."""
    for k in range(world.active[g, 2 * tree.slot_count]):
        slot = world.active[g, 2 * k]
        ahead = world.impulse[g, slot] + theta * (world.impulse[g, slot] - world.settled[g, slot])
        world.settled[g, slot] = world.impulse[g, slot]
        world.impulse[g, slot] = ahead
    row_ahead(world.w, world.w_settled, g, tree.dof_count, theta)


@wp.func
def sweeps(tree: Tree, world: World, g: int, going: Real, hard: int):
    """Sweep in the lanes where `going` is positive, each for itself, until it changes little: `tree.sweeps`
    times unless more or less will do."""
    zero = fill(0.0)
    struck = world.struck[g, GROUND]
    enough = where_lt(zero, struck, fill(EXACT * EXACT), fill(ROUGH * ROUGH))
    load = zero
    for k in range(world.active[g, 2 * tree.slot_count]):
        load = max(load, world.impulse[g, world.active[g, 2 * k]].x)
    bar = fill(1.0e30)
    last = bar
    theta = zero
    longest = fill(LONGEST)
    count = int(0)
    while any_lt(zero, going):
        did = sweep(tree, world, g, going, hard)
        count = count + 1
        if count == 1:
            hard_hit = where_lt(zero, load, zero, did.most)
            enough = where_lt(fill(HARD * HARD), hard_hit, fill(EXACT * EXACT), enough)
        going = where_lt(fill(FINE * FINE), did.most, going, zero)
        if count % tree.sweeps == 0:
            going = where_lt(enough, did.most, going, zero)
            going = where_lt(did.most, bar, going, zero)
            bar = where_lt(zero, struck, bar, 0.25 * did.most)  # half the change, or it leads nowhere
            if count == MOST * tree.sweeps:
                going = zero
        if count == 1:
            remember(tree, world, g)
        else:
            if any_lt(zero, going):
                # where the last way was too long, none now and shorter ones from now on
                too_long = did.most - 4.0 * last
                longest = where_lt(zero, too_long, 0.25 * abs(theta), longest)
                theta = neg(did.across) / max(did.along, fill(1.0e-30))
                theta = max(fill(-0.5), min(theta, longest))
                theta = where_lt(zero, too_long, zero, theta)
                go_on(tree, world, g, where_lt(zero, going, theta, zero))
        last = did.most


@wp.func
def solve(tree: Tree, world: World, g: int):
    """w that moves the step: no slot overlaps at its end, or less than at its start."""
    if world.active[g, 2 * tree.slot_count] > 0:
        sweeps(tree, world, g, fill(1.0), 0)
        note_touches(tree, world, g)


@wp.func
def keep(tree: Tree, world: World, g: int) -> bool:
    """w that stays, and whether that is another than moved the step."""
    zero = fill(0.0)
    most = zero
    count = world.active[g, 2 * tree.slot_count]
    for k in range(count):
        slot = world.active[g, 2 * k]
        push = abs(world.goal[g, slot] - world.kept[g, slot])
        most = max(most, push - held(tree, world, g, slot))
    going = most - fill(HARMLESS)
    if not any_lt(zero, going):
        return False
    for k in range(count):
        slot = world.active[g, 2 * k]
        world.goal[g, slot] = where_lt(zero, going, world.kept[g, slot], world.goal[g, slot])
    sweeps(tree, world, g, going, 1)
    for k in range(count):
        slot = world.active[g, 2 * k]
        yields = where_lt(zero, going, held(tree, world, g, slot), zero)
        world.goal[g, slot] = world.goal[g, slot] + yields
    return True


@wp.func
def note_touches(tree: Tree, world: World, g: int):
    """Flag falls and bad contacts."""
    zero = fill(0.0)
    one = fill(1.0)
    for k in range(world.active[g, 2 * tree.slot_count]):
        slot = world.active[g, 2 * k]
        flag = tree.slot_flag[slot]
        if flag != 0:
            push = world.impulse[g, slot].x
            if flag == 1:
                world.fallen[g, 0] = where_lt(zero, push, one, world.fallen[g, 0])
            else:
                world.fumbled[g, 0] = where_lt(zero, push, one, world.fumbled[g, 0])
