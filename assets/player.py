"""The player's author: tables of anthropometry in, ``player.xml`` (MJCF) out.

``python -m warpdribble.assets.player`` rewrites the checked-in file. SI units (m, kg, rad, N m),
Z up. The zero pose is a T-pose that faces +X, palms down, soles on z = 0; left is +Y. Every body
frame is world aligned there and sits at the joint to its parent, so all points below are written in
world coordinates of the zero pose. The right side is the mirror image of the left. Sources:

* P1: Liu & Hodgins 2018, *Learning Basketball Dribbling Skills Using Trajectory Optimization and
  Deep Reinforcement Learning*: 1.80 m, 76 kg, 101 degrees of freedom (20 bodies, 13 ball joints,
  6 hinges, a free root, ten fingers of 5 each), the ball. It prints no dimensions of segments.
* de Leva 1996, J. Biomech. 29(9), table 4, men: masses, lengths, centres of mass of the limbs.
* Winter 2009, *Biomechanics and Motor Control of Human Movement*, fig. 4.1: ankle and shoulder.
* Buryanov & Kotiuk 2010, Int. J. Morphol. 28(3): fingers. Bell 1990, J. Biomech. 23(6): hips.
* Taylor & Schwarz 1955, Artificial Limbs 2(2): a hand at rest, "more and more flexed from index to
  little finger"; goniometry of that cascade: Asha et al. 2015, Orthop. Rheumatol. 1(1).
* AAOS 1965, *Joint Motion*: ranges. A ball joint has one cone about the T-pose: the widest of its
  ranges, and the wrist's holds the forearm's pronation too.
* Depths of the trunk, the hand's spread and the fist were chosen by eye.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

STATURE, MASS = 1.80, 76.0
SUBJECT = 1.741  # stature of de Leva's mean man; lengths scale with stature
DENSITY = 1050.0  # of soft tissue and bone together; turns a limb's mass into its radius

SEGMENTS = {  # de Leva: length [mm], mass [%], centre of mass [% from the upper or proximal end]
    "head": (242.9, 6.94, 50.02),  # vertex to cervicale (C7)
    "upper trunk": (242.1, 15.96, 50.66),  # cervicale to xiphoid
    "middle trunk": (215.5, 16.33, 45.02),  # xiphoid to navel
    "lower trunk": (145.7, 11.17, 61.15),  # navel to mid hip
    "upper arm": (281.7, 2.71, 57.72),
    "forearm": (268.9, 1.62, 45.74),
    "hand": (187.9, 0.61, 36.24),  # wrist to tip of middle finger
    "thigh": (422.2, 14.16, 40.95),
    "shank": (440.3, 4.33, 43.95),
    "foot": (258.1, 1.37, 44.15),  # heel to toe tip
}
LENGTH = {s: mm / 1000 * STATURE / SUBJECT for s, (mm, _, _) in SEGMENTS.items()}
WEIGHT = {s: percent / 100 * MASS for s, (_, percent, _) in SEGMENTS.items()}  # adds up to 100 %
RADIUS = {s: np.sqrt(WEIGHT[s] / (DENSITY * np.pi * LENGTH[s])) for s in SEGMENTS}  # as a cylinder
CLAVICLE_SHARE = 0.10  # of the upper trunk, on each side; our division, de Leva has none
TOES_SHARE = 0.138  # of the foot, in front of the toe joint: 0.217 of 1.567 kg, OpenSim gait2392

ANKLE_HEIGHT, SHOULDER_HEIGHT = 0.039 * STATURE, 0.818 * STATURE  # Winter
SHOULDER_BREADTH, FOOT_BREADTH = 0.259 * STATURE, 0.055 * STATURE  # Winter
HIP_Y = 0.09  # half of 72 % of 0.25 m between the iliac spines, Bell
ANKLE_FROM_HEEL, BALL_FROM_HEEL = 0.25, 0.73  # of the foot's length
TRUNK_RADIUS, HEAD_RADIUS, NECK_RADIUS, SHIN_RADIUS, TOE_RADIUS = 0.105, 0.105, 0.055, 0.036, 0.026
PALM_BREADTH, PALM_THICKNESS, WRIST_RADIUS, FINGER_RADIUS = 0.085, 0.026, 0.027, 0.008

FINGERS = {  # segments from the knuckle on, the last with its pulp [mm] (Buryanov & Kotiuk);
    # knuckle: x [m], y [of the palm's length], z [m]; where the finger points; where its tip goes
    # as it closes. The thumb's ball joint is its saddle joint, so it begins with the metacarpal.
    "thumb": ((46.22, 31.57, 27.34), (0.026, 0.24, -0.006), (0.62, 0.74, -0.26), (-1, 0, -0.75)),
    "index": ((39.78, 22.38, 19.66), (0.031, 0.97, 0), (0.10, 1, 0), (0, 0, -1)),
    "middle": ((44.63, 26.33, 21.35), (0.0105, 1.00, 0), (0, 1, 0), (0, 0, -1)),
    "ring": ((41.37, 25.65, 21.25), (-0.0105, 0.94, 0), (-0.10, 1, 0), (0, 0, -1)),
    "pinky": ((32.74, 18.11, 19.69), (-0.031, 0.85, 0), (-0.24, 1, 0), (0, 0, -1)),
}

# Gains: 500/50 as in Guided SAMCON, lighter outwards. The legs and the back are springs in series
# under an inverted pendulum: with 500 at knees, hips and back a passive stand needs more than
# about 540 N m/rad at each ankle, not only m g h / 2 = 353. Positive hinge angles flex.
JOINTS = {  # type, range [rad], kp [N m/rad], kv [N m s/rad], effort limit [N m], armature [kg m^2]
    **dict.fromkeys(("lower_back", "torso"), ("ball", (0, 1.0), 500, 50, 400, 0.02)),
    "neck": ("ball", (0, 1.2), 100, 10, 100, 0.01),
    "clavicle": ("ball", (0, 0.7), 400, 40, 400, 0.02),
    "shoulder": ("ball", (0, 2.6), 400, 40, 400, 0.01),
    "elbow": ("hinge", (-0.09, 2.62), 300, 30, 300, 0.01),
    "wrist": ("ball", (0, 2.0), 50, 5, 50, 0.002),
    "hip": ("ball", (0, 2.2), 500, 50, 400, 0.02),
    "knee": ("hinge", (-0.09, 2.44), 500, 50, 400, 0.02),
    "ankle": ("ball", (0, 0.9), 800, 80, 400, 0.02),
    "toes": ("hinge", (-1.22, 0.79), 50, 5, 50, 0.002),
    "mcp": ("ball", (0, 1.7), 5, 0.2, 5, 1e-4),
    "pip": ("hinge", (-0.09, 1.83), 2, 0.1, 2, 5e-5),
    "dip": ("hinge", (-0.09, 1.57), 2, 0.1, 2, 2e-5),
}

COLOURS = {"skin": "0.80 0.60 0.47 1", "hair": "0.18 0.13 0.10 1", "jersey": "0.85 0.20 0.18 1",
           "shorts": "0.16 0.22 0.42 1", "shoe": "0.93 0.93 0.95 1"}  # fmt: skip

# Left side of the stand: rotation vectors of ball joints, angles of hinges; all others are zero.
STAND = {"shoulder": np.array([-1.42, 0, 0]), "elbow": np.array([0.25])}
Hand = dict[str, tuple[float, ...]]
"""Finger -> turn of its first joint in the palm's plane, from +X to +Y on the left, and curl of all three
[rad]."""
FIST: Hand = {**{finger: (0.0, 1.45, 1.65, 1.0) for finger in FINGERS}, "thumb": (0.0, 0.55, 0.75, 0.9)}
RELAXED: Hand = {  # the fingers lie side by side, the thumb beside the index finger
    finger: tuple(np.radians(degrees))
    for finger, degrees in {
        "thumb": (14, 12, 18, 14),
        "index": (8, 28, 36, 14),
        "middle": (0, 33, 40, 17),
        "ring": (-8, 37, 43, 19),
        "pinky": (-16, 42, 46, 22),
    }.items()
}


def closed(grip: float) -> Hand:
    """P1 Eq. 1: lambda of the way from the flat hand (all zero) to the fist."""
    return {finger: tuple(grip * angle for angle in angles) for finger, angles in FIST.items()}


HOLD = {  # the ball at rest on the upturned right palm
    "r_elbow": 1.5,
    "r_wrist": np.array([0.1218, -1.7173, 0]),
    "ball": (0.347, -0.209, 1.234),
}
KEYFRAMES: dict[str, tuple[Hand, dict[str, Any]]] = {
    "start": (RELAXED, {}),
    "flat": (closed(0.0), {}),
    "ready": (closed(0.2), {}),  # P1's idle hand, which waits for the ball
    "fist": (closed(1.0), {}),
    "hold": (closed(0.2), HOLD),
}

# A shoe and the pad of a heel give way: a point of the sole is a spring [N/m] and a damper [N s/m],
# of the order of a shod heel's 100 kN/m (Aerts & De Clercq 1993, J. Sports Sci. 11). On a rigid sole a
# runner lands with a blow of 4 to 7 body weights within one step, which throws the foot up again.
SOLE = (80e3, 535.0)
TIMESTEP, GROUND_ERP, GROUND_CFM = 0.01, 0.2, 1e-5

BALL_RADIUS, BALL_MASS, BALL_XY = 0.1193, 0.6237, (0.35, -0.35)
MIRROR = np.array([1, -1, 1])


def vec(*p: float) -> np.ndarray:
    return np.array(p, float)


@dataclass
class Geom:
    """A capsule from a to b, a box between its corners a and b, or a sphere at a = b [m]."""

    kind: str
    colour: str
    radius: float
    a: np.ndarray
    b: np.ndarray

    def moments(self) -> tuple[float, np.ndarray, np.ndarray]:
        """Volume [m^3], centre [m] and inertia about it for unit density [m^5]."""
        edge, r, centre = self.b - self.a, self.radius, (self.a + self.b) / 2
        if self.kind == "box":
            volume = float(abs(edge.prod()))
            return volume, centre, volume / 12 * (edge @ edge * np.eye(3) - np.diag(edge**2))
        length = float(np.linalg.norm(edge))
        u = edge / length if length else edge
        ball, rod = 4 / 3 * np.pi * r**3, np.pi * r**2 * length
        along = rod * r**2 / 2 + ball * 0.4 * r**2
        # a rod and two half balls, whose centres of mass lie 3/8 r beyond its ends
        across = rod * (length**2 / 12 + r**2 / 4)
        across += ball * (0.4 * r**2 + length**2 / 4 + 3 / 8 * length * r)
        return rod + ball, centre, across * np.eye(3) + (along - across) * np.outer(u, u)


@dataclass
class Body:
    """A body and the joint at its origin `at` [m]; `axis` of a hinge, or of a knuckle's curl. The root has no
    parent, ""."""

    name: str
    parent: str
    joint: str
    at: np.ndarray
    mass: float
    geoms: list[Geom]
    axis: np.ndarray = field(default_factory=lambda: vec(0, 1, 0))
    com: np.ndarray | None = None  # where the table has one; else the centre of the geoms
    # name, position, direction of local z
    sites: list[tuple[str, np.ndarray, np.ndarray]] = field(default_factory=list)

    @property
    def drive(self) -> str:
        """The joint's row in JOINTS."""
        return next(name for name in JOINTS if self.joint.endswith(name))

    def inertia(self) -> tuple[np.ndarray, np.ndarray]:
        """Centre of mass [m] and inertia about it [kg m^2]; geoms share one density."""
        volumes, centres, moments = map(np.array, zip(*(g.moments() for g in self.geoms)))
        mean = volumes @ centres / volumes.sum()
        inertia = moments.sum(0)
        for v, d in zip(volumes, centres - mean):
            inertia += v * (d @ d * np.eye(3) - np.outer(d, d))
        return mean if self.com is None else self.com, inertia * self.mass / volumes.sum()

    def mirrored(self) -> "Body":
        """The same body on the right; an axis is a pseudovector."""
        parent = "r_" + self.parent[2:] if self.parent.startswith("l_") else self.parent
        return Body(
            "r_" + self.name[2:], parent, "r_" + self.joint[2:], self.at * MIRROR, self.mass,
            [replace(g, a=g.a * MIRROR, b=g.b * MIRROR) for g in self.geoms], -self.axis * MIRROR,
            None if self.com is None else self.com * MIRROR,
            [("r_" + name[2:], p * MIRROR, z * MIRROR) for name, p, z in self.sites],
        )  # fmt: skip


