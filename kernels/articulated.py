"""The articulated-body factorisation: Mh = L^T D L in O(n), and velocities seen through it.

Mh = M + armature + h Kd + h^2 Kp is never formed. Going from the leaves to the root, each dof j takes
out of its link's articulated inertia I what it lets move freely (RBDA 7.3):

    U = I s,   D = s . U + load,   I <- I - U U^T / D.

U / D along the path to the root is row j of L: completing the square for every dof gives

    qd^T Mh qd = sum_j D_j (qd_j + U_j . V_j / D_j)^2,

V_j being the velocity of the link that the dofs before j alone would give. So `w = D^(1/2) L qd` is
velocity in coordinates where the mass matrix is the identity, and a force F on a link changes w by
D_j^(-1/2) s_j . F at each dof j, after which F - U_j / D_j (s_j . F) goes on towards the root. Contacts
are solved in these coordinates (see `contact`). `world.U` holds U D^(-1/2) and `world.d` D^(-1/2).
"""

import warp as wp

from .drive import Push, bound, damp, judge, load_along, pd, spring, stop
from .kinematics import load3, load4, store3
from .spatial import *
from .tree import BALL, FREE, GROUND, HINGE, Tree, World


@wp.struct
class Body:
    """What is left of a link while its dofs are taken out, last first."""

    I: Inertia
    p: Force
    V: Motion
    """velocity that the dofs still to come give"""


@wp.func
def take_out(
    world: World, g: int, j: int, b: Body, U: Force, D: Real, force: Real, v: Real, V: Motion, h: float
) -> Body:
    """Take dof j out of a body: U = I s, D its diagonal, `force` the net force along it, v its velocity,
    V what the dofs before it give."""
    d = 1.0 / sqrt(D)
    U = d * U
    e = d * force
    world.U[g, j] = U
    world.d[g, j] = d
    world.w[g, j] = v / d + dot(V, U) + h * e
    return Body(downdate(b.I, U), b.p + e * U, V)


@wp.func
def take_out_turn(
    world: World, g: int, j: int, b: Body, s: Vec3, v: Real, force: Real, load: Real, h: float
) -> Body:
    """Take out a rotation about s, driven with `force`, with `load` on its diagonal."""
    U = turn(b.I, s)
    V = Motion(b.V.w - v * s, b.V.v)
    world.s[g, j] = s
    return take_out(world, g, j, b, U, dot(s, U.n) + load, force - dot(s, b.p.n), v, V, h)


@wp.func
def take_out_shift(
    world: World, g: int, j: int, b: Body, s: Vec3, v: Real, force: Real, load: Real, h: float
) -> Body:
    """Take out a translation along s."""
    U = slide(b.I, s)
    V = Motion(b.V.w, b.V.v - v * s)
    world.s[g, j] = s
    return take_out(world, g, j, b, U, dot(s, U.f) + load, force - dot(s, b.p.f), v, V, h)


@wp.func
def free_joint(tree: Tree, world: World, g: int, i: int, b: Body) -> Body:
    h = tree.h
    j = tree.link_dof[i]
    iq = tree.link_q[i]
    R = world.R[g, i]
    v = load3(world.qd, g, j)
    w = load3(world.qd, g, j + 3)
    away = logarithm(conjugate(load4(world.q, g, iq + 3)) * load4(world.target, g, iq + 3))
    spin = damp(tree, j + 3, pd(tree, j + 3, fill(tree.dof_kp[j + 3]) * away, w), w)
    away = load3(world.target, g, iq) - load3(world.q, g, iq)
    push = damp(tree, j, pd(tree, j, fill(tree.dof_kp[j]) * away, v), v)
    f = spin.force + load3(world.joint_f, g, j + 3)
    b = take_out_turn(world, g, j + 5, b, column(R, 2), w.z, f.z, spin.load, h)
    b = take_out_turn(world, g, j + 4, b, column(R, 1), w.y, f.y, spin.load, h)
    b = take_out_turn(world, g, j + 3, b, column(R, 0), w.x, f.x, spin.load, h)
    f = push.force + load3(world.joint_f, g, j)
    b = take_out_shift(world, g, j + 2, b, unit3(2), v.z, f.z, push.load, h)
    b = take_out_shift(world, g, j + 1, b, unit3(1), v.y, f.y, push.load, h)
    b = take_out_shift(world, g, j, b, unit3(0), v.x, f.x, push.load, h)
    return b


