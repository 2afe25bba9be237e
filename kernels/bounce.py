"""A free ball over planes, its impacts solved within the step.

A restitution that only sees velocities at steps of 0.01 s loses or gains per cents of height at every
bounce. A ball that touches nothing but planes flies a parabola, so the time of impact is the root of
a quadratic and the bounce is exact. Semi-implicit Euler keeps its velocity half a step behind: the true
velocity at a step's start is v + a h / 2, which is what the parabola needs, and what the reflected
velocity is turned back from.

After an impact the ball moves as if it had come from elsewhere: from a place shifted by what a step with
the new velocity would leave out. So one impact is solved after the other, each plane in its turn.
"""

import warp as wp

from .collide import point_plane
from .kinematics import load3, store3
from .spatial import *
from .tree import Tree, World

BOUNCE_SPEED = wp.constant(0.1)
"""Slower impacts do not bounce [m/s]."""
IMPACTS = wp.constant(8)
"""A ball has no more in a step; what it would strike then, between walls that all but hold it, the solver
makes it stop at."""
NEWTON = wp.constant(8)
"""Steps of Newton's method for the friction of an uneven ball."""
LATE = wp.constant(1.0e9)
"""Time of an impact that does not come within the step."""


@wp.struct
class Way:
    """A ball's way in a step, as velocities at its start, half a step behind, or at its end."""

    v: Vec3
    a: Vec3
    """acceleration by what acts on it all along [m/s^2]"""
    spin: Vec3


@wp.struct
class Impact:
    time: Real
    """since the step's start [s]; LATE where there is none within the step"""
    gap: Real
    """at the step's start [m]"""
    normal: Vec3
    restitution: Real
    friction: Real
    flight: Real
    """the number of the flight slot"""


@wp.func
def nothing(time: float) -> Impact:
    zero = fill(0.0)
    return Impact(fill(time), zero, zero3(), zero, zero, fill(-1.0))


@wp.func
def earlier(a: Impact, b: Impact) -> Impact:
    """The earlier of two, the second where they come together."""
    t = a.time
    s = b.time
    return Impact(
        where_lt(t, s, a.time, b.time),
        where_lt(t, s, a.gap, b.gap),
        where_lt(t, s, a.normal, b.normal),
        where_lt(t, s, a.restitution, b.restitution),
        where_lt(t, s, a.friction, b.friction),
        where_lt(t, s, a.flight, b.flight),
    )


@wp.struct
class Fall:
    """The way down to a plane: gap + u t + an t^2 / 2 = 0."""

    u: Real
    an: Real
    inside: Real
    """what the root is taken of"""
    t: Real
    strike: Real
    """velocity along the normal at the impact [m/s]"""


@wp.func
def fall(way: Way, n: Vec3, gap: Real, h: float) -> Fall:
    an = dot(n, way.a)
    u = dot(n, way.v) + 0.5 * h * an
    inside = u * u - 2.0 * an * gap
    t = 2.0 * gap / max(sqrt(max(inside, fill(0.0))) - u, fill(1.0e-9))
    return Fall(u, an, inside, t, u + an * t)


@wp.func
def next_impact(tree: Tree, world: World, g: int, b: int, way: Way, shift: Vec3, last: Impact) -> Impact:
    """The next plane that flyer b strikes, after `last` and another one; its way starts `shift` from where
    the ball stood."""
    h = fill(tree.h)
    late = fill(LATE)
    zero = fill(0.0)
    best = nothing(LATE)
    for f in range(tree.flyer_flight[b], tree.flyer_flight[b + 1]):
        slot = tree.flight_slot[f]
        pair = tree.slot_pair[slot]
        touch = point_plane(tree, world, g, slot)
        n = touch.normal
        gap = max(touch.gap + dot(n, shift), zero)
        flight = fill(float(f))
        way_down = fall(way, n, gap, tree.h)
        t = way_down.t
        time = where_lt(t, h, where_lt(way_down.strike, fill(-BOUNCE_SPEED), t, late), late)
        time = where_lt(zero, way_down.inside, time, late)
        time = where_lt(time, last.time, late, time)
        time = where_lt(abs(flight - last.flight), fill(0.5), late, time)
        next = Impact(time, gap, n, world.restitution[g, pair], world.friction[g, pair], flight)
        best = earlier(next, best)
    return best


