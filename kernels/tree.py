"""What the kernels read and write: `Tree`, the model, the same for all worlds, and `World`, the rest.

A tree has links 1 .. n, parents before children; link 0 is the ground. Every link has one joint, so a
body with several joints becomes a chain of links of which the last carries the mass, and a body with
none belongs to its parent's link. A link's origin is its joint's anchor.

Arrays of a `World` are `(groups, n)`, one group being the worlds of one `Real`: a group's row is
contiguous on a CPU, and on CUDA, where a group is one world, neighbouring worlds lie side by side.
"""

import warp as wp

from .spatial import *

FREE = wp.constant(0)
BALL = wp.constant(1)
HINGE = wp.constant(2)

GROUND = wp.constant(0)

# kinds of contact slots
POINT_PLANE = wp.constant(0)
SPHERE_CAPSULE = wp.constant(1)
SPHERE_BOX = wp.constant(2)
CAPSULE_CAPSULE = wp.constant(3)
PARALLEL = wp.constant(4)
"""two capsules' second contact"""


@wp.struct
class Tree:
    h: float
    """time step [s]"""
    gravity: wp.vec3
    max_speed: float
    """no joint turns faster [rad/s]"""
    far: float
    """a free joint beyond this is too far for single precision [m]"""
    link_count: int
    """links, the ground not counted"""
    q_count: int
    dof_count: int
    slot_count: int
    flyer_count: int
    tumbler_count: int
    loose: int
    """1: some links are"""
    response_room: int
    """responses that `World.y` holds; what does not fit is worked out anew in each sweep"""
    sweeps: int
    """sweeps of the contact solver"""
    forced: int
    """1 while any external or joint force is set"""

    link_parent: wp.array(dtype=int)
    link_joint: wp.array(dtype=int)
    link_q: wp.array(dtype=int)
    link_dof: wp.array(dtype=int)
    link_offset: wp.array(dtype=wp.vec3)
    """origin in the parent's axes [m]"""
    link_turn: wp.array(dtype=wp.quat)
    """axes at joint_q = 0 in the parent's"""
    link_axis: wp.array(dtype=wp.vec3)
    """hinge axis in the link's axes"""
    link_zero: wp.array(dtype=float)
    """hinge angle that counts as none [rad]"""
    link_mass: wp.array(dtype=float)
    link_com: wp.array(dtype=wp.vec3)
    link_moments: wp.array(dtype=wp.vec3)
    """xx, yy, zz about the origin, link axes [kg m^2]"""
    link_products: wp.array(dtype=wp.vec3)
    """xy, xz, yz"""
    link_effort: wp.array(dtype=float)
    """largest drive torque [N m]; infinite where there is no limit"""
    link_driven: wp.array(dtype=int)
    """1: has a drive that may reach its limit"""
    link_limited: wp.array(dtype=int)
    link_lower: wp.array(dtype=float)
    link_upper: wp.array(dtype=float)
    """hinge: angles [rad]; ball: largest angle from its zero"""
    link_near: wp.array(dtype=float)
    """ball: cosine of half the angle at which its limit is first looked at"""
    link_sprung: wp.array(dtype=int)

    link_loose: wp.array(dtype=int)
    """1: velocity-product forces at the mean velocity of the step (see `mean`)"""
    link_tumbler: wp.array(dtype=int)
    """its number among those, or -1"""
    tumbler_link: wp.array(dtype=int)
    """free links without children that turn unevenly (see `tumble`)"""
    tumbler_inertia: wp.array(dtype=wp.mat33)
    """about the centre of mass, link axes, over its trace"""

    dof_armature: wp.array(dtype=float)
    dof_damping: wp.array(dtype=float)
    dof_stiffness: wp.array(dtype=float)
    dof_kp: wp.array(dtype=float)
    dof_kd: wp.array(dtype=float)
    q_spring: wp.array(dtype=float)
    """rest position of passive springs, laid out as joint_q"""

    body_link: wp.array(dtype=int)
    body_offset: wp.array(dtype=wp.vec3)
    """body frame in its link"""
    body_turn: wp.array(dtype=wp.quat)
    body_com: wp.array(dtype=wp.vec3)
    """centre of mass in its link [m]"""

    shape_link: wp.array(dtype=int)
    shape_pos: wp.array(dtype=wp.vec3)
    """centre in its link [m]"""
    shape_turn: wp.array(dtype=wp.quat)
    shape_half: wp.array(dtype=wp.vec3)
    """box: half sizes; capsule: half its segment as a vector of the link [m]"""
    shape_radius: wp.array(dtype=float)

    slot_kind: wp.array(dtype=int)
    slot_pair: wp.array(dtype=int)
    slot_a: wp.array(dtype=int)
    """shape pushed against the normal; a plane's slots: -1"""
    slot_b: wp.array(dtype=int)
    slot_link_a: wp.array(dtype=int)
    slot_link_b: wp.array(dtype=int)
    slot_meet: wp.array(dtype=int)
    """nearest common ancestor of the two links"""
    slot_plane: wp.array(dtype=wp.vec4)
    """unit normal and offset n . x of the plane"""
    slot_point: wp.array(dtype=wp.vec3)
    """plane: the point of the link that may touch [m]"""
    slot_radius: wp.array(dtype=float)
    """plane: radius about that point [m]"""
    slot_flag: wp.array(dtype=int)
    """0 none, 1 a touch here is a fall, 2 a bad contact"""
    slot_length: wp.array(dtype=int)
    """dofs that answer to the slot"""
    slot_dof: wp.array(dtype=int)
    """the first of them in response_dof"""
    response_dof: wp.array(dtype=int)
    slot_flight: wp.array(dtype=int)
    """1: a flyer and a plane"""
    flyer_link: wp.array(dtype=int)
    """links of balls whose bounces off planes are exact (see `bounce`)"""
    flyer_flight: wp.array(dtype=int)
    """the first of each in flight_slot, and the end"""
    flyer_even: wp.array(dtype=int)
    """1: the same moment of inertia about every axis"""
    flyer_ease: wp.array(dtype=wp.mat33)
    """inverse of the inertia, link axes [1 / (kg m^2)]"""
    flight_slot: wp.array(dtype=int)
    pair_erp: wp.array(dtype=float)
    pair_cfm: wp.array(dtype=float)