@wp.func
def sprung(tree: Tree, iq: int) -> Quat:
    """Rest orientation of a ball joint's passive spring."""
    q = tree.q_spring
    return Quat(fill(q[iq]), fill(q[iq + 1]), fill(q[iq + 2]), fill(q[iq + 3]))


@wp.func
def ball_joint(tree: Tree, world: World, g: int, i: int, b: Body) -> Body:
    h = tree.h
    j = tree.link_dof[i]
    iq = tree.link_q[i]
    q = load4(world.q, g, iq)
    R = world.R[g, i]
    v = load3(world.qd, g, j)
    pull = fill(tree.dof_kp[j]) * logarithm(conjugate(q) * load4(world.target, g, iq))
    world.pull[g, i] = pull
    servo = pd(tree, j, pull, v)
    drive = servo
    zero = fill(0.0)
    half = fill(0.5)
    n = zero3()
    full = world.full[g, i]
    if any_lt(half, full):
        asked = world.asked[g, i]
        drive = bound(servo, tree.link_effort[i], full, asked)
        n = where_lt(half, full, (1.0 / max(norm(asked), fill(1.0e-20))) * asked, n)
    dropped = servo.load - drive.load
    drive = damp(tree, j, drive, v)
    if tree.link_sprung[i] != 0:
        drive = spring(tree, j, drive, logarithm(conjugate(q) * sprung(tree, iq)), v)
    halt = Push(zero, zero)
    if tree.link_limited[i] != 0:
        if any_lt(abs(q.w), fill(tree.link_near[i])):
            turned = logarithm(q)
            angle = norm(turned)
            axis = (1.0 / max(angle, fill(1.0e-6))) * turned
            s = R * axis
            weight = dot(s, b.I.A * s) + drive.load + dropped
            halt = stop(tree, tree.link_upper[i] - angle, dot(axis, v), weight)
            n = where_lt(zero, halt.load, axis, n)
    # Any three orthogonal axes will do for a ball joint's motion: the link's own, or n and two more. n is, at
    # the joint's limit, the axis it has turned about, else, at the drive's limit, its torque's. At both, what
    # the drive couples of the three is left to the velocity at the step's start.
    sx = column(R, 0)
    sy = column(R, 1)
    sz = column(R, 2)
    kx = drive.load
    ky = drive.load
    kz = drive.load
    own = dot(n, n)
    if any_lt(half, own):
        axes = frame(n)
        sx = where_lt(half, own, R * row(axes, 0), sx)
        sy = where_lt(half, own, R * row(axes, 1), sy)
        sz = where_lt(half, own, R * row(axes, 2), sz)
        kx = load_along(drive, row(axes, 0)) + halt.load
        ky = load_along(drive, row(axes, 1))
        kz = load_along(drive, row(axes, 2))
    w = R * v
    f = R * (drive.force + load3(world.joint_f, g, j))  # along the link's axes, whatever those of the motion
    b = take_out_turn(world, g, j + 2, b, sz, dot(sz, w), dot(sz, f), kz, h)
    b = take_out_turn(world, g, j + 1, b, sy, dot(sy, w), dot(sy, f), ky, h)
    b = take_out_turn(world, g, j, b, sx, dot(sx, w), dot(sx, f) + halt.force, kx, h)
    return b


@wp.func
def hinge_joint(tree: Tree, world: World, g: int, i: int, b: Body) -> Body:
    j = tree.link_dof[i]
    iq = tree.link_q[i]
    q = world.q[g, iq]
    v = world.qd[g, j]
    s = rotate(world.R[g, i], tree.link_axis[i])
    pull = tree.dof_kp[j] * (world.target[g, iq] - q)
    world.pull[g, i] = Vec3(pull, fill(0.0), fill(0.0))
    servo = pd(tree, j, pull, v)
    drive = bound(servo, tree.link_effort[i], world.full[g, i], world.asked[g, i].x)
    dropped = servo.load - drive.load
    drive = damp(tree, j, drive, v)
    if tree.link_sprung[i] != 0:
        drive = spring(tree, j, drive, tree.q_spring[iq] - q, v)
    if tree.link_limited[i] != 0:
        weight = dot(s, b.I.A * s) + drive.load + dropped
        upper = stop(tree, tree.link_upper[i] - q, v, weight)
        lower = stop(tree, q - tree.link_lower[i], neg(v), weight)
        drive = Push(drive.force + upper.force - lower.force, drive.load + upper.load + lower.load)
    return take_out_turn(world, g, j, b, s, v, drive.force + world.joint_f[g, j], drive.load, tree.h)


