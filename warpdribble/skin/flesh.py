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
EYE, IRIS, LIP = "eye", "iris", "lip"
Vector = tuple[float, float, float]
Plane = tuple[Vector, float]
"""normal, offset [m]: where normal . x <= offset"""


@dataclass(frozen=True)
class Lump:
    """A primitive of a body: points nearer than r to the segment p q, in coordinates divided by `scale`.

    The radius goes from r[0] at p to r[1] at q. `cut`: only where it holds, the edge rounded by `hem`.
    """

    body: str
    p: Vector
    q: Vector
    r: tuple[float, float]
    region: str = SKIN
    blend: float = 0.012
    """[m] how far the surface flows into its neighbours'."""
    scale: Vector = (1.0, 1.0, 1.0)
    cut: Plane | None = None
    hem: float = 0.004
    """[m]"""

    def mirrored(self) -> Lump:
        """The same on the other side of the body."""
        cut = self.cut and (flip(self.cut[0]), self.cut[1])
        return replace(self, body=other(self.body), p=flip(self.p), q=flip(self.q), cut=cut)


def cone(body: str, p: Vector, q: Vector, rp: float, rq: float, **more: Any) -> Lump:
    return Lump(body, p, q, (rp, rq), **more)


def blob(body: str, centre: Vector, radii: Vector, **more: Any) -> Lump:
    """An ellipsoid."""
    return Lump(body, centre, centre, (1.0, 1.0), scale=radii, **more)


def flat(share: float) -> dict[str, Any]:
    """Options of a cone in the palm: so thick, for its width."""
    return {"blend": 0.004, "scale": (1.0, 1.0, share)}


def flip(v: Vector) -> Vector:
    """A point or direction on the other side of the body."""
    return (v[0], -v[1], v[2])


def other(body: str) -> str:
    """The name of the body on the other side; that of one in the middle is its own."""
    return "r" + body[1:] if body.startswith("l_") else body


SOLE_CUT = ((0.0, 0.0, -1.0), 0.064)
TOE_CUT = ((0.0, 0.0, -1.0), 0.0205)
HAIRLINE = (0.549, 0.0, -0.836)
HAIR_CUT = (HAIRLINE, -0.110)
COLLAR = (0.25, 0.0, 1.0)
SHOE_CUT = (COLLAR, 0.038)

# fmt: off
MIDDLE = [
    blob("pelvis", (-0.005, 0.0, 0.062), (0.098, 0.148, 0.098)),
    blob("lower_back", (0.0, 0.0, 0.03), (0.092, 0.136, 0.10)),
    blob("lower_back", (0.0, 0.0, 0.13), (0.094, 0.132, 0.13)),
    blob("torso", (-0.006, 0.0, 0.02), (0.104, 0.150, 0.15)),
    blob("torso", (-0.034, 0.0, 0.09), (0.074, 0.140, 0.085)),
    cone("head", (-0.018, 0.0, -0.06), (-0.004, 0.0, 0.06), 0.054, 0.050),
    blob("head", (-0.004, 0.0, 0.150), (0.092, 0.073, 0.086), blend=0.006),
    blob("head", (0.028, 0.0, 0.105), (0.062, 0.056, 0.082), blend=0.008),
    blob("head", (0.050, 0.0, 0.040), (0.034, 0.036, 0.024), blend=0.010),
    blob("head", (-0.006, 0.0, 0.156), (0.100, 0.080, 0.087), blend=0.004, cut=HAIR_CUT, hem=0.005),
    cone("head", (0.084, 0.0, 0.122), (0.097, 0.0, 0.092), 0.006, 0.0105, blend=0.005),
    blob("head", (0.083, 0.0, 0.062), (0.008, 0.022, 0.010), blend=0.006),
]

