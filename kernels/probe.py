"""What is observed of each world: a list of terms, computed at once, and how far they are from where they
should be.

Vectors are seen from the facing frame, which stands on the ground below the root and turns with the root's
first axis: neither the place nor the heading of a character in the world counts.
"""

import warp as wp

from .bounce import BOUNCE_SPEED
from .kinematics import kinematics, load3, load4, own_inertia
from .loading import compiled
from .port import choose, give, take
from .spatial import *
from .tree import HINGE, Tree, World
from .watch import spot

wp.set_module_options(
    {"enable_backward": False, "max_unroll": 3, "cpu_compiler_flags": "-march=native -ffp-contract=fast"}
)


def load(device) -> None:
    """Compile the kernels now; to be done before threads launch them."""
    compiled(__name__, device)


# kinds of terms, and how many numbers they have
LEAN = wp.constant(0)
HEIGHT = wp.constant(1)
SPIN = wp.constant(2)
COM = wp.constant(3)
COM_VELOCITY = wp.constant(4)
ANGULAR_MOMENTUM = wp.constant(5)
POINT = wp.constant(6)
VELOCITY = wp.constant(7)
BETWEEN = wp.constant(8)
FROM_COM = wp.constant(9)
MISS = wp.constant(10)
BALLISTIC = wp.constant(11)
STATUS = wp.constant(12)
FACING = wp.constant(13)


@wp.struct
class Probe:
    root: int
    """link that it faces with"""
    links: wp.array(dtype=int)
    """links whose mass counts; none where no term needs them"""
    judged: wp.array(dtype=int)
    """links whose joints are compared with a goal"""
    goal_q: wp.array2d(dtype=float)
    goal_qd: wp.array2d(dtype=float)
    """goals by row"""

    kind: wp.array(dtype=int)
    column: wp.array(dtype=int)
    """the first of each term"""
    link: wp.array2d(dtype=int)
    """of the two places, `(terms, 2)`; miss: the first and the end of what it judges in `judged`"""
    point: wp.array2d(dtype=wp.vec3)
    """on their links [m]"""
    value: wp.array2d(dtype=float)
    """`(terms, 3)`: ballistic: radius and meeting height [m], restitution"""

    wanted: wp.array2d(dtype=float)
    """observations that cost nothing, by row"""
    first: wp.array(dtype=int)
    count: wp.array(dtype=int)
    weight: wp.array(dtype=float)
    """groups of columns whose distance from there costs"""


@wp.func
def facing(R: Mat3, a: Vec3) -> Vec3:
    """A vector of the world in the facing frame of a root that is turned by R."""
    k = 1.0 / max(sqrt(R.xx * R.xx + R.yx * R.yx), fill(1.0e-6))
    cos = k * R.xx
    sin = k * R.yx
    return Vec3(cos * a.x + sin * a.y, cos * a.y - sin * a.x, a.z)


@wp.func
def give3(out: wp.array2d(dtype=float), g: int, c: int, v: Vec3):
    give(out, g, c, v.x)
    give(out, g, c + 1, v.y)
    give(out, g, c + 2, v.z)


@wp.struct
class Miss:
    """How far a joint is from its goal."""

    angle: Real
    """[rad]"""
    rate: Real
    """[rad/s]"""


@wp.func
def miss(tree: Tree, world: World, probe: Probe, row: wp.array(dtype=int), g: int, i: int) -> Miss:
    iq = tree.link_q[i]
    iv = tree.link_dof[i]
    q = probe.goal_q
    qd = probe.goal_qd
    if tree.link_joint[i] == HINGE:
        return Miss(
            abs(world.q[g, iq] - choose(q, row, g, 0, iq)), abs(world.qd[g, iv] - choose(qd, row, g, 0, iv))
        )
    goal = Quat(
        choose(q, row, g, 0, iq),
        choose(q, row, g, 0, iq + 1),
        choose(q, row, g, 0, iq + 2),
        choose(q, row, g, 0, iq + 3),
    )
    rate = Vec3(choose(qd, row, g, 0, iv), choose(qd, row, g, 0, iv + 1), choose(qd, row, g, 0, iv + 2))
    return Miss(norm(logarithm(conjugate(goal) * load4(world.q, g, iq))), norm(load3(world.qd, g, iv) - rate))


@wp.struct
class Whole:
    """A character as one body: from its root."""

    com: Vec3
    velocity: Vec3
    momentum: Vec3
    """angular, about the centre of mass [kg m^2/s]"""


@wp.func
def whole(tree: Tree, world: World, probe: Probe, g: int) -> Whole:
    at = world.pos[g, probe.root]
    mass = fill(1.0e-30)
    com = zero3()
    P = zero3()
    L = zero3()
    for k in range(probe.links.shape[0]):
        i = probe.links[k]
        r = world.pos[g, i] - at
        m = world.mass_scale[g, i] * tree.link_mass[i]
        c = rotate(world.R[g, i], tree.link_com[i])
        F = own_inertia(tree, world, g, i, c) * world.V[g, i]
        mass = mass + m
        com = com + m * (r + c)
        P = P + F.f
        L = L + F.n + cross(r, F.f)
    com = (1.0 / mass) * com
    return Whole(com, (1.0 / mass) * P, L - cross(com, P))