def limb(
    name: str,
    parent: str,
    joint: str,
    segment: str,
    start: np.ndarray,
    end: np.ndarray,
    geoms: list[Geom],
    **more: Any,
) -> Body:
    """A segment between two joints, with the table's mass and centre of mass."""
    com = start + SEGMENTS[segment][2] / 100 * (end - start)
    return Body(name, parent, joint, start, WEIGHT[segment], geoms, com=com, **more)


def capsule(colour: str, radius: float, a: np.ndarray, b: np.ndarray) -> Geom:
    return Geom("capsule", colour, radius, a, b)


def tapered(thick: float, thin: float, a: np.ndarray, b: np.ndarray) -> list[Geom]:
    return [capsule("skin", thick, a, (a + b) / 2), capsule("skin", thin, (a + b) / 2, b)]


def trunk() -> list[Body]:
    """Pelvis, lower back, torso and head, from the hips up."""
    hip = LENGTH["thigh"] + LENGTH["shank"] + ANKLE_HEIGHT
    # de Leva measured along the curve of the back; closing the stature takes 4 % off
    heights = np.cumsum([LENGTH[s] for s in ("lower trunk", "middle trunk", "upper trunk", "head")])
    navel, xiphoid, neck, _ = hip + heights * (STATURE - hip) / heights[-1]
    hips, waist = vec(0, 0.06, (hip + navel) / 2), vec(0, 0.05, (navel + xiphoid) / 2)
    ribs, chest = vec(0, 0.055, xiphoid), vec(0, 0.085, neck - 0.12)
    top, face = vec(0.008, 0, STATURE - HEAD_RADIUS), vec(0.022, 0, STATURE - HEAD_RADIUS - 0.008)
    r, torso = TRUNK_RADIUS, WEIGHT["upper trunk"] * (1 - 2 * CLAVICLE_SHARE)
    return [
        Body("pelvis", "", "root", vec(0, 0, hip), WEIGHT["lower trunk"],
             [capsule("shorts", r, hips, hips * MIRROR)]),
        Body("lower_back", "pelvis", "lower_back", vec(0, 0, navel), WEIGHT["middle trunk"],
             [capsule("jersey", r, waist, waist * MIRROR)]),
        Body("torso", "lower_back", "torso", vec(0, 0, xiphoid), torso,
             [capsule("jersey", 0.95 * r, ribs * m, chest * m) for m in (1, MIRROR)]),
        Body("head", "torso", "neck", vec(0, 0, neck), WEIGHT["head"],
             [Geom("sphere", "skin", 0.94 * HEAD_RADIUS, face, face),
              Geom("sphere", "hair", HEAD_RADIUS, top, top),
              capsule("skin", NECK_RADIUS, vec(0, 0, neck - 0.03), vec(0.01, 0, neck + 0.06))],
             sites=[("head_top", top + vec(0, 0, HEAD_RADIUS), vec(0, 0, 1))]),
    ]  # fmt: skip


