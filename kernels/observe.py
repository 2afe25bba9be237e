"""What a simulation shows of itself: bodies, contacts, the mass matrix and the bias force.

These kernels recompute what they need from joint_q and joint_qd, so they hold for the present state
whatever a step has left behind.
"""

import warp as wp

from .collide import probe
from .kinematics import inertias, joint_dofs, kinematics
from .loading import compiled
from .port import give
from .spatial import *
from .tree import BALL, GROUND, HINGE, Tree, World

wp.set_module_options(
    {"enable_backward": False, "max_unroll": 3, "cpu_compiler_flags": "-march=native -ffp-contract=fast"}
)


def load(device) -> None:
    """Compile the kernels now; to be done before threads launch them."""
    compiled(__name__, device)


@wp.kernel
def bodies(
    tree: Tree, world: World, first: int, pose: wp.array2d(dtype=float), velocity: wp.array2d(dtype=float)
):
    """pose: 7 per body, position [m] and quaternion xyzw of its frame; velocity: 6 per body, of its
    centre of mass [m/s] and angular [rad/s], along the world's axes."""
    g = first + wp.tid()
    kinematics(tree, world, g)
    for b in range(tree.body_link.shape[0]):
        i = tree.body_link[b]
        R = world.R[g, i]
        V = world.V[g, i]
        x = world.pos[g, i] + rotate(R, tree.body_offset[b])
        q = world.turn[g, i] * quat(tree.body_turn[b])
        v = V.v + cross(V.w, rotate(R, tree.body_com[b]))
        give(pose, g, 7 * b, x.x)
        give(pose, g, 7 * b + 1, x.y)
        give(pose, g, 7 * b + 2, x.z)
        give(pose, g, 7 * b + 3, q.x)
        give(pose, g, 7 * b + 4, q.y)
        give(pose, g, 7 * b + 5, q.z)
        give(pose, g, 7 * b + 6, q.w)
        give(velocity, g, 6 * b, v.x)
        give(velocity, g, 6 * b + 1, v.y)
        give(velocity, g, 6 * b + 2, v.z)
        give(velocity, g, 6 * b + 3, V.w.x)
        give(velocity, g, 6 * b + 4, V.w.y)
        give(velocity, g, 6 * b + 5, V.w.z)


@wp.kernel
def gaps(tree: Tree, world: World, first: int):
    """Gap, point and normal of every slot."""
    g = first + wp.tid()
    kinematics(tree, world, g)
    for slot in range(tree.slot_count):
        touch = probe(tree, world, g, slot)
        world.gap[g, slot] = touch.gap
        world.point[g, slot] = touch.point
        world.normal[g, slot] = touch.normal


@wp.func
def axis(tree: Tree, world: World, g: int, i: int, k: int) -> Motion:
    """Motion axis of dof k of a link's joint."""
    R = world.R[g, i]
    zero = Vec3(fill(0.0), fill(0.0), fill(0.0))
    joint = tree.link_joint[i]
    if joint == HINGE:
        return Motion(rotate(R, tree.link_axis[i]), zero)
    if joint == BALL:
        return Motion(column(R, k), zero)
    if k < 3:
        return Motion(zero, unit3(k))
    return Motion(column(R, k - 3), zero)


@wp.kernel
def mass_matrix(tree: Tree, world: World, first: int, M: wp.array2d(dtype=Real)):
    """Joint-space inertia with armature, dof_count^2 numbers a world, by composite rigid bodies
    (RBDA table 6.2)."""
    g = first + wp.tid()
    n = tree.dof_count
    kinematics(tree, world, g)
    inertias(tree, world, g, world.V)
    for c in range(n * n):
        M[g, c] = fill(0.0)
    for c in range(tree.link_count):
        i = tree.link_count - c
        parent = tree.link_parent[i]
        I = world.I[g, i]
        if parent != GROUND:
            world.I[g, parent] = world.I[g, parent] + shift_inertia(I, world.r[g, i])
        for k in range(joint_dofs(tree, i)):
            j = tree.link_dof[i] + k
            F = I * axis(tree, world, g, i, k)
            a = int(i)
            while a != GROUND:
                for m in range(joint_dofs(tree, a)):
                    other = tree.link_dof[a] + m
                    value = dot(axis(tree, world, g, a, m), F)
                    if other <= j:
                        M[g, n * j + other] = value
                        M[g, n * other + j] = value
                F = shift_force(F, world.r[g, a])
                a = tree.link_parent[a]
            M[g, n * j + j] = M[g, n * j + j] + tree.dof_armature[j]


@wp.kernel
def bias_force(tree: Tree, world: World, first: int, C: wp.array2d(dtype=Real)):
    """Generalised force that holds the present velocity: Coriolis, centrifugal and gravity, by recursive
    Newton-Euler with no joint acceleration (RBDA table 5.1). External forces count in."""
    g = first + wp.tid()
    kinematics(tree, world, g)
    inertias(tree, world, g, world.V)
    for c in range(tree.link_count):
        i = tree.link_count - c
        p = world.p[g, i]
        for k in range(joint_dofs(tree, i)):
            C[g, tree.link_dof[i] + k] = dot(axis(tree, world, g, i, k), p)
        parent = tree.link_parent[i]
        if parent != GROUND:
            world.p[g, parent] = world.p[g, parent] + shift_force(p, world.r[g, i])