@wp.struct
class World:
    q: wp.array2d(dtype=Real)
    qd: wp.array2d(dtype=Real)
    target: wp.array2d(dtype=Real)
    joint_f: wp.array2d(dtype=Real)
    """generalised force [N, N m]"""
    force: wp.array2d(dtype=Vec3)
    """external force at each body's centre of mass [N]"""
    mass_scale: wp.array2d(dtype=Real)
    """of each link's inertia"""
    friction: wp.array2d(dtype=Real)
    restitution: wp.array2d(dtype=Real)

    turn: wp.array2d(dtype=Quat)
    R: wp.array2d(dtype=Mat3)
    pos: wp.array2d(dtype=Vec3)
    r: wp.array2d(dtype=Vec3)
    V: wp.array2d(dtype=Motion)
    A: wp.array2d(dtype=Motion)
    """acceleration of a link whose joints, and those above it, do not accelerate"""
    mean: wp.array2d(dtype=Motion)
    """of V at the step's start and at its end"""
    lag: wp.array2d(dtype=Motion)
    """by what a step with its last velocity goes wrong of a tumbler: angular velocity too much, body axes
    [rad/s], and way that is lacking [m]"""
    I: wp.array2d(dtype=Inertia)
    p: wp.array2d(dtype=Force)

    pull: wp.array2d(dtype=Vec3)
    """kp (target - q) of each link's drive [N m]"""
    asked: wp.array2d(dtype=Vec3)
    """what a drive at its limit would give without one, link axes [N m]"""
    full: wp.array2d(dtype=Real)
    """1: the link's drive is at its limit"""

    s: wp.array2d(dtype=Vec3)
    U: wp.array2d(dtype=Force)
    d: wp.array2d(dtype=Real)
    """D^(-1/2)"""
    w: wp.array2d(dtype=Real)
    """whitened velocity, D^(1/2) L qd"""

    gap: wp.array2d(dtype=Real)
    """[m], negative: overlap"""
    point: wp.array2d(dtype=Vec3)
    normal: wp.array2d(dtype=Vec3)
    goal: wp.array2d(dtype=Real)
    """least normal velocity that a slot may have within the step [m/s]"""
    kept: wp.array2d(dtype=Real)
    """least that it may be left with once the step is done"""
    impulse: wp.array2d(dtype=Vec3)
    """along the normal and two tangents [N s]"""
    settled: wp.array2d(dtype=Vec3)
    """impulse after the last sweep, and what that changed of it [N s]; see `solve`"""
    change: wp.array2d(dtype=Vec3)
    w_settled: wp.array2d(dtype=Real)
    """w after the last sweep"""
    y: wp.array2d(dtype=Vec3)
    """responses of the slots in use, the head of each and then an entry per dof (see `contact`)"""
    active: wp.array2d(dtype=int)
    """slots in use by some lane of the group, each followed by its place in y; last, their number and
    the end of y"""
    touched: wp.array2d(dtype=Real)
    """least distance that a flyer or tumbler may come to anything within the step [m]; a flyer's planes
    apart"""
    struck: wp.array2d(dtype=Real)
    """of the first link of a tree: what is left of the step when something strikes the tree; of link 0: the
    same of any tree [s]"""
    knock: wp.array2d(dtype=Real)
    """impulse of a flyer's bounces off a plane in this step [N s]"""

    broken: wp.array2d(dtype=Real)
    fallen: wp.array2d(dtype=Real)
    fumbled: wp.array2d(dtype=Real)
    hurried: wp.array2d(dtype=Real)
    strayed: wp.array2d(dtype=Real)
    """status flags: the state is not finite, a fall, a bad contact, a joint at max_speed, one beyond `far`"""


COLUMNS = {
    "q": "q target",
    "dof": "qd joint_f s U d w w_settled",
    "link": "mass_scale turn R pos r V A I p pull asked full touched struck",
    "flight": "knock",
    "loose": "mean",
    "tumbler": "lag",
    "slot": "gap point normal goal kept impulse settled change",
    "pair": "friction restitution",
    "body": "force",
    "world": "broken fallen fumbled hurried strayed",
    "response": "y",
    "use": "active",
}
"""What the columns of a `World`'s arrays are: a joint coordinate each, a degree of freedom, ..."""
CARRIED = (
    *("q", "qd", "impulse", "knock", "full", "asked"),
    *("broken", "fallen", "fumbled", "hurried", "strayed"),
)
"""Arrays that a step hands to the next."""