def arm() -> list[Body]:
    """Left shoulder girdle, arm and hand, along +Y."""
    r = RADIUS["upper arm"]  # Winter's shoulder is the outside, the joint lies a radius inside
    neck = vec(0, 0.03, SHOULDER_HEIGHT - r)
    shoulder = vec(0, SHOULDER_BREADTH / 2 - r, SHOULDER_HEIGHT - r)
    elbow = shoulder + vec(0, LENGTH["upper arm"], 0)
    wrist = elbow + vec(0, LENGTH["forearm"], 0)
    # a forearm as thick as its mean would stand proud of the palm
    forearm = tapered(RADIUS["forearm"], WRIST_RADIUS, elbow, wrist - vec(0, 0.015, 0))
    return [
        Body("l_clavicle", "torso", "l_clavicle", neck, WEIGHT["upper trunk"] * CLAVICLE_SHARE,
             [capsule("jersey", 1.1 * r, neck, shoulder)]),
        limb("l_upper_arm", "l_clavicle", "l_shoulder", "upper arm", shoulder, elbow,
             [capsule("skin", r, shoulder, elbow)]),
        limb("l_lower_arm", "l_upper_arm", "l_elbow", "forearm", elbow, wrist, forearm,
             axis=vec(0, 0, -1)),
        *hand(wrist),
    ]  # fmt: skip