@wp.func
def ease(tree: Tree, b: int, R: Mat3, k: Real, a: Vec3) -> Vec3:
    """The spin that an angular momentum stands for: I^-1 a, the ball turned by R and its mass scaled by k."""
    c = tree.flyer_ease[b]
    x = mul_t(R, a)
    y = Vec3(
        c[0, 0] * x.x + c[0, 1] * x.y + c[0, 2] * x.z,
        c[1, 0] * x.x + c[1, 1] * x.y + c[1, 2] * x.z,
        c[2, 0] * x.x + c[2, 1] * x.y + c[2, 2] * x.z,
    )
    return (1.0 / k) * (R * y)


@wp.func
def rub(
    tree: Tree, b: int, R: Mat3, k: Real, n: Vec3, radius: float, mass: Real, slip: Vec3, grip: Real
) -> Vec3:
    """Friction of an impact whose surface answers to J with K J, K = 1 / m + [r]^T I^-1 [r], r = -radius n:
    what stops the slip, or, of as much as `grip`, what takes most of its energy. Its slip ends against
    it: (K + c) J = -slip, c >= 0 such that |J| = grip."""
    axes = frame(n)
    t = row(axes, 1)
    s = row(axes, 2)  # n x t = s, n x s = -t
    along = ease(tree, b, R, k, t)
    aside = ease(tree, b, R, k, s)
    own = 1.0 / mass
    tt = own + fill(radius * radius) * dot(s, aside)
    ss = own + fill(radius * radius) * dot(t, along)
    ts = neg(fill(radius * radius) * dot(s, along))
    y = dot(slip, t)
    z = dot(slip, s)
    c = fill(0.0)
    jt = fill(0.0)
    js = fill(0.0)
    length = fill(0.0)
    for _trial in range(NEWTON):  # Newton on 1 / |J|, which is concave in c
        one = 1.0 / ((tt + c) * (ss + c) - ts * ts)
        jt = one * ((ss + c) * y - ts * z)
        js = one * ((tt + c) * z - ts * y)
        square = jt * jt + js * js
        length = sqrt(square)
        bent = one * ((ss + c) * jt * jt - 2.0 * ts * jt * js + (tt + c) * js * js)
        over = max(length / max(grip, fill(1.0e-9)) - 1.0, fill(0.0))
        c = c + over * (square / max(bent, fill(1.0e-20)))
    most = min(grip / max(length, fill(1.0e-12)), fill(1.0))
    return neg(most) * (jt * t + js * s)


@wp.func
def set_spin(world: World, g: int, j: int, spin: Vec3, hits: Real):
    """Let w stand for an angular velocity; j: the first turning dof of a free body about its own centre."""
    before = zero3()
    for c in range(3):
        s = world.s[g, j + c]
        rate = dot(s, spin)
        w = rate / world.d[g, j + c] + dot(before, world.U[g, j + c].n)
        before = before + rate * s
        world.w[g, j + c] = where_lt(fill(0.0), hits, w, world.w[g, j + c])


@wp.func
def spin_of(world: World, g: int, j: int) -> Vec3:
    """The angular velocity that w stands for."""
    w = zero3()
    for c in range(3):
        rate = world.d[g, j + c] * (world.w[g, j + c] - dot(w, world.U[g, j + c].n))
        w = w + rate * world.s[g, j + c]
    return w


