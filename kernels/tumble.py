"""A free body without children that turns over and over: Euler's equations by an implicit midpoint.

An explicit w x I w feeds energy to it, some h w^2 of it a second. Here, in the body's axes, about its centre
of mass,

    I (w+ - w) = -k m x I m,    m = (w + w+) / 2,    R+ = R exp(h m),    k = 2 tan(h |m| / 2) / |m|,

of which w . I w is kept, since m x I m does no work along m, and R I w, since Cayley's map of k m is the
exponential of h m. The centre of mass goes on as it went. Forces have acted before: w is what they lead to.

Semi-implicit Euler turns by h w+, and moves the origin by h v+; what that is too much is kept as `lag`. A
body that may touch something has none, so that it goes where the contacts expect it.
"""

import warp as wp

from .spatial import *
from .tree import Tree, World

NEWTON = wp.constant(5)
"""Steps of Newton's method; at h |m| = 0.4 three leave less than rounding does."""
FASTEST = wp.constant(1.2)
"""h |m| / 2 beyond which k does not grow [rad]."""


@wp.func
def times(J: wp.mat33, a: Vec3) -> Vec3:
    return Vec3(
        J[0, 0] * a.x + J[0, 1] * a.y + J[0, 2] * a.z,
        J[1, 0] * a.x + J[1, 1] * a.y + J[1, 2] * a.z,
        J[2, 0] * a.x + J[2, 1] * a.y + J[2, 2] * a.z,
    )


@wp.func
def slope(J: wp.mat33, m: Vec3, Jm: Vec3, k: Real, i: int) -> Vec3:
    """Column i of the derivative of J m + k m x J m."""
    c = Vec3(fill(J[0, i]), fill(J[1, i]), fill(J[2, i]))
    return c + k * (cross(m, c) - cross(Jm, unit3(i)))


@wp.func
def mean_spin(J: wp.mat33, w: Vec3, h: float) -> Vec3:
    """m of the step from w, body axes: J (m - w) + k / 2 m x J m = 0."""
    m = w
    for _trial in range(NEWTON):
        y = min(0.5 * h * norm(m), fill(FASTEST))
        turn = sin_cos(y)
        k = where_lt(y, fill(1.0e-3), fill(0.5 * h), (0.5 * h) * turn.sin / max(y * turn.cos, fill(1.0e-9)))
        Jm = times(J, m)
        f = times(J, m - w) + k * cross(m, Jm)
        a = slope(J, m, Jm, k, 0)
        b = slope(J, m, Jm, k, 1)
        c = slope(J, m, Jm, k, 2)
        bc = cross(b, c)
        scale = 1.0 / dot(a, bc)
        m = m - scale * Vec3(dot(f, bc), dot(a, cross(f, c)), dot(a, cross(b, f)))
    # the mean of two of the same energy has less; else Newton went astray
    return where_lt(dot(m, times(J, m)), 1.01 * dot(w, times(J, w)), m, w)


@wp.func
def free_motion(world: World, g: int, j: int) -> Motion:
    """Velocity that w stands for, of a free link with dofs from j on."""
    V = Motion(zero3(), zero3())
    for c in range(3):
        V.v = V.v + (world.d[g, j + c] * (world.w[g, j + c] - dot(V, world.U[g, j + c]))) * world.s[g, j + c]
    for c in range(3):
        k = j + 3 + c
        V.w = V.w + (world.d[g, k] * (world.w[g, k] - dot(V, world.U[g, k]))) * world.s[g, k]
    return V


@wp.func
def push(world: World, g: int, j: int, F: Force):
    """Give a free link with dofs from j on an impulse, about its origin."""
    for c in range(3):
        k = j + 5 - c
        y = world.d[g, k] * dot(world.s[g, k], F.n)
        world.w[g, k] = world.w[g, k] + y
        F = F - y * world.U[g, k]
    for c in range(3):
        k = j + 2 - c
        y = world.d[g, k] * dot(world.s[g, k], F.f)
        world.w[g, k] = world.w[g, k] + y
        F = F - y * world.U[g, k]


@wp.func
def tumble(tree: Tree, world: World, g: int):
    """In the place of each tumbler's explicit velocity-product force, which w has."""
    h = tree.h
    for t in range(tree.tumbler_count):
        i = tree.tumbler_link[t]
        j = tree.link_dof[i]
        R = world.R[g, i]
        I = world.I[g, i]
        w = world.V[g, i].w
        com = rotate(R, tree.link_com[i])
        f = (world.mass_scale[g, i] * tree.link_mass[i]) * cross(w, cross(w, com))
        push(world, g, j, fill(h) * Force(cross(w, I.A * w), f))

        V = free_motion(world, g, j)
        w = mul_t(R, V.w)
        m = mean_spin(tree.tumbler_inertia[t], w, h)
        turned = rotation(world.turn[g, i] * exponential(h * m))
        after = (2.0 * m) - w
        there = rotate(turned, tree.link_com[i])
        speed = V.v + cross(V.w, com)
        v = speed - cross(turned * after, there)
        push(world, g, j, I * Motion(R * after - V.w, v - V.v))
        world.lag[g, t] = Motion(after - m, com - there + h * (speed - v))
