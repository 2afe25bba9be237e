"""Poses and velocities of all links, their inertias and velocity-product forces (RBDA chapters 2-4)."""

import warp as wp

from .spatial import *
from .tree import BALL, FREE, GROUND, HINGE, Tree, World


@wp.func
def load3(a: wp.array2d(dtype=Real), g: int, i: int) -> Vec3:
    return Vec3(a[g, i], a[g, i + 1], a[g, i + 2])


@wp.func
def load4(a: wp.array2d(dtype=Real), g: int, i: int) -> Quat:
    return Quat(a[g, i], a[g, i + 1], a[g, i + 2], a[g, i + 3])


@wp.func
def store3(a: wp.array2d(dtype=Real), g: int, i: int, v: Vec3):
    a[g, i] = v.x
    a[g, i + 1] = v.y
    a[g, i + 2] = v.z


@wp.func
def store4(a: wp.array2d(dtype=Real), g: int, i: int, q: Quat):
    a[g, i] = q.x
    a[g, i + 1] = q.y
    a[g, i + 2] = q.z
    a[g, i + 3] = q.w


@wp.func
def joint_dofs(tree: Tree, i: int) -> int:
    joint = tree.link_joint[i]
    if joint == HINGE:
        return 1
    if joint == BALL:
        return 3
    return 6


@wp.func
def kinematics(tree: Tree, world: World, g: int):
    """turn, R, pos, r and V of every link from joint_q and joint_qd."""
    for i in range(1, tree.link_count + 1):
        parent = tree.link_parent[i]
        joint = tree.link_joint[i]
        iq = tree.link_q[i]
        iv = tree.link_dof[i]
        V = world.V[g, parent]
        if joint == FREE:
            turn = load4(world.q, g, iq + 3)
            R = rotation(turn)
            world.turn[g, i] = turn
            world.R[g, i] = R
            world.pos[g, i] = load3(world.q, g, iq)
            world.r[g, i] = zero3()
            world.V[g, i] = Motion(R * load3(world.qd, g, iv + 3), load3(world.qd, g, iv))
        else:
            r = rotate(world.R[g, parent], tree.link_offset[i])
            turn = world.turn[g, parent] * quat(tree.link_turn[i])
            if joint == BALL:
                turn = turn * load4(world.q, g, iq)
            else:
                turn = turn * about(tree.link_axis[i], world.q[g, iq] - tree.link_zero[i])
            R = rotation(turn)
            spin = zero3()
            if joint == BALL:
                spin = R * load3(world.qd, g, iv)
            else:
                spin = world.qd[g, iv] * rotate(R, tree.link_axis[i])
            world.turn[g, i] = turn
            world.R[g, i] = R
            world.pos[g, i] = world.pos[g, parent] + r
            world.r[g, i] = r
            world.V[g, i] = Motion(V.w + spin, V.v + cross(V.w, r))


@wp.func
def own_inertia(tree: Tree, world: World, g: int, i: int, com: Vec3) -> Inertia:
    """Of a link alone, about its origin; com: its centre of mass from there, along the world's axes."""
    k = world.mass_scale[g, i]
    J = tree.link_moments[i]
    P = tree.link_products[i]
    moments = Sym3(k * J[0], k * P[0], k * P[1], k * J[1], k * P[2], k * J[2])
    return rigid(world.R[g, i], k * tree.link_mass[i], com, moments)


@wp.func
def inertias(tree: Tree, world: World, g: int, V: wp.array2d(dtype=Motion)):
    """Each link's own inertia I; its acceleration A were no joint to accelerate; and the force p that
    A and its velocity V ask for [2.72, 5.3], less gravity, about the link's origin."""
    gravity = vec3(tree.gravity)
    for i in range(1, tree.link_count + 1):
        parent = tree.link_parent[i]
        R = world.R[g, i]
        r = world.r[g, i]
        w = V[g, i].w
        w0 = V[g, parent].w
        above = world.A[g, parent]
        A = Motion(above.w + cross(w0, w), above.v + cross(above.w, r) + cross(w0, cross(w0, r)))
        mass = world.mass_scale[g, i] * tree.link_mass[i]
        com = rotate(R, tree.link_com[i])
        I = own_inertia(tree, world, g, i, com)
        fall = A.v - gravity
        f = mass * (fall + cross(A.w, com) + cross(w, cross(w, com)))
        n = I.A * A.w + cross(w, I.A * w) + mass * cross(com, fall)
        world.A[g, i] = A
        world.I[g, i] = I
        world.p[g, i] = Force(n, f)
    if tree.forced != 0:
        for b in range(tree.body_link.shape[0]):
            i = tree.body_link[b]
            if i != GROUND:
                f = world.force[g, b]
                p = world.p[g, i]
                at = rotate(world.R[g, i], tree.body_com[b])
                world.p[g, i] = Force(p.n - cross(at, f), p.f - f)