@wp.func
def impact(tree: Tree, world: World, g: int, b: int, way: Way, hit: Impact, hits: Real):
    """One impact, in the lanes where `hits` is 1."""
    h = tree.h
    i = tree.flyer_link[b]
    j = tree.link_dof[i]
    iq = tree.link_q[i]
    n = hit.normal
    down = fall(way, n, hit.gap, h)
    u = down.u
    an = down.an
    t = down.t
    strike = down.strike
    vt = way.v - dot(n, way.v) * n + 0.5 * h * (way.a - an * n)
    at = way.a - an * n

    # impact: restitution, and friction that at most stops the surface's slip
    e = hit.restitution
    radius = tree.slot_radius[tree.flight_slot[tree.flyer_flight[b]]]
    k = world.mass_scale[g, i]
    mass = k * tree.link_mass[i]
    slip = vt + t * at - radius * cross(way.spin, n)
    grip = hit.friction * (1.0 + e) * mass * neg(strike)
    zero = fill(0.0)
    J = zero3()
    if tree.flyer_even[b] != 0:
        moments = tree.link_moments[i]
        moment = k * moments[0]
        stick = 1.0 / (1.0 / mass + (radius * radius) / moment)
        wanted = stick * norm(slip)
        J = neg(where_lt(grip, wanted, grip / max(wanted, fill(1.0e-12)), fill(1.0)) * stick) * slip
        spin = way.spin - (radius / moment) * cross(n, J)
        for c in range(3):
            dof = j + 3 + c
            turned = dot(world.s[g, dof], spin) / world.d[g, dof]
            world.w[g, dof] = where_lt(zero, hits, turned, world.w[g, dof])
    else:
        R = rotation(world.turn[g, i] * exponential(t * mul_t(world.R[g, i], way.spin)))
        J = rub(tree, b, R, k, n, radius, mass, slip, grip)
        set_spin(world, g, j + 3, way.spin - radius * ease(tree, b, R, k, cross(n, J)), hits)
    vt_new = vt + t * at + (1.0 / mass) * J

    # rise for the rest of the step
    s = h - t
    up = neg(e * strike)
    normal_move = u * t + 0.5 * an * t * t + up * s + 0.5 * an * s * s
    move = normal_move * n + (t * vt + 0.5 * t * t * at + s * vt_new + 0.5 * s * s * at)
    v_new = (up + an * s - 0.5 * h * an) * n + vt_new + (s - 0.5 * h) * at

    shift = where_lt(zero, hits, move - fill(h) * v_new, zero3())
    store3(world.q, g, iq, load3(world.q, g, iq) + shift)
    old = load3(world.w, g, j)
    store3(world.w, g, j, where_lt(zero, hits, (1.0 / world.d[g, j]) * v_new, old))
    for f in range(tree.flyer_flight[b], tree.flyer_flight[b + 1]):
        here = where_lt(abs(hit.flight - float(f)), fill(0.5), hits, zero)
        knock = where_lt(zero, here, mass * (up - strike), zero)
        world.knock[g, f] = world.knock[g, f] + knock


@wp.func
def meet(tree: Tree, world: World, g: int, b: int, way: Way, shift: Vec3, last: Impact, free: Real) -> Impact:
    """The next impact in the lanes where `free` is positive, done; its time is LATE where there is none."""
    zero = fill(0.0)
    late = fill(LATE)
    hit = next_impact(tree, world, g, b, way, shift, last)
    hit.time = where_lt(zero, free, hit.time, late)
    hits = where_lt(hit.time, late, fill(1.0), zero)
    if any_lt(zero, hits):
        impact(tree, world, g, b, way, hit, hits)
    return hit


@wp.func
def bounce(tree: Tree, world: World, g: int, b: int, free: Real) -> Real:
    """Bounce flyer b off planes in the lanes where `free` is positive and it strikes within the step. Sets w
    and `knock`, and moves q by what a step with the new velocity would leave out. Returns 1 in lanes where
    it would go on to strike more, else 0."""
    h = tree.h
    i = tree.flyer_link[b]
    first = tree.flyer_flight[b]
    end = tree.flyer_flight[b + 1]
    j = tree.link_dof[i]
    iq = tree.link_q[i]
    d = world.d[g, j]
    v = world.V[g, i].v
    way = Way(v, (1.0 / h) * (d * load3(world.w, g, j) - v), world.V[g, i].w)
    if tree.flyer_even[b] == 0:
        way.spin = spin_of(world, g, j + 3)
    for f in range(first, end):
        world.knock[g, f] = fill(0.0)
    hit = nothing(0.0)
    if end - first == 1:
        hit = meet(tree, world, g, b, way, zero3(), hit, free)
        return fill(0.0)
    q = load3(world.q, g, iq)
    late = fill(LATE)
    count = int(0)
    while count < IMPACTS and any_lt(hit.time, late):
        count = count + 1
        hit = meet(tree, world, g, b, way, load3(world.q, g, iq) - q, hit, free)
        way.v = d * load3(world.w, g, j) - fill(h) * way.a
        way.spin = spin_of(world, g, j + 3)
    more = next_impact(tree, world, g, b, way, load3(world.q, g, iq) - q, hit)
    return where_lt(more.time, late, where_lt(hit.time, late, fill(1.0), fill(0.0)), fill(0.0))
