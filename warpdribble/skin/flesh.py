"""What a player looks like: rounded primitives on its bodies, that flow into one surface.

Written in the axes of each body, which in the zero pose stand like the world's: X forward, Y left, Z up. The
left side is written, the right is its mirror image. Proportions follow the shapes that collide, so that what
is seen touches where the simulation touches; the rest was shaped by eye.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..assets import path as asset
from ..sims.model import Model, Shape

SKIN, HAIR, JERSEY, SHORTS, SOCK, SHOE, SOLE = "skin", "hair", "jersey", "shorts", "sock", "shoe", "sole"
Vector = tuple[float, float, float]
Plane = tuple[Vector, float]
"""normal, offset [m]"""
Border = tuple[str, Vector, float]
"""region, normal, offset [m]"""


@dataclass(frozen=True)
class Lump:
    """A primitive of a body: points nearer than r to the segment p q, in coordinates divided by `scale`.

    The radius goes from r[0] at p to r[1] at q. `cut` (normal, offset): only where normal . x <= offset.
    `paint`: ((region, normal, offset), ...): that region where normal . x > offset, the last that holds.
    """

    body: str
    region: str
    p: Vector
    q: Vector
    r: tuple[float, float]
    blend: float = 0.012
    """[m] how far the surface flows into its neighbours'."""
    scale: Vector = (1.0, 1.0, 1.0)
    cut: Plane | None = None
    paint: tuple[Border, ...] = ()
    fold: bool = False
    """Whether `paint` goes by |y|: for lumps in the middle."""

    def mirrored(self) -> Lump:
        """The same on the other side of the body."""

        def flip(v: Vector) -> Vector:
            return (v[0], -v[1], v[2])

        name = "r" + self.body[1:] if self.body.startswith("l_") else self.body
        return replace(
            self,
            body=name,
            p=flip(self.p),
            q=flip(self.q),
            cut=self.cut and (flip(self.cut[0]), self.cut[1]),
            paint=tuple((region, flip(n), c) for region, n, c in self.paint),
        )


def cone(body: str, region: str, p: Vector, q: Vector, rp: float, rq: float, **more: Any) -> Lump:
    return Lump(body, region, p, q, (rp, rq), **more)


def blob(body: str, region: str, centre: Vector, radii: Vector, **more: Any) -> Lump:
    """An ellipsoid."""
    return Lump(body, region, centre, centre, (1.0, 1.0), scale=radii, **more)


SOLE_CUT = ((0.0, 0.0, -1.0), 0.064)
TOE_CUT = ((0.0, 0.0, -1.0), 0.0205)
RUBBER = ((SOLE, (0.0, 0.0, -1.0), 0.048),)
TOE_RUBBER = ((SOLE, (0.0, 0.0, -1.0), 0.004),)
HAIRLINE = ((HAIR, (-0.549, 0.0, 0.836), 0.108),)


def _plane(region: str, normal: Vector, offset: float, origin: Vector) -> Border:
    """A border that is written in the torso's axes, in those of a body that stands at `origin` of the
    torso."""
    return (region, normal, offset - float(np.dot(normal, origin)))


def _shirt(x: float, y: float, z: float) -> tuple[Border, Border]:
    """Neckline and armhole of a jersey, for a body at (x, y, z) of the torso; the same planes for all."""
    at = (x, y, z)
    return _plane(SKIN, (0.45, -0.35, 0.85), 0.153, at), _plane(SKIN, (0.0, 0.8, 0.6), 0.21, at)


TORSO = _shirt(0.0, 0.0, 0.0)
CLAVICLE = _shirt(0.0, 0.03, 0.10644)
ARM = (_plane(JERSEY, (0.0, -0.8, -0.6), -0.21, (0.0, 0.186799, 0.10644)),)
WAIST = ((JERSEY, (0.0, 0.0, 1.0), 0.125),)
BELT = ((SHORTS, (0.0, 0.0, -1.0), 0.0193),)
HEM = ((SHORTS, (0.0, 0.0, 1.0), -0.398),)
KNEE = ((SHORTS, (0.0, 0.0, 1.0), 0.0385),)

