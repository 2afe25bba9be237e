"""Contacts with friction, by projected Gauss-Seidel in whitened coordinates.

With w = D^(1/2) L qd (see `articulated`) a contact row J becomes y = D^(-1/2) L^(-T) J^T, which is zero
but for the dofs between the two bodies and the root. The row's velocity is y . w, an impulse changes w
by y times itself, and no row as wide as the character is ever formed. The three rows of a slot, its
normal and two tangents, are held side by side, as is everything here that comes in threes.
"""

import warp as wp

from .bounce import BOUNCE_SPEED, bounce
from .collide import Touch, probe
from .lanes import Real, add, any_lt, div, fill, least, most, mul, neg, root, size, sub, where_lt
from .spatial import (
    Force,
    Mat3,
    Sym3,
    Vec3,
    add,
    cross,
    dot,
    frame,
    mul,
    neg,
    row,
    sub,
    where_lt,
    zero3,
)
from .tree import BALL, FREE, HINGE, Tree, World

NEVER = wp.constant(-1.0e9)
"""Normal velocity [m/s] that every slot exceeds: the goal of a lane that does not touch."""
MARGIN = wp.constant(0.002)
"""Slots that would come this near within the step take part [m]."""
PUSH_LIMIT = wp.constant(2.0)
"""Overlap is taken back no faster than this [m/s]."""


@wp.struct
class Wrenches:
    """Three forces on a link, about its origin: component by component, a Vec3 over the three."""

    nx: Vec3
    ny: Vec3
    nz: Vec3
    fx: Vec3
    fy: Vec3
    fz: Vec3


@wp.func
def wrenches(axes: Mat3, at: Vec3, sign: float) -> Wrenches:
    """Unit forces along the rows of `axes` through the point `at` from the link's origin."""
    k = fill(sign)
    fx = k * Vec3(axes.xx, axes.yx, axes.zx)
    fy = k * Vec3(axes.xy, axes.yy, axes.zy)
    fz = k * Vec3(axes.xz, axes.yz, axes.zz)
    return Wrenches(
        at.y * fz - at.z * fy,
        at.z * fx - at.x * fz,
        at.x * fy - at.y * fx,
        fx,
        fy,
        fz,
    )


@wp.func
def add(a: Wrenches, b: Wrenches) -> Wrenches:  # noqa: F811
    return Wrenches(a.nx + b.nx, a.ny + b.ny, a.nz + b.nz, a.fx + b.fx, a.fy + b.fy, a.fz + b.fz)


@wp.func
def carry(F: Wrenches, r: Vec3) -> Wrenches:
    """About the parent's origin, r away."""
    return Wrenches(
        F.nx + r.y * F.fz - r.z * F.fy,
        F.ny + r.z * F.fx - r.x * F.fz,
        F.nz + r.x * F.fy - r.y * F.fx,
        F.fx,
        F.fy,
        F.fz,
    )


@wp.func
def pass_dof(F: Wrenches, U: Force, y: Vec3) -> Wrenches:
    """What is left of F for the dofs nearer the root."""
    return Wrenches(
        F.nx - U.n.x * y,
        F.ny - U.n.y * y,
        F.nz - U.n.z * y,
        F.fx - U.f.x * y,
        F.fy - U.f.y * y,
        F.fz - U.f.z * y,
    )


@wp.func
def pass_joint(tree: Tree, world: World, g: int, i: int, F: Wrenches, at: int) -> Wrenches:
    """Let F through the joint of link i: y of its dofs, last first, from `at` on."""
    joint = tree.link_joint[i]
    j = tree.link_dof[i]
    turns = 3
    if joint == HINGE:
        turns = 1
    if joint == FREE:
        j = j + 3
    for k in range(turns):
        dof = j + turns - 1 - k
        s = world.s[g, dof]
        y = world.d[g, dof] * (s.x * F.nx + s.y * F.ny + s.z * F.nz)
        world.y[g, at + k] = y
        F = pass_dof(F, world.U[g, dof], y)
    if joint == FREE:
        for k in range(3):
            dof = j - 1 - k
            s = world.s[g, dof]
            y = world.d[g, dof] * (s.x * F.fx + s.y * F.fy + s.z * F.fz)
            world.y[g, at + 3 + k] = y
            F = pass_dof(F, world.U[g, dof], y)
    return F


@wp.func
def joint_dofs(tree: Tree, i: int) -> int:
    joint = tree.link_joint[i]
    if joint == HINGE:
        return 1
    if joint == BALL:
        return 3
    return 6