def hand(wrist: np.ndarray) -> list[Body]:
    """Left palm and fingers; the hand's mass goes by volume."""
    scale = STATURE / SUBJECT / 1000
    palm = LENGTH["hand"] - sum(FINGERS["middle"][0]) * scale
    half = vec(PALM_BREADTH, 0, PALM_THICKNESS) / 2
    box = Geom("box", "skin", 0, wrist - half, wrist + half + vec(0, palm, 0))
    surface = wrist + vec(0, palm, -PALM_THICKNESS) / 2
    bodies = [Body("l_hand", "l_lower_arm", "l_wrist", wrist, 0, [box],
                   sites=[("l_palm", surface, vec(0, 0, -1))])]  # fmt: skip
    for finger, (segments, (x, y, z), direction, curl) in FINGERS.items():
        d = vec(*direction) / np.linalg.norm(direction)
        c = vec(*curl) - d * (d @ curl)
        c /= np.linalg.norm(c)
        start, parent = wrist + vec(x, y * palm, z), "l_hand"
        for i, joint in enumerate(("mcp", "pip", "dip"), 1):
            name, end = f"l_{finger}_{i}", start + d * segments[i - 1] * scale
            bone = end - d * FINGER_RADIUS if i == 3 else end  # the last length has the round end
            sites = [(f"l_{finger}_tip", bone + c * FINGER_RADIUS, c)] if i == 3 else []
            geom = capsule("skin", FINGER_RADIUS, start, bone)
            bodies.append(Body(name, parent, f"l_{finger}_{joint}", start, 0, [geom],
                               np.cross(d, c), sites=sites))  # fmt: skip
            start, parent = end, name
    volumes = [b.geoms[0].moments()[0] for b in bodies]
    for b, v in zip(bodies, volumes):
        b.mass = WEIGHT["hand"] * v / sum(volumes)
    return bodies