# fmt: off
MIDDLE = [
    blob("pelvis", SHORTS, (-0.005, 0.0, 0.062), (0.098, 0.148, 0.098), paint=WAIST),
    blob("lower_back", JERSEY, (0.0, 0.0, 0.03), (0.092, 0.136, 0.10), paint=BELT),
    blob("lower_back", JERSEY, (0.0, 0.0, 0.13), (0.094, 0.132, 0.13), paint=BELT),
    blob("torso", JERSEY, (-0.006, 0.0, 0.02), (0.104, 0.150, 0.15), paint=TORSO, fold=True),
    blob("torso", JERSEY, (-0.034, 0.0, 0.09), (0.074, 0.140, 0.085), paint=TORSO, fold=True),
    cone("head", SKIN, (-0.018, 0.0, -0.06), (-0.004, 0.0, 0.06), 0.054, 0.050),
    blob("head", SKIN, (-0.004, 0.0, 0.150), (0.092, 0.073, 0.086), blend=0.006, paint=HAIRLINE),
    blob("head", SKIN, (0.028, 0.0, 0.105), (0.062, 0.056, 0.082), blend=0.008, paint=HAIRLINE),
    blob("head", SKIN, (0.050, 0.0, 0.040), (0.034, 0.036, 0.024), blend=0.010),
    blob("head", HAIR, (-0.012, 0.0, 0.156), (0.096, 0.080, 0.085), blend=0.003, cut=((0.549, 0.0, -0.836),
         -0.110)),
    cone("head", SKIN, (0.088, 0.0, 0.122), (0.101, 0.0, 0.090), 0.006, 0.011, blend=0.005),
    blob("head", SKIN, (0.083, 0.0, 0.062), (0.010, 0.020, 0.007), blend=0.004),
]
# fmt: on

# fmt: off
SIDE = [
    blob("pelvis", SHORTS, (-0.052, 0.062, 0.0), (0.068, 0.076, 0.085)),
    blob("torso", JERSEY, (0.044, 0.062, 0.062), (0.058, 0.078, 0.066), paint=TORSO),
    cone("torso", JERSEY, (-0.024, 0.030, 0.200), (-0.012, 0.145, 0.140), 0.040, 0.036, paint=TORSO),
    blob("torso", JERSEY, (-0.02, 0.105, 0.02), (0.068, 0.052, 0.105), paint=TORSO),
    blob("head", SKIN, (-0.002, 0.074, 0.118), (0.017, 0.008, 0.030), blend=0.003),
    blob("head", HAIR, (0.079, 0.031, 0.137), (0.012, 0.015, 0.0035), blend=0.001),
    cone("l_clavicle", JERSEY, (-0.008, 0.02, -0.004), (-0.002, 0.130, 0.0), 0.044, 0.046, paint=CLAVICLE),
    blob("l_upper_arm", SKIN, (0.0, 0.022, 0.002), (0.050, 0.070, 0.053), paint=ARM),
    cone("l_upper_arm", SKIN, (0.0, 0.03, 0.0), (0.0, 0.291, 0.0), 0.043, 0.035, paint=ARM),
    blob("l_upper_arm", SKIN, (0.013, 0.165, 0.0), (0.031, 0.085, 0.032)),
    blob("l_upper_arm", SKIN, (-0.013, 0.145, 0.0), (0.032, 0.090, 0.034)),
    cone("l_lower_arm", SKIN, (0.0, 0.0, 0.0), (0.0, 0.278, 0.0), 0.034, 0.026, scale=(1.0, 1.0, 0.86)),
    blob("l_lower_arm", SKIN, (0.002, 0.070, 0.0), (0.038, 0.085, 0.036)),
    cone("l_hand", SKIN, (0.014, 0.020, 0.0), (0.022, 0.086, 0.0), 0.020, 0.020, blend=0.004, scale=(1.0, 1.0,
         0.62)),
    cone("l_hand", SKIN, (-0.010, 0.020, 0.0), (-0.021, 0.076, 0.0), 0.020, 0.019, blend=0.004, scale=(1.0,
         1.0, 0.58)),
    cone("l_hand", SKIN, (0.0, 0.010, 0.0), (0.0, 0.085, 0.0), 0.022, 0.022, blend=0.004, scale=(1.0, 1.0,
         0.56)),
    blob("l_hand", SKIN, (0.027, 0.036, -0.007), (0.014, 0.026, 0.011), blend=0.004),
    cone("l_hand", SKIN, (0.0, -0.012, 0.0), (0.0, 0.012, 0.0), 0.026, 0.026, blend=0.008, scale=(1.0, 1.0,
         0.72)),
    cone("l_upper_leg", SKIN, (0.0, -0.004, -0.06), (0.0, 0.0, -0.4365), 0.080, 0.052, paint=HEM),
    cone("l_upper_leg", SKIN, (0.0, 0.006, -0.03), (0.004, 0.020, -0.37), 0.088, 0.078, blend=0.006,
         cut=((0.0, 0.0, -1.0), 0.395), paint=HEM),
    blob("l_lower_leg", SKIN, (0.010, 0.0, 0.0), (0.050, 0.052, 0.062), paint=KNEE),
    cone("l_lower_leg", SKIN, (0.0, 0.0, -0.02), (-0.004, 0.0, -0.455), 0.050, 0.034, paint=(*KNEE, (SOCK,
         (0.0, 0.0, -1.0), 0.345))),
    blob("l_lower_leg", SKIN, (-0.020, 0.0, -0.135), (0.046, 0.048, 0.125)),
    cone("l_foot", SHOE, (-0.016, 0.0, 0.030), (-0.016, 0.0, -0.03), 0.041, 0.041, blend=0.006, cut=((0.25,
         0.0, 1.0), 0.038)),
    cone("l_foot", SHOE, (0.0, 0.0, -0.010), (0.112, 0.0, -0.038), 0.040, 0.032, blend=0.010, cut=SOLE_CUT,
         paint=RUBBER),
    cone("l_foot", SHOE, (-0.022, 0.0, -0.048), (0.100, 0.0, -0.048), 0.044, 0.047, blend=0.006, scale=(1.0,
         1.0, 0.62), cut=SOLE_CUT, paint=RUBBER),
    blob("l_toes", SHOE, (0.018, 0.0, -0.004), (0.062, 0.049, 0.034), blend=0.008, cut=TOE_CUT,
         paint=TOE_RUBBER),
]
# fmt: on