@wp.func
def respond(tree: Tree, world: World, g: int, slot: int, at: int):
    """y of a slot's three rows, from world.y[at + 2] on, and its own matrix y^T y before it."""
    axes = frame(world.normal[g, slot])
    point = world.point[g, slot]
    meet = tree.slot_meet[slot]
    k = at + 2
    i = tree.slot_link_b[slot]
    F = wrenches(axes, point - world.pos[g, i], 1.0)
    while i != meet:
        F = carry(pass_joint(tree, world, g, i, F, k), world.r[g, i])
        k = k + joint_dofs(tree, i)
        i = tree.link_parent[i]
    i = tree.slot_link_a[slot]
    G = wrenches(axes, point - world.pos[g, i], -1.0)
    while i != meet:
        G = carry(pass_joint(tree, world, g, i, G, k), world.r[g, i])
        k = k + joint_dofs(tree, i)
        i = tree.link_parent[i]
    F = F + G
    while i != 0:
        F = carry(pass_joint(tree, world, g, i, F, k), world.r[g, i])
        k = k + joint_dofs(tree, i)
        i = tree.link_parent[i]
    a = zero3()  # nn, nt, nu
    b = zero3()  # tt, tu, uu
    for c in range(at + 2, k):
        y = world.y[g, c]
        a = a + y.x * y
        b = b + Vec3(y.y * y.y, y.y * y.z, y.z * y.z)
    world.y[g, at] = a
    world.y[g, at + 1] = b


@wp.func
def approach(tree: Tree, world: World, g: int, slot: int, point: Vec3, normal: Vec3) -> Real:
    """Normal velocity [m/s] of b away from a at the start of the step."""
    a = tree.slot_link_a[slot]
    b = tree.slot_link_b[slot]
    Va = world.V[g, a]
    Vb = world.V[g, b]
    va = Va.v + cross(Va.w, point - world.pos[g, a])
    vb = Vb.v + cross(Vb.w, point - world.pos[g, b])
    return dot(normal, vb - va)


@wp.func
def add_impulse(tree: Tree, world: World, g: int, slot: int, at: int, change: Vec3):
    first = tree.slot_dof[slot]
    for k in range(tree.slot_length[slot]):
        j = tree.response_dof[first + k]
        world.w[g, j] = world.w[g, j] + dot(world.y[g, at + 2 + k], change)


@wp.func
def wish(tree: Tree, world: World, g: int, slot: int, gap: Real, u: Real, lively: Real) -> Real:
    """Least normal velocity [m/s] to leave a slot with: what closes the gap, takes back some of an
    overlap, or, where `lively` is positive, returns the approach velocity u with restitution."""
    h = tree.h
    pair = tree.slot_pair[slot]
    zero = fill(0.0)
    close = (-1.0 / h) * gap
    goal = where_lt(zero, gap, close, least(tree.pair_erp[pair] * close, fill(PUSH_LIMIT)))
    back = where_lt(u, fill(-BOUNCE_SPEED), neg(world.restitution[g, pair] * u), goal)
    back = where_lt(gap + h * u, zero, back, goal)
    return where_lt(zero, lively, most(goal, back), goal)


@wp.func
def enlist(tree: Tree, world: World, g: int, slot: int, touch: Touch, near: Real, goal: Real):
    """Take a slot into the solve for the lanes where `near` is within the margin."""
    last = 2 * tree.slot_count
    n = world.active[g, last]
    at = world.active[g, last + 1]
    end = at + tree.slot_length[slot] + 2
    if end > tree.response_room:
        at = tree.response_room
        end = world.active[g, last + 1]
    margin = fill(MARGIN)
    impulse = where_lt(near, margin, world.impulse[g, slot], zero3())
    world.point[g, slot] = touch.point
    world.normal[g, slot] = touch.normal
    world.goal[g, slot] = where_lt(near, margin, goal, fill(NEVER))
    world.impulse[g, slot] = impulse
    world.active[g, 2 * n] = slot
    world.active[g, 2 * n + 1] = at
    world.active[g, last] = n + 1
    world.active[g, last + 1] = end
    respond(tree, world, g, slot, at)
    add_impulse(tree, world, g, slot, at, impulse)