@wp.func
def spot_velocity(world: World, g: int, link: int, point: wp.vec3) -> Vec3:
    V = world.V[g, link]
    return V.v + cross(V.w, rotate(world.R[g, link], point))


@wp.func
def ballistic(
    probe: Probe, gravity: float, R: Mat3, from_root: Vec3, v: Vec3, z: Real, k: int,
    out: wp.array2d(dtype=float), g: int, c: int,
):  # fmt: skip
    """Of a ball in free flight from height z [m] at v [m/s]: time to the ground [s], where that is (2, facing
    frame) [m], time to the meeting height on its way up, or to the highest point where it does not come so
    far [s]."""
    radius = probe.value[k, 0]
    up = max(z - radius, fill(0.0))
    zero = fill(0.0)
    impact = sqrt(v.z * v.z + (2.0 * gravity) * up)
    lands = (1.0 / gravity) * (v.z + impact)
    place = facing(R, from_root + lands * v)
    meet = fill(probe.value[k, 1] - radius)
    now = v.z * v.z - (2.0 * gravity) * (meet - up)
    soon = (1.0 / gravity) * (v.z - sqrt(max(now, zero)))
    speed = where_lt(fill(BOUNCE_SPEED), impact, probe.value[k, 2] * impact, zero)
    then = speed * speed - (2.0 * gravity) * meet
    late = lands + (1.0 / gravity) * (speed - sqrt(max(then, zero)))
    before = where_lt(zero, v.z, where_lt(now, zero, late, where_lt(soon, zero, late, soon)), late)
    give(out, g, c, lands)
    give(out, g, c + 1, place.x)
    give(out, g, c + 2, place.y)
    give(out, g, c + 3, before)


@wp.func
def flags(world: World, g: int) -> Real:
    """Bits of the status, as a number."""
    return (
        world.broken[g, 0]
        + 2.0 * world.fallen[g, 0]
        + 4.0 * world.fumbled[g, 0]
        + 8.0 * world.hurried[g, 0]
        + 16.0 * world.strayed[g, 0]
    )


@wp.kernel
def observe(
    tree: Tree,
    world: World,
    first: int,
    probe: Probe,
    row: wp.array(dtype=int),
    out: wp.array2d(dtype=float),
    cost: wp.array2d(dtype=float),
):
    """out: all terms; cost: the sum over groups of weight times distance from what is wanted in each world's
    row."""
    g = first + wp.tid()
    kinematics(tree, world, g)
    R = world.R[g, probe.root]
    at = world.pos[g, probe.root]
    height = Vec3(fill(0.0), fill(0.0), at.z)
    body = whole(tree, world, probe, g)
    for k in range(probe.kind.shape[0]):
        kind = probe.kind[k]
        c = probe.column[k]
        a = probe.link[k, 0]
        p = probe.point[k, 0]
        if kind == LEAN:
            lean = facing(R, column(R, 2))
            give(out, g, c, lean.x)
            give(out, g, c + 1, lean.y)
        elif kind == HEIGHT:
            give(out, g, c, at.z)
        elif kind == SPIN:
            give3(out, g, c, facing(R, world.V[g, probe.root].w))
        elif kind == COM:
            give3(out, g, c, height + facing(R, body.com))
        elif kind == COM_VELOCITY:
            give3(out, g, c, facing(R, body.velocity))
        elif kind == ANGULAR_MOMENTUM:
            give3(out, g, c, facing(R, body.momentum))
        elif kind == POINT:
            give3(out, g, c, height + facing(R, spot(world, g, a, p) - at))
        elif kind == VELOCITY:
            give3(out, g, c, facing(R, spot_velocity(world, g, a, p)))
        elif kind == BETWEEN:
            give3(
                out,
                g,
                c,
                facing(R, spot(world, g, probe.link[k, 1], probe.point[k, 1]) - spot(world, g, a, p)),
            )
        elif kind == FROM_COM:
            give3(out, g, c, facing(R, spot(world, g, a, p) - at - body.com))
        elif kind == BALLISTIC:
            x = spot(world, g, a, p)
            v = spot_velocity(world, g, a, p)
            v = Vec3(v.x, v.y, v.z + 0.5 * tree.h * tree.gravity[2])  # the parabola's own, see `bounce`
            ballistic(probe, -tree.gravity[2], R, x - at, v, x.z, k, out, g, c)
        elif kind == FACING:
            ahead = facing(R, Vec3(fill(1.0), fill(0.0), fill(0.0)))
            give(out, g, c, ahead.x)
            give(out, g, c + 1, neg(ahead.y))
        elif kind == STATUS:
            give(out, g, c, flags(world, g))
        else:
            angle = fill(0.0)
            rate = fill(0.0)
            end = probe.link[k, 1]
            for j in range(a, end):
                off = miss(tree, world, probe, row, g, probe.judged[j])
                angle = angle + off.angle
                rate = rate + off.rate
            share = 1.0 / wp.max(float(end - a), 1.0)
            give(out, g, c, share * angle)
            give(out, g, c + 1, share * rate)
    total = fill(0.0)
    for k in range(probe.first.shape[0]):
        square = fill(0.0)
        for j in range(probe.count[k]):
            c = probe.first[k] + j
            apart = take(out, g, c) - choose(probe.wanted, row, g, 0, c)
            square = square + apart * apart
        total = total + probe.weight[k] * sqrt(square)
    give(cost, g, 0, total)