PLAYER = [*MIDDLE, *SIDE, *(lump.mirrored() for lump in SIDE)]


def of(model: Model) -> list[Lump]:
    """The primitives of a model: the player's, and for every other body its own shapes."""
    drawn = [lump for lump in PLAYER if lump.body in model.body_names] if is_player(model) else []
    covered = {lump.body for lump in drawn}
    balls = ball_bodies(model)
    for shape in model.shapes:
        name = model.body_names[shape.body]
        if shape.body >= 0 and shape.body not in balls and name not in covered and shape.kind != "plane":
            drawn.append(_of_shape(name, shape))
    return drawn


def colours(model: Model) -> dict[str, Vector]:
    """Colour of each region, as far as it can be told from the model's own."""
    named = {s.name: _vector(s.rgba[:3]) for s in model.shapes}
    own = {f"shape {name}": colour for name, colour in named.items()}
    return own | {
        SKIN: named.get("l_hand", (0.80, 0.60, 0.47)),
        HAIR: named.get("head_b", (0.18, 0.13, 0.10)),
        JERSEY: named.get("torso_a", (0.85, 0.20, 0.18)),
        SHORTS: named.get("pelvis", (0.16, 0.22, 0.42)),
        SHOE: named.get("l_foot", (0.93, 0.93, 0.95)),
        SOCK: (0.90, 0.90, 0.90),
        SOLE: (0.30, 0.31, 0.34),
    }


def ball_bodies(model: Model) -> set[int]:
    """Bodies that are no part of a player."""
    return model.named_bodies("ball") | {b for b, name in enumerate(model.body_names) if name == "ball"}


def is_player(model: Model) -> bool:
    """Whether it is the model that the primitives were shaped for; another of the same names has other
    sizes."""
    return model.path.resolve() == asset("player.xml").resolve()


def _of_shape(name: str, shape: Shape) -> Lump:
    axis = Rotation.from_quat(shape.quat).apply([0.0, 0.0, 1.0])
    if shape.kind == "box":
        half = np.asarray(shape.size[:3], float)
        radii = Rotation.from_quat(shape.quat).apply(half * 1.25)
        return blob(name, _region(name, shape), _vector(shape.pos), _vector(np.abs(radii)), blend=0.004)
    reach = float(shape.size[1]) if shape.kind == "capsule" else 0.0
    radius = float(shape.size[0])
    blend = min(0.012, 0.35 * radius)
    return cone(
        name,
        _region(name, shape),
        _vector(shape.pos - reach * axis),
        _vector(shape.pos + reach * axis),
        radius,
        0.9 * radius,
        blend=blend,
    )


def _vector(values: np.ndarray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def _region(name: str, shape: Shape) -> str:
    return (
        SKIN
        if name[2:].partition("_")[0] in ("thumb", "index", "middle", "ring", "pinky")
        else (f"shape {shape.name}")
    )
