"""Stable PD drives, passive springs and joint limits, all implicit in the step.

A drive pulls with kp (target - q - h v+) - kd v+, v+ being the velocity at the end of the step (Tan,
Liu and Turk 2011). What multiplies v+ goes on the diagonal of the mass matrix, so the same matrix
answers for drives and contacts. A drive at its effort limit pushes with just that, and what it had on
the diagonal is dropped.
"""

import warp as wp

from .lanes import Real, add, div, fill, least, most, mul, neg, size, sub, where_lt
from .spatial import Vec3, add, mul, norm, sub, where_lt
from .tree import Tree

# A joint past its limit, or about to be, gets a spring and damper this many times as stiff as the
# joint is heavy; they would take LIMIT_ERP of the excess away within a step.
LIMIT_WEIGHT = wp.constant(50.0)
LIMIT_ERP = wp.constant(0.2)


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
def pd(tree: Tree, k: int, error: Vec3, v: Vec3, effort: float) -> Drive:
    """Drive, armature and damping of three dofs from k on: `error` is target - q, `v` their velocity.
    The effort limit holds for the length of the torque."""
    h = tree.h
    kp = tree.dof_kp[k]
    kd = tree.dof_kd[k]
    f = fill(kp) * error - fill(kd + h * kp) * v
    pull = norm(f)
    limit = fill(effort)
    f = where_lt(limit, pull, limit / most(pull, fill(1.0e-20)), fill(1.0)) * f
    load = where_lt(limit, pull, fill(0.0), fill(h * (kd + h * kp)))
    damping = tree.dof_damping[k]
    return Drive(f - fill(damping) * v, load + (tree.dof_armature[k] + h * damping))


@wp.func
def pd(tree: Tree, k: int, error: Real, v: Real, effort: float) -> Push:  # noqa: F811
    """The same for one dof."""
    h = tree.h
    kp = tree.dof_kp[k]
    kd = tree.dof_kd[k]
    f = kp * error - (kd + h * kp) * v
    pull = size(f)
    limit = fill(effort)
    f = where_lt(limit, pull, where_lt(f, fill(0.0), neg(limit), limit), f)
    load = where_lt(limit, pull, fill(0.0), fill(h * (kd + h * kp)))
    damping = tree.dof_damping[k]
    return Push(f - damping * v, load + (tree.dof_armature[k] + h * damping))


@wp.func
def spring(tree: Tree, k: int, d: Drive, error: Vec3, v: Vec3) -> Drive:
    """d with the joint's passive spring added."""
    h = tree.h
    c = tree.dof_stiffness[k]
    return Drive(d.force + fill(c) * error - fill(h * c) * v, d.load + h * h * c)


@wp.func
def spring(tree: Tree, k: int, d: Push, error: Real, v: Real) -> Push:  # noqa: F811
    h = tree.h
    c = tree.dof_stiffness[k]
    return Push(d.force + c * (error - h * v), d.load + h * h * c)


@wp.func
def stop(tree: Tree, room: Real, v: Real, weight: Real) -> Push:
    """Push against a limit `room` away (negative: past it) that is approached with `v`; `weight` is
    the joint's articulated inertia. Nothing where the limit is not reached within the step."""
    h = tree.h
    load = LIMIT_WEIGHT * weight
    past = least(room, fill(0.0))
    # short of it: v+ = room / h; past it: v+ = LIMIT_ERP room / h
    f = (1.0 / (h * h)) * load * (LIMIT_ERP * past + (room - past) - h * v)
    over = h * v - room
    zero = fill(0.0)
    return Push(where_lt(zero, over, f, zero), where_lt(zero, over, load, zero))
