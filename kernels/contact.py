"""Contacts in whitened coordinates: which there are, and what they answer to.

With w = D^(1/2) L qd (see `articulated`) a contact row J becomes y = D^(-1/2) L^(-T) J^T, which is zero
but for the dofs between the two bodies and the root. The row's velocity is y . w, an impulse changes w
by y times itself, and no row as wide as the character is ever formed. The three rows of a slot, its
normal and two tangents, are held side by side, as is everything here that comes in threes.
"""

import warp as wp

from .bounce import bounce
from .collide import Touch, probe
from .kinematics import joint_dofs, load3
from .rows import rows_change, rows_velocity
from .spatial import *
from .tree import FREE, HINGE, Tree, World

NEVER = wp.constant(-1.0e9)
"""Normal velocity [m/s] that every slot exceeds: the goal of a lane that does not touch."""
MARGIN = wp.constant(0.002)
"""Slots that may come this near within the step, in whichever direction their present velocity is
turned, take part [m]."""
PUSH_LIMIT = wp.constant(2.0)
"""Overlap is taken back no faster than this [m/s]."""


SOFT = wp.constant(1.0e-4)
"""Contacts of a larger cfm are springs, as soles are: what they push stays as velocity."""
REACH = wp.constant(0.3)
"""Nothing comes nearer than this within a step [m]; at h = 0.01 s, 30 m/s."""
HEAD = wp.constant(5)
"""Entries of a slot's response before those of its dofs: G and its inverse, a symmetric matrix each,
and what depends on it alone."""


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
def add(a: Wrenches, b: Wrenches) -> Wrenches:
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
def respond(tree: Tree, world: World, g: int, slot: int, at: int):
    """y of a slot's three rows, from world.y[at + HEAD] on, and before it what `settle` asks of the
    slot's own matrix G = y^T y."""
    axes = frame(world.normal[g, slot])
    point = world.point[g, slot]
    meet = tree.slot_meet[slot]
    k = at + HEAD
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
    a = zero3()  # nn, nt, ns
    b = zero3()  # tt, ts, ss
    for c in range(at + HEAD, k):
        y = world.y[g, c]
        a = a + y.x * y
        b = b + Vec3(y.y * y.y, y.y * y.z, y.z * y.z)
    world.y[g, at] = a
    world.y[g, at + 1] = b
    # the inverse, by cofactors, with the normal softened
    nn = a.x + tree.pair_cfm[tree.slot_pair[slot]] / tree.h
    cn = b.x * b.z - b.y * b.y
    ct = a.z * b.y - a.y * b.z
    cs = a.y * b.y - a.z * b.x
    scale = 1.0 / max(nn * cn + a.y * ct + a.z * cs, fill(1.0e-24))
    world.y[g, at + 2] = scale * Vec3(cn, ct, cs)
    world.y[g, at + 3] = scale * Vec3(nn * b.z - a.z * a.z, a.y * a.z - nn * b.y, nn * b.x - a.y * a.y)
    # the softened normal, and the longest stable step along a tangent: 1 / its larger eigenvalue
    skew = 0.5 * (b.x - b.z)
    stiff = 0.5 * (b.x + b.z) + sqrt(skew * skew + b.y * b.y)
    world.y[g, at + 4] = Vec3(nn, 1.0 / max(stiff, fill(1.0e-12)), stiff)


@wp.func
def parting(tree: Tree, world: World, g: int, slot: int, point: Vec3) -> Vec3:
    """Velocity [m/s] of b relative to a at the start of the step."""
    a = tree.slot_link_a[slot]
    b = tree.slot_link_b[slot]
    Va = world.V[g, a]
    Vb = world.V[g, b]
    va = Va.v + cross(Va.w, point - world.pos[g, a])
    vb = Vb.v + cross(Vb.w, point - world.pos[g, b])
    return vb - va


@wp.func
def add_impulse(tree: Tree, world: World, g: int, slot: int, at: int, change: Vec3):
    rows_change(
        world.y,
        world.w,
        tree.response_dof,
        g,
        at + HEAD,
        tree.slot_dof[slot],
        tree.slot_length[slot],
        change,
    )