def leg() -> list[Body]:
    """Left leg, straight down to a sole (box) and toes (a bar across) that touch z = 0."""
    ankle = vec(0, HIP_Y, ANKLE_HEIGHT)
    knee = ankle + vec(0, 0, LENGTH["shank"])
    hip = knee + vec(0, 0, LENGTH["thigh"])
    heel, ball, tip = (vec((x - ANKLE_FROM_HEEL) * LENGTH["foot"], HIP_Y, 0) for x in (0, BALL_FROM_HEEL, 1))
    half, up = vec(0, FOOT_BREADTH / 2, 0), vec(0, 0, TOE_RADIUS)
    sole = Geom("box", "shoe", 0, heel - half, ball + half + vec(0, 0, 0.8 * ANKLE_HEIGHT))
    centre, side = tip + vec(-TOE_RADIUS, 0, TOE_RADIUS), half - vec(0, TOE_RADIUS, 0)
    toes = capsule("shoe", TOE_RADIUS, centre - side, centre + side)
    return [
        limb("l_upper_leg", "pelvis", "l_hip", "thigh", hip, knee,
             [capsule("shorts", RADIUS["thigh"], hip, knee)]),
        limb("l_lower_leg", "l_upper_leg", "l_knee", "shank", knee, ankle,
             tapered(1.1 * RADIUS["shank"], SHIN_RADIUS, knee, ankle)),
        Body("l_foot", "l_lower_leg", "l_ankle", ankle, WEIGHT["foot"] * (1 - TOES_SHARE), [sole]),
        Body("l_toes", "l_foot", "l_toes", ball + up, WEIGHT["foot"] * TOES_SHARE, [toes]),
    ]  # fmt: skip


