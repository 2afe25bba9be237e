"""Stable PD drives, passive springs and joint limits, all implicit in the step.

A drive pulls with kp (target - q - h v+) - kd v+, v+ being the velocity at the end of the step (Tan,
Liu and Turk 2011). What multiplies v+ goes on the diagonal of the mass matrix, so the same matrix
answers for drives and contacts.

A drive whose torque would exceed its effort limit pushes with just that limit, and what it had on the
diagonal is dropped. Whether it would is judged by the end of the step, contacts apart, and the step's
velocities are found anew with it at its limit: a finger, or the pelvis between two hips and a back, is
too light to be judged by the torque at the start, and would be thrown from one limit to the other.
"""

import warp as wp

from .spatial import *
from .tree import Tree, World

# A joint past its limit, or about to be, gets a spring and damper this many times as stiff as the
# joint is heavy; they would take LIMIT_ERP of the excess away within a step.
LIMIT_WEIGHT = wp.constant(50.0)
LIMIT_ERP = wp.constant(0.2)


LAST_TRIAL = wp.constant(3)
"""After this many trials a drive may only come off its limit."""


@wp.struct
class Drive:
    """Torque of a ball joint, link axes."""

    force: Vec3
    """at the velocity of the step's start [N m]"""
    load: Real
    """what the diagonal of the mass matrix gains for each axis [kg m^2]"""


@wp.struct
class Push:
    """The same of a single dof."""

    force: Real
    load: Real


@wp.func
def pd(tree: Tree, k: int, pull: Vec3, v: Vec3, full: Real, torque: Vec3) -> Drive:
    """Drive, armature and damping of three dofs from k on: `pull` is kp (target - q), `v` their velocity;
    in the lanes where `full` is 1 the drive is at its limit and gives `torque`."""
    h = tree.h
    b = tree.dof_kd[k] + h * tree.dof_kp[k]
    damping = tree.dof_damping[k]
    half = fill(0.5)
    f = where_lt(half, full, torque, pull - fill(b) * v)
    load = where_lt(half, full, fill(0.0), fill(h * b))
    return Drive(f - fill(damping) * v, load + (tree.dof_armature[k] + h * damping))


@wp.func
def pd(tree: Tree, k: int, pull: Real, v: Real, full: Real, torque: Real) -> Push:
    """The same for one dof."""
    h = tree.h
    b = tree.dof_kd[k] + h * tree.dof_kp[k]
    damping = tree.dof_damping[k]
    half = fill(0.5)
    f = where_lt(half, full, torque, pull - b * v)
    load = where_lt(half, full, fill(0.0), fill(h * b))
    return Push(f - damping * v, load + (tree.dof_armature[k] + h * damping))


@wp.func
def judge(tree: Tree, world: World, g: int, i: int, v: Vec3, trial: int) -> Real:
    """Put the drive of link i at its limit, or take it off, by the torque that it would end the step
    with, v being the joint's velocity then; returns 1 where that is a change, else 0."""
    k = tree.link_dof[i]
    b = tree.dof_kd[k] + tree.h * tree.dof_kp[k]
    limit = fill(tree.link_effort[i])
    zero = fill(0.0)
    one = fill(1.0)
    half = fill(0.5)
    end = world.pull[g, i] - fill(b) * v
    length = norm(end)
    was = world.full[g, i]
    # at the limit a drive stays while it would still pull the same way, and more
    stays = where_lt(zero, dot(end, world.torque[g, i]), one, zero)
    now = where_lt(limit, length, where_lt(half, was, stays, one), zero)
    if trial == LAST_TRIAL:
        now = min(now, was)
    turns = where_lt(half, now, where_lt(was, half, one, zero), zero)
    aim = (limit / max(length, fill(1.0e-20))) * end
    world.torque[g, i] = where_lt(zero, turns, aim, world.torque[g, i])
    world.full[g, i] = now
    return abs(now - was)


@wp.func
def spring(tree: Tree, k: int, d: Drive, error: Vec3, v: Vec3) -> Drive:
    """d with the joint's passive spring added."""
    h = tree.h
    c = tree.dof_stiffness[k]
    return Drive(d.force + fill(c) * error - fill(h * c) * v, d.load + h * h * c)


@wp.func
def spring(tree: Tree, k: int, d: Push, error: Real, v: Real) -> Push:
    h = tree.h
    c = tree.dof_stiffness[k]
    return Push(d.force + c * (error - h * v), d.load + h * h * c)


@wp.func
def stop(tree: Tree, room: Real, v: Real, weight: Real) -> Push:
    """Push against a limit `room` away (negative: past it) that is approached with `v`; `weight` is
    the joint's articulated inertia. Nothing where the limit is not reached within the step."""
    h = tree.h
    load = LIMIT_WEIGHT * weight
    past = min(room, fill(0.0))
    # short of it: v+ = room / h; past it: v+ = LIMIT_ERP room / h
    f = (1.0 / (h * h)) * load * (LIMIT_ERP * past + (room - past) - h * v)
    over = h * v - room
    zero = fill(0.0)
    return Push(where_lt(zero, over, f, zero), where_lt(zero, over, load, zero))