@wp.func
def wish(tree: Tree, slot: int, gap: Real) -> Real:
    """Least normal velocity [m/s] of a slot within the step: what closes the gap, or takes back some of an
    overlap."""
    close = (-1.0 / tree.h) * gap
    return where_lt(fill(0.0), gap, close, min(tree.pair_erp[tree.slot_pair[slot]] * close, fill(PUSH_LIMIT)))


@wp.func
def enlist(tree: Tree, world: World, g: int, slot: int, touch: Touch, near: Real, goal: Real):
    """Take a slot into the solve for the lanes where `near` is within the margin."""
    last = 2 * tree.slot_count
    n = world.active[g, last]
    at = world.active[g, last + 1]
    end = at + tree.slot_length[slot] + HEAD
    if end > tree.response_room:
        at = tree.response_room
        end = world.active[g, last + 1]
    margin = fill(MARGIN)
    impulse = where_lt(near, margin, world.impulse[g, slot], zero3())
    goal = where_lt(near, margin, goal, fill(NEVER))
    world.point[g, slot] = touch.point
    world.normal[g, slot] = touch.normal
    world.goal[g, slot] = goal
    world.kept[g, slot] = min(goal, fill(0.0))
    if tree.pair_cfm[tree.slot_pair[slot]] > SOFT:
        world.kept[g, slot] = goal
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
    for b in range(tree.flyer_count):
        world.touched[g, tree.flyer_link[b]] = far
    for t in range(tree.tumbler_count):
        world.touched[g, tree.tumbler_link[t]] = far
    for slot in range(tree.slot_count):
        if tree.slot_flight[slot] == 0:
            touch = probe(tree, world, g, slot)
            near = touch.gap
            v = zero3()
            if any_lt(near, fill(REACH)):
                v = parting(tree, world, g, slot, touch.point)
                near = touch.gap - tree.h * norm(v)
            world.gap[g, slot] = touch.gap
            if any_lt(near, margin):
                a = tree.slot_link_a[slot]
                b = tree.slot_link_b[slot]
                world.touched[g, a] = min(world.touched[g, a], near)
                world.touched[g, b] = min(world.touched[g, b], near)
                enlist(tree, world, g, slot, touch, near, wish(tree, slot, touch.gap))
            else:
                world.impulse[g, slot] = zero3()
    for b in range(tree.flyer_count):
        i = tree.flyer_link[b]
        free = world.touched[g, i] - margin
        more = bounce(tree, world, g, b, free)
        shift = load3(world.q, g, tree.link_q[i]) - world.pos[g, i]
        for f in range(tree.flyer_flight[b], tree.flyer_flight[b + 1]):
            slot = tree.flight_slot[f]
            touch = probe(tree, world, g, slot)
            v = parting(tree, world, g, slot, touch.point)
            near = touch.gap - tree.h * norm(v)
            world.gap[g, slot] = touch.gap
            if any_lt(near, margin):
                near = where_lt(fill(0.0), (1.0 - more) * world.knock[g, f], far, near)
                gap = touch.gap + dot(touch.normal, shift)
                goal = wish(tree, slot, gap)
                enlist(tree, world, g, slot, touch, near, goal)
            else:
                world.impulse[g, slot] = zero3()


@wp.func
def velocity(tree: Tree, world: World, g: int, slot: int, at: int) -> Vec3:
    """Velocity in a slot as things stand [m/s]."""
    return rows_velocity(
        world.y,
        world.w,
        tree.response_dof,
        g,
        at + HEAD,
        tree.slot_dof[slot],
        tree.slot_length[slot],
    )


@wp.func
def drop_impulses(tree: Tree, world: World, g: int):
    """As if nothing had been solved."""
    for k in range(world.active[g, 2 * tree.slot_count]):
        slot = world.active[g, 2 * k]
        at = world.active[g, 2 * k + 1]
        if at == tree.response_room:
            respond(tree, world, g, slot, at)
        add_impulse(tree, world, g, slot, at, neg(world.impulse[g, slot]))
        world.impulse[g, slot] = zero3()