def bodies() -> list[Body]:
    """All bodies of the player, depth first: trunk, left arm, right arm, left leg, right leg."""
    left = arm(), leg()
    return trunk() + [b for part in left for b in [*part, *(b.mirrored() for b in part)]]


def target(body: Body, fingers: Hand, pose: dict[str, Any]) -> np.ndarray:
    """Rotation vector or angle [rad] of a joint in the stand with such fingers, and with `pose` in place
    of the stand for the joints that it names."""
    if body.joint in pose:
        return np.atleast_1d(pose[body.joint])
    side, _, name = body.joint.partition("_")
    size = 3 if JOINTS[body.drive][0] == "ball" else 1
    finger = name.split("_")[0]
    if finger in FIST:
        aside, *curls = fingers[finger]
        curl = curls[("mcp", "pip", "dip").index(body.drive)]
        if size == 1:
            return np.array([curl])
        turn = Rotation.from_rotvec([0, 0, -aside if side == "r" else aside])
        return (turn * Rotation.from_rotvec(curl * body.axis)).as_rotvec()
    angle = STAND.get(name, np.zeros(size))
    return -angle * MIRROR if side == "r" and size == 3 else angle


def text(values: Any, digits: int = 6) -> str:
    """Numbers for XML, rounded so that the last bits of the arithmetic cannot change the file."""
    return " ".join(f"{v:.12g}" for v in np.round(np.atleast_1d(values), digits) + 0.0)


def add(parent: ET.Element, tag: str, attributes: dict[str, Any] | None = None, **more: Any) -> ET.Element:
    """Append an element; numbers become text."""
    items = ((attributes or {}) | more).items()
    return ET.SubElement(parent, tag, {k: v if isinstance(v, str) else text(v) for k, v in items})


def sole() -> tuple[float, float, float]:
    """Restitution, erp [-] and cfm [s/kg] of a shoe that make SOLE of a contact with the ground, which
    has the mean of both geoms' (Smith 2006, ODE user guide 3.8)."""
    spring, damper = SOLE
    load = TIMESTEP * spring + damper
    return 0.0, 2.0 * TIMESTEP * spring / load - GROUND_ERP, 2.0 / load - GROUND_CFM


