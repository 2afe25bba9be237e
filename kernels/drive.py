"""Stable PD drives, passive springs and joint limits, all implicit in the step.

A drive pulls with kp (target - q - h v+) - kd v+, v+ being the velocity at the end of the step (Tan,
Liu and Turk 2011). What multiplies v+ goes on the diagonal of the mass matrix, so the same matrix
answers for drives and contacts.

The torque that a drive gives is the nearest to that within its effort limit L: on a ball joint, L times its
direction. Both are meant at the end of the step, contacts apart, so torques and velocities are found
together, by Newton's method. A drive that would end the step with a, and |a| > L, is put at its limit and
taken for L n + L / |a| (1 - n n^T) (what it asks for), n = a / |a|; velocities are found anew, until no drive
changes. So along its torque a drive at its limit is dropped from the mass matrix, and across it a softer one
stays: a torque whose direction were the last trial's would throw a light link from side to side. All torques
are the one minimum of a convex function, so the search may start where the last step's has ended.
"""

import warp as wp

from .spatial import *
from .tree import Tree, World

# A joint past its limit, or about to be, gets a spring and damper this many times as stiff as the
# joint is heavy; they would take LIMIT_ERP of the excess away within a step.
LIMIT_WEIGHT = wp.constant(50.0)
LIMIT_ERP = wp.constant(0.2)

TRIALS = wp.constant(5)
"""Times that the velocities of a step are found, at most."""
SAME_WAY = wp.constant(0.99995)
"""Cosine of the angle, 0.01 rad, by which what a drive asks for may have turned since it was last looked at;
its torque is then right within 5e-5 in length."""


@wp.struct
class Drive:
    """Torque of a ball joint, link axes."""

    force: Vec3
    """at the velocity of the step's start [N m]"""
    load: Real
    """what the diagonal of the mass matrix gains for each axis [kg m^2]"""
    spared: Vec3
    """along the torque of a drive at its limit, else zero: an axis s gains (s . spared)^2 less"""


@wp.struct
class Push:
    """The same of a single dof."""

    force: Real
    load: Real


@wp.func
def pd(tree: Tree, k: int, pull: Vec3, v: Vec3) -> Drive:
    """Drive of three dofs from k on: `pull` is kp (target - q), `v` their velocity."""
    b = tree.dof_kd[k] + tree.h * tree.dof_kp[k]
    return Drive(pull - fill(b) * v, fill(tree.h * b), zero3())


@wp.func
def pd(tree: Tree, k: int, pull: Real, v: Real) -> Push:
    """The same for one dof."""
    b = tree.dof_kd[k] + tree.h * tree.dof_kp[k]
    return Push(pull - b * v, fill(tree.h * b))


@wp.func
def bound(d: Drive, limit: float, full: Real, asked: Vec3) -> Drive:
    """d, at its limit in the lanes where `full` is 1, linear about what it `asked` for."""
    half = fill(0.5)
    per = 1.0 / max(norm(asked), fill(1.0e-20))
    n = per * asked
    share = limit * per
    load = share * d.load
    force = fill(limit) * n + share * (d.force - dot(n, d.force) * n)
    return Drive(
        where_lt(half, full, force, d.force),
        where_lt(half, full, load, d.load),
        where_lt(half, full, sqrt(load) * n, zero3()),
    )


@wp.func
def bound(d: Push, limit: float, full: Real, asked: Real) -> Push:
    half = fill(0.5)
    zero = fill(0.0)
    force = where_lt(asked, zero, fill(-limit), fill(limit))
    return Push(where_lt(half, full, force, d.force), where_lt(half, full, zero, d.load))


@wp.func
def damp(tree: Tree, k: int, d: Drive, v: Vec3) -> Drive:
    """d with the joint's damping and armature."""
    c = tree.dof_damping[k]
    return Drive(d.force - fill(c) * v, d.load + (tree.dof_armature[k] + tree.h * c), d.spared)


@wp.func
def damp(tree: Tree, k: int, d: Push, v: Real) -> Push:
    c = tree.dof_damping[k]
    return Push(d.force - c * v, d.load + (tree.dof_armature[k] + tree.h * c))


@wp.func
def load_along(d: Drive, s: Vec3) -> Real:
    """What the diagonal of the mass matrix gains for the axis s, link axes."""
    c = dot(s, d.spared)
    return d.load - c * c


@wp.func
def judge(tree: Tree, world: World, g: int, i: int, v: Vec3) -> Real:
    """Put the drive of link i at its limit, or take it off, by what it asks for at the end of the step, v
    being the joint's velocity then; returns 1 where that is a change or it asks another way, else 0."""
    k = tree.link_dof[i]
    b = tree.dof_kd[k] + tree.h * tree.dof_kp[k]
    limit = fill(tree.link_effort[i])
    zero = fill(0.0)
    one = fill(1.0)
    half = fill(0.5)
    end = world.pull[g, i] - fill(b) * v
    length = norm(end)
    was = world.full[g, i]
    changed = zero
    if any_lt(half, was) or any_lt(limit, length):
        before = world.asked[g, i]
        along = dot(end, before)
        # it stays at its limit while it asks for more the same way
        stays = where_lt(zero, along, one, zero)
        now = where_lt(limit, length, where_lt(half, was, stays, one), zero)
        turned = where_lt(along, SAME_WAY * (length * norm(before)), now, zero)
        changed = max(turned, abs(now - was))
        # in lanes without a change velocities are to stay, so what was asked for has to
        world.asked[g, i] = where_lt(half, min(now, changed), end, before)
        world.full[g, i] = now
    return changed


@wp.func
def spring(tree: Tree, k: int, d: Drive, error: Vec3, v: Vec3) -> Drive:
    """d with the joint's passive spring added."""
    h = tree.h
    c = tree.dof_stiffness[k]
    return Drive(d.force + fill(c) * error - fill(h * c) * v, d.load + h * h * c, d.spared)


@wp.func
def spring(tree: Tree, k: int, d: Push, error: Real, v: Real) -> Push:
    h = tree.h
    c = tree.dof_stiffness[k]
    return Push(d.force + c * (error - h * v), d.load + h * h * c)


@wp.func
def stop(tree: Tree, room: Real, v: Real, weight: Real) -> Push:
    """Push against a limit `room` away (negative: past it) that is approached with `v`; `weight` is
    the joint's articulated inertia, its drive in full: one that depended on whether the drive is at its
    limit would decide that, and come to no end. Nothing where the limit is not reached within the step."""
    h = tree.h
    load = LIMIT_WEIGHT * weight
    past = min(room, fill(0.0))
    # short of it: v+ = room / h; past it: v+ = LIMIT_ERP room / h
    f = (1.0 / (h * h)) * load * (LIMIT_ERP * past + (room - past) - h * v)
    over = h * v - room
    zero = fill(0.0)
    return Push(where_lt(zero, over, f, zero), where_lt(zero, over, load, zero))
