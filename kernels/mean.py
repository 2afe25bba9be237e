"""Velocity-product forces at the mean of the velocities that a step starts and ends with.

At the start's alone they do work, and feed energy to whatever swings or tumbles undriven: a double pendulum
of plain hinges at 20 rad/s has thirteen times its energy after five seconds. At the mean the step of the
velocities, at one place, is its own inverse in time, as is the step of the place, at one velocity; so the
two in turn are conjugate to a symmetric method of second order, and energy swings but does not drift.

The mean is found by going through the step again until it stays, each link's factor being what it was.
"""

import warp as wp

from .articulated import factorize, judge_drives
from .kinematics import inertias
from .spatial import *
from .tree import Tree, World

MOST = wp.constant(8)
"""Times that a step is gone through again."""
SAME = wp.constant(1.0e-4)
"""Angular velocities that are no farther apart are the same [rad/s]."""


@wp.func
def middle(world: World, g: int, i: int) -> Motion:
    """Half way from V to where `judge_drives` has left the end of the step."""
    V = world.V[g, i]
    end = world.p[g, i]
    half = fill(0.5)
    return Motion(half * (V.w + end.n), half * (V.v + end.f))


@wp.func
def average(tree: Tree, world: World, g: int) -> bool:
    """Take the mean anew in the lanes where any link's has changed; whether there were any."""
    same = fill(SAME)
    worst = fill(0.0)
    for i in range(1, tree.link_count + 1):
        if tree.link_loose[i] != 0:
            worst = max(worst, norm(middle(world, g, i).w - world.mean[g, i].w))
    for i in range(1, tree.link_count + 1):
        if tree.link_loose[i] != 0:
            new = middle(world, g, i)
            old = world.mean[g, i]
            w = where_lt(same, worst, new.w, old.w)
            world.mean[g, i] = Motion(w, where_lt(same, worst, new.v, old.v))
    return any_lt(same, worst)


@wp.func
def even_out(tree: Tree, world: World, g: int):
    """After a step has been gone through with the velocities at its start: again with their mean."""
    for i in range(1, tree.link_count + 1):
        world.mean[g, i] = world.V[g, i]
    count = int(0)
    while count < MOST:
        count = count + 1
        if average(tree, world, g):
            inertias(tree, world, g, world.mean)
            factorize(tree, world, g)
            judge_drives(tree, world, g, False)
        else:
            count = MOST