def mjcf() -> str:
    """The player, the ball and the ground as MJCF."""
    root = ET.Element("mujoco", model="warpdribble player")
    root.append(ET.Comment(
        " Written by warpdribble.assets.player, which names its sources: segments de Leva 1996 and"
        " Winter 2009, hands Buryanov and Kotiuk 2010, topology Liu and Hodgins 2018. Geoms carry"
        ' user="restitution erp cfm"; the restitution of a contact is the product of its two. '
    ))  # fmt: skip
    add(root, "compiler", angle="radian", autolimits="true")
    # MuJoCo's default integrator would treat the drives' damping explicitly and blow up
    add(root, "option", timestep=TIMESTEP, gravity=(0, 0, -9.81), integrator="implicitfast")
    add(root, "size", nuser_geom=3)
    default = add(root, "default")
    add(default, "geom", contype=0, conaffinity=1, condim=3, friction=(0.8, 0.005, 1e-4),
        user=(0, GROUND_ERP, GROUND_CFM))  # fmt: skip
    add(default, "site", size=0.003, group=3)
    for name, rgba in COLOURS.items():
        geom = add(add(default, "default", {"class": name}), "geom", rgba=rgba)
        if name == "shoe":
            geom.set("user", text(sole()))
    for name, (kind, limits, kp, kv, effort, armature) in JOINTS.items():
        group = add(default, "default", {"class": name})
        add(group, "joint", type=kind, range=limits, armature=armature)
        add(group, "position", kp=kp, kv=kv, forcerange=(-effort, effort))

    world, actuator = add(root, "worldbody"), add(root, "actuator")
    add(world, "light", pos=(0, 0, 4), directional="true")
    add(world, "geom", name="ground", type="plane", size=(0, 0, 0.05), contype=1, conaffinity=0,
        rgba="0.76 0.60 0.42 1", user=(1, GROUND_ERP, GROUND_CFM))  # fmt: skip
    player, elements, at = bodies(), {"": world}, {"": vec(0, 0, 0)}
    for b in player:
        element = add(elements[b.parent], "body", name=b.name, pos=b.at - at[b.parent])
        elements[b.name], at[b.name] = element, b.at
        _contents(element, b)
        if b.parent:
            ball = JOINTS[b.drive][0] == "ball"
            for axis, gear in zip("xyz", np.eye(3)) if ball else [("", None)]:
                drive = {"class": b.drive, "name": f"{b.joint}_{axis}".strip("_"), "joint": b.joint}
                add(actuator, "position", drive | ({"gear": gear} if ball else {}))
    shell = 2 / 3 * BALL_MASS * BALL_RADIUS**2  # a thin shell
    element = add(world, "body", name="ball", pos=(*BALL_XY, BALL_RADIUS))
    add(element, "freejoint", name="ball")
    add(element, "inertial", pos="0 0 0", mass=BALL_MASS, diaginertia=text([shell] * 3, 12))
    add(element, "geom", name="ball", type="sphere", size=BALL_RADIUS, contype=1,
        rgba="0.90 0.45 0.13 1", user="0.8 0.2 1e-5")  # fmt: skip

    # who is what, left before right; and who may touch what: a fall is the ground on anything but the feet,
    # a bad contact the ball on anything but the hands
    custom = add(root, "custom")
    for role, parts in {
        "feet": ("foot", "toes"),
        "hands": ("hand", *(f"{finger}_{n}" for finger in FINGERS for n in (1, 2, 3))),
        "palms": ("palm",),
        "knuckles": ("index_1", "middle_1", "pinky_1"),
    }.items():
        names = [f"{side}_{part}" for side in "lr" for part in parts]
        add(custom, "text", name=role, data=" ".join(names))
    for role, name in {"ball": "ball", "trunk": "torso", "head": "head"}.items():
        add(custom, "text", name=role, data=name)

    keyframe, upright = add(root, "keyframe"), vec(1, 0, 0, 0)
    for name, (fingers, pose) in KEYFRAMES.items():
        ctrl = [target(b, fingers, pose) for b in player[1:]]
        ball_at = pose.get("ball", (*BALL_XY, BALL_RADIUS))
        q = [Rotation.from_rotvec(t).as_quat(scalar_first=True) if len(t) == 3 else t for t in ctrl]
        qpos: list[Any] = [player[0].at, upright, *q, ball_at, upright]
        add(keyframe, "key", name=name, qpos=text(np.concatenate(qpos), 9),
            ctrl=text(np.concatenate(ctrl), 9))  # fmt: skip
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _contents(element: ET.Element, b: Body) -> None:
    """Joint, inertia, geoms and sites of a body."""
    if not b.parent:
        add(element, "freejoint", name=b.joint)
    else:
        axis = {} if JOINTS[b.drive][0] == "ball" else {"axis": text(b.axis, 9)}
        add(element, "joint", {"class": b.drive, "name": b.joint} | axis)
    com, inertia = b.inertia()
    full = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    add(element, "inertial", pos=com - b.at, mass=text(b.mass, 12), fullinertia=text(full, 12))
    for letter, g in zip("abc", b.geoms):
        name = b.name if len(b.geoms) == 1 else f"{b.name}_{letter}"
        shape: dict[str, Any] = {"class": g.colour, "name": name, "type": g.kind}
        if g.kind == "capsule":
            shape |= {"fromto": np.concatenate([g.a - b.at, g.b - b.at]), "size": g.radius}
        else:
            size = abs(g.b - g.a) / 2 if g.kind == "box" else g.radius
            shape |= {"pos": (g.a + g.b) / 2 - b.at, "size": size}
        add(element, "geom", shape)
    for name, p, z in b.sites:
        add(element, "site", name=name, pos=p - b.at, zaxis=z)


def write(path: str | Path | None = None) -> Path:
    """Write the MJCF file, by default the one beside this module; return its path."""
    path = Path(path or Path(__file__).with_name("player.xml"))
    path.write_text(mjcf(), encoding="utf-8", newline="\n")
    return path


if __name__ == "__main__":
    print(write())