@wp.func
def factorize(tree: Tree, world: World, g: int):
    """Leaves to root: drives, the factor (s, U, d) and w, the velocity that the step's smooth forces
    lead to. Consumes I and p."""
    for k in range(tree.link_count):
        i = tree.link_count - k
        joint = tree.link_joint[i]
        parent = tree.link_parent[i]
        b = Body(world.I[g, i], world.p[g, i], world.V[g, i])
        if joint == HINGE:
            b = hinge_joint(tree, world, g, i, b)
        elif joint == BALL:
            b = ball_joint(tree, world, g, i, b)
        else:
            b = free_joint(tree, world, g, i, b)
        if parent != GROUND:
            r = world.r[g, i]
            world.I[g, parent] = world.I[g, parent] + shift_inertia(b.I, r)
            world.p[g, parent] = world.p[g, parent] + shift_force(b.p, r)


@wp.func
def rate(world: World, g: int, j: int, V: Motion) -> Real:
    """Velocity of dof j, V being what the dofs before it give its link: its row of qd = L^-1 D^(-1/2) w."""
    return world.d[g, j] * (world.w[g, j] - dot(V, world.U[g, j]))


@wp.func
def velocities(tree: Tree, world: World, g: int):
    """Root to leaves: qd = L^-1 D^(-1/2) w, and V. Joints turn no faster than tree.max_speed."""
    fast = world.hurried[g, 0]
    one = fill(1.0)
    top = fill(tree.max_speed)
    for i in range(1, tree.link_count + 1):
        joint = tree.link_joint[i]
        j = tree.link_dof[i]
        V = shift_motion(world.V[g, tree.link_parent[i]], world.r[g, i])
        if joint == HINGE:
            v = rate(world, g, j, V)
            fast = where_lt(top, abs(v), one, fast)
            v = max(neg(top), min(top, v))
            world.qd[g, j] = v
            V.w = V.w + v * world.s[g, j]
        else:
            if joint == FREE:
                for k in range(3):
                    v = rate(world, g, j, V)
                    world.qd[g, j] = v
                    V.v = V.v + v * world.s[g, j]
                    j = j + 1
            before = V.w
            for k in range(3):
                v = rate(world, g, j + k, V)
                V.w = V.w + v * world.s[g, j + k]
            turn_rate = V.w - before
            speed = norm(turn_rate)
            fast = where_lt(top, speed, one, fast)
            turn_rate = where_lt(top, speed, top / max(speed, one), one) * turn_rate
            V.w = before + turn_rate
            store3(world.qd, g, j, mul_t(world.R[g, i], turn_rate))
        world.V[g, i] = V
    world.hurried[g, 0] = fast


@wp.func
def judge_drives(tree: Tree, world: World, g: int, judged: bool) -> bool:
    """Root to leaves: the velocities that w stands for, and by them, where `judged`, which drives are at
    their limit. Whether any drive of any lane has changed. Uses p, which `factorize` has consumed, for V."""
    changed = fill(0.0)
    for i in range(1, tree.link_count + 1):
        joint = tree.link_joint[i]
        j = tree.link_dof[i]
        above = world.p[g, tree.link_parent[i]]
        V = shift_motion(Motion(above.n, above.f), world.r[g, i])
        if joint == HINGE:
            v = rate(world, g, j, V)
            V.w = V.w + v * world.s[g, j]
            if judged and tree.link_driven[i] != 0:
                end = Vec3(v, fill(0.0), fill(0.0))
                changed = changed + judge(tree, world, g, i, end)
        else:
            if joint == FREE:
                for k in range(3):
                    v = rate(world, g, j, V)
                    V.v = V.v + v * world.s[g, j]
                    j = j + 1
            before = V.w
            for k in range(3):
                v = rate(world, g, j + k, V)
                V.w = V.w + v * world.s[g, j + k]
            if judged and tree.link_driven[i] != 0:
                end = mul_t(world.R[g, i], V.w - before)
                changed = changed + judge(tree, world, g, i, end)
        world.p[g, i] = Force(V.w, V.v)
    return any_lt(fill(0.5), changed)