SIDE = [
    blob("pelvis", (-0.052, 0.062, 0.0), (0.068, 0.076, 0.085)),
    blob("torso", (0.044, 0.062, 0.062), (0.058, 0.078, 0.066)),
    cone("torso", (-0.024, 0.030, 0.200), (-0.012, 0.145, 0.140), 0.040, 0.036),
    blob("torso", (-0.02, 0.105, 0.02), (0.068, 0.052, 0.105)),
    blob("head", (-0.002, 0.074, 0.118), (0.017, 0.008, 0.030), blend=0.003),
    blob("head", (0.071, 0.031, 0.122), (0.0125, 0.0145, 0.0125), blend=0.003),
    cone("l_clavicle", (-0.008, 0.02, -0.004), (-0.002, 0.130, 0.0), 0.044, 0.046),
    blob("l_upper_arm", (0.0, 0.022, 0.002), (0.050, 0.070, 0.053)),
    cone("l_upper_arm", (0.0, 0.03, 0.0), (0.0, 0.291, 0.0), 0.043, 0.035),
    blob("l_upper_arm", (0.013, 0.165, 0.0), (0.031, 0.085, 0.032)),
    blob("l_upper_arm", (-0.013, 0.145, 0.0), (0.032, 0.090, 0.034)),
    cone("l_lower_arm", (0.0, 0.0, 0.0), (0.0, 0.278, 0.0), 0.034, 0.026, scale=(1.0, 1.0, 0.86)),
    blob("l_lower_arm", (0.002, 0.070, 0.0), (0.038, 0.085, 0.036)),
    cone("l_hand", (0.014, 0.020, 0.0), (0.022, 0.086, 0.0), 0.020, 0.020, **flat(0.62)),
    cone("l_hand", (-0.010, 0.020, 0.0), (-0.021, 0.076, 0.0), 0.020, 0.019, **flat(0.58)),
    cone("l_hand", (0.0, 0.010, 0.0), (0.0, 0.085, 0.0), 0.022, 0.022, **flat(0.56)),
    blob("l_hand", (0.027, 0.036, -0.007), (0.014, 0.026, 0.011), blend=0.004),
    cone("l_hand", (0.0, -0.012, 0.0), (0.0, 0.012, 0.0), 0.026, 0.026, blend=0.008, scale=(1.0, 1.0, 0.72)),
    cone("l_upper_leg", (0.0, -0.004, -0.06), (0.0, 0.0, -0.4365), 0.080, 0.052),
    cone("l_upper_leg", (0.0, 0.006, -0.03), (0.004, 0.020, -0.37), 0.088, 0.078, blend=0.006,
         cut=((0.0, 0.0, -1.0), 0.395), hem=0.006),
    blob("l_lower_leg", (0.010, 0.0, 0.0), (0.050, 0.052, 0.062)),
    cone("l_lower_leg", (0.0, 0.0, -0.02), (-0.004, 0.0, -0.455), 0.050, 0.034),
    blob("l_lower_leg", (-0.020, 0.0, -0.135), (0.046, 0.048, 0.125)),
    cone("l_foot", (-0.016, 0.0, 0.030), (-0.016, 0.0, -0.015), 0.041, 0.041, blend=0.006, cut=SHOE_CUT),
    cone("l_foot", (0.0, 0.0, -0.010), (0.112, 0.0, -0.038), 0.040, 0.032, blend=0.010, cut=SOLE_CUT),
    cone("l_foot", (-0.022, 0.0, -0.048), (0.100, 0.0, -0.048), 0.044, 0.047, blend=0.006, cut=SOLE_CUT,
         scale=(1.0, 1.0, 0.62)),
    blob("l_toes", (0.018, 0.0, -0.004), (0.062, 0.049, 0.034), blend=0.008, cut=TOE_CUT),
]
# fmt: on

PLAYER = [*MIDDLE, *SIDE, *(lump.mirrored() for lump in SIDE)]


def wide_joints(model: Model) -> dict[str, float]:
    """Bodies whose joints turn far, and the distance [m] from these within which the skin gives way."""
    if not is_player(model):
        return {}
    reach = {"upper_arm": 0.20, "upper_leg": 0.20, "lower_leg": 0.13}
    return {f"{side}_{body}": within for side in "lr" for body, within in reach.items()}


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
        EYE: (0.95, 0.95, 0.94),
        IRIS: (0.10, 0.06, 0.04),
        LIP: (0.52, 0.24, 0.20),
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
        return blob(
            name, _vector(shape.pos), _vector(np.abs(radii)), region=_region(name, shape), blend=0.004
        )
    reach = float(shape.size[1]) if shape.kind == "capsule" else 0.0
    radius = float(shape.size[0])
    blend = min(0.012, 0.35 * radius)
    return cone(
        name,
        _vector(shape.pos - reach * axis),
        _vector(shape.pos + reach * axis),
        radius,
        0.9 * radius,
        region=_region(name, shape),
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