@wp.func
def find(tree: Tree, world: World, g: int):
    """Which slots may touch within this step, what they want, and their responses. A ball in free
    flight bounces here."""
    margin = fill(MARGIN)
    far = fill(1.0)
    world.active[g, 2 * tree.slot_count] = 0
    world.active[g, 2 * tree.slot_count + 1] = 0
    for i in range(tree.flight_count):
        world.touched[g, tree.flight_link[i]] = far
    for slot in range(tree.slot_count):
        if tree.slot_flight[slot] == 0:
            touch = probe(tree, world, g, slot)
            u = approach(tree, world, g, slot, touch.point, touch.normal)
            near = least(touch.gap, touch.gap + tree.h * u)
            world.gap[g, slot] = touch.gap
            if any_lt(near, margin):
                a = tree.slot_link_a[slot]
                b = tree.slot_link_b[slot]
                world.touched[g, a] = least(world.touched[g, a], near)
                world.touched[g, b] = least(world.touched[g, b], near)
                goal = wish(tree, world, g, slot, touch.gap, u, far)
                enlist(tree, world, g, slot, touch, near, goal)
            else:
                world.impulse[g, slot] = zero3()
    for f in range(tree.flight_count):
        i = tree.flight_link[f]
        slot = tree.flight_slot[f]
        touch = probe(tree, world, g, slot)
        u = approach(tree, world, g, slot, touch.point, touch.normal)
        near = least(touch.gap, touch.gap + tree.h * u)
        free = world.touched[g, i] - margin
        world.gap[g, slot] = touch.gap
        world.knock[g, i] = fill(0.0)
        if any_lt(near, margin):
            hits = bounce(tree, world, g, i, slot, touch, free)
            near = where_lt(fill(0.0), hits, far, near)
            enlist(tree, world, g, slot, touch, near, wish(tree, world, g, slot, touch.gap, u, neg(free)))
        else:
            world.impulse[g, slot] = zero3()


@wp.func
def visit(tree: Tree, world: World, g: int, slot: int, at: int) -> Vec3:
    """The impulse that suits a slot as things stand: along the normal, then friction on the disc that
    this allows."""
    first = tree.slot_dof[slot]
    u = zero3()
    for k in range(tree.slot_length[slot]):
        u = u + world.w[g, tree.response_dof[first + k]] * world.y[g, at + 2 + k]
    a = world.y[g, at]
    b = world.y[g, at + 1]
    old = world.impulse[g, slot]
    pair = tree.slot_pair[slot]
    soft = tree.pair_cfm[pair] / tree.h
    n = most(fill(0.0), old.x - (u.x + soft * old.x - world.goal[g, slot]) / (a.x + soft))
    dn = n - old.x
    # a step as long as the stiffer tangent allows, and back onto the disc
    pace = 1.0 / most(stiffer(b), fill(1.0e-12))
    t = old.y - pace * (u.y + a.y * dn)
    s = old.z - pace * (u.z + a.z * dn)
    grip = world.friction[g, pair] * n
    pull = t * t + s * s
    back = where_lt(grip * grip, pull, grip / root(most(pull, fill(1.0e-24))), fill(1.0))
    return Vec3(n, back * t, back * s)


@wp.func
def stiffer(b: Vec3) -> Real:
    """The larger eigenvalue of the two tangents' matrix [[x, y], [y, z]]."""
    skew = 0.5 * (b.x - b.z)
    return 0.5 * (b.x + b.z) + root(skew * skew + b.y * b.y)


@wp.func
def residual(tree: Tree, world: World, g: int) -> Real:
    """Largest velocity [m/s] that one more visit would take from any slot."""
    worst = fill(0.0)
    for k in range(world.active[g, 2 * tree.slot_count]):
        slot = world.active[g, 2 * k]
        at = world.active[g, 2 * k + 1]
        if at == tree.response_room:
            respond(tree, world, g, slot, at)
        change = visit(tree, world, g, slot, at) - world.impulse[g, slot]
        pull = root(change.y * change.y + change.z * change.z)
        worst = most(worst, world.y[g, at].x * size(change.x))
        worst = most(worst, stiffer(world.y[g, at + 1]) * pull)
    return worst


@wp.func
def solve(tree: Tree, world: World, g: int):
    """Sweeps over the slots in use, forward and backward in turn."""
    count = world.active[g, 2 * tree.slot_count]
    for sweep in range(tree.sweeps):
        for k in range(count):
            c = k
            if sweep % 2 == 1:
                c = count - 1 - k
            slot = world.active[g, 2 * c]
            at = world.active[g, 2 * c + 1]
            if at == tree.response_room:
                respond(tree, world, g, slot, at)
            impulse = visit(tree, world, g, slot, at)
            add_impulse(tree, world, g, slot, at, impulse - world.impulse[g, slot])
            world.impulse[g, slot] = impulse
    zero = fill(0.0)
    one = fill(1.0)
    for k in range(count):
        slot = world.active[g, 2 * k]
        flag = tree.slot_flag[slot]
        if flag != 0:
            push = world.impulse[g, slot].x
            if flag == 1:
                world.fallen[g, 0] = where_lt(zero, push, one, world.fallen[g, 0])
            else:
                world.fumbled[g, 0] = where_lt(zero, push, one, world.fumbled[g, 0])
