"""A character as a whole: what it feels of itself, and how far its joints are from where they should be.

Everything is seen from the facing frame, which stands on the ground below the root and turns with the
root's first axis: neither the place nor the heading of a character in the world counts.
"""

import warp as wp

from .aim import choose
from .kinematics import kinematics, load3, load4, own_inertia, store3
from .spatial import *
from .tree import HINGE, Tree, World

wp.set_module_options(
    {"enable_backward": False, "max_unroll": 3, "cpu_compiler_flags": "-march=native -ffp-contract=fast"}
)

WHOLE = wp.constant(17)
"""Columns of `sense` that are not an end's."""


def load(device) -> None:
    """Compile the kernels now; to be done before threads launch them."""
    wp.load_module(__name__, device=device)


@wp.struct
class Character:
    root: int
    """link that it faces with"""
    links: wp.array(dtype=int)
    """links whose mass is its own"""
    judged: wp.array(dtype=int)
    """links whose joints are compared"""
    end_link: wp.array(dtype=int)
    end_point: wp.array(dtype=wp.vec3)
    """place on the link [m]"""


@wp.func
def facing(R: Mat3, a: Vec3) -> Vec3:
    """A vector of the world in the facing frame of a root that is turned by R."""
    k = 1.0 / max(sqrt(R.xx * R.xx + R.yx * R.yx), fill(1.0e-6))
    cos = k * R.xx
    sin = k * R.yx
    return Vec3(cos * a.x + sin * a.y, cos * a.y - sin * a.x, a.z)


@wp.struct
class Miss:
    """How far a joint is from its goal."""

    angle: Real
    """[rad]"""
    rate: Real
    """[rad/s]"""


@wp.func
def miss(
    tree: Tree,
    world: World,
    g: int,
    i: int,
    q: wp.array2d(dtype=float),
    qd: wp.array2d(dtype=float),
    rows: wp.array2d(dtype=int),
) -> Miss:
    iq = tree.link_q[i]
    iv = tree.link_dof[i]
    if tree.link_joint[i] == HINGE:
        angle = world.q[g, iq] - choose(q, rows, g, 0, iq)
        return Miss(abs(angle), abs(world.qd[g, iv] - choose(qd, rows, g, 0, iv)))
    goal = Quat(
        choose(q, rows, g, 0, iq),
        choose(q, rows, g, 0, iq + 1),
        choose(q, rows, g, 0, iq + 2),
        choose(q, rows, g, 0, iq + 3),
    )
    rate = Vec3(choose(qd, rows, g, 0, iv), choose(qd, rows, g, 0, iv + 1), choose(qd, rows, g, 0, iv + 2))
    return Miss(norm(logarithm(conjugate(goal) * load4(world.q, g, iq))), norm(load3(world.qd, g, iv) - rate))


@wp.kernel
def sense(
    tree: Tree,
    world: World,
    first: int,
    who: Character,
    q: wp.array2d(dtype=float),
    qd: wp.array2d(dtype=float),
    rows: wp.array2d(dtype=int),
    out: wp.array2d(dtype=Real),
):
    """out, WHOLE + 3 ends numbers: 0 lean of the root (x and y of its third axis), 2 its height [m], 3
    centre of mass [m], 6 its velocity [m/s], 9 angular momentum about it [kg m^2/s], 12 angular
    velocity of the root [rad/s], 15 mean angle [rad] and 16 mean rate [rad/s] between the judged joints
    and the goals q, qd (tables, of which each world has a row); then each end's place [m]. Places
    count from the ground below the root."""
    g = first + wp.tid()
    kinematics(tree, world, g)
    R = world.R[g, who.root]
    at = world.pos[g, who.root]
    mass = fill(0.0)
    com = zero3()
    P = zero3()
    L = zero3()
    for k in range(who.links.shape[0]):
        i = who.links[k]
        r = world.pos[g, i] - at
        m = world.mass_scale[g, i] * tree.link_mass[i]
        c = rotate(world.R[g, i], tree.link_com[i])
        F = own_inertia(tree, world, g, i, c) * world.V[g, i]
        mass = mass + m
        com = com + m * (r + c)
        P = P + F.f
        L = L + F.n + cross(r, F.f)
    com = (1.0 / mass) * com
    height = Vec3(fill(0.0), fill(0.0), at.z)
    lean = facing(R, column(R, 2))
    out[g, 0] = lean.x
    out[g, 1] = lean.y
    out[g, 2] = at.z
    store3(out, g, 3, height + facing(R, com))
    store3(out, g, 6, (1.0 / mass) * facing(R, P))
    store3(out, g, 9, facing(R, L - cross(com, P)))
    store3(out, g, 12, facing(R, world.V[g, who.root].w))
    angle = fill(0.0)
    rate = fill(0.0)
    for k in range(who.judged.shape[0]):
        off = miss(tree, world, g, who.judged[k], q, qd, rows)
        angle = angle + off.angle
        rate = rate + off.rate
    share = 1.0 / wp.max(float(who.judged.shape[0]), 1.0)
    out[g, 15] = share * angle
    out[g, 16] = share * rate
    for k in range(who.end_link.shape[0]):
        i = who.end_link[k]
        r = world.pos[g, i] + rotate(world.R[g, i], who.end_point[k]) - at
        store3(out, g, WHOLE + 3 * k, height + facing(R, r))
