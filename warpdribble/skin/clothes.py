"""What the player wears, and its face: parts of the skin with their own colours, put on one upon another."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..sims.model import Model
from .flesh import (
    COLLAR,
    EYE,
    HAIR,
    HAIRLINE,
    IRIS,
    JERSEY,
    LIP,
    SHOE,
    SHORTS,
    SKIN,
    SOCK,
    SOLE,
    Lump,
    Plane,
    blob,
    cone,
    flip,
    is_player,
    other,
)
from .implicit import distance

UP, DOWN, LEFT, RIGHT = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)


@dataclass(frozen=True)
class Patch:
    """What lies in a primitive (everywhere, where there is none) but not in another, and where all planes
    hold; in the axes of a body in the zero pose."""

    region: str
    body: str
    within: Lump | None = None
    without: Lump | None = None
    planes: tuple[Plane, ...] = ()
    edge: float = 0.007
    """[m] how long edges along its border are at most."""

    def field(self, x: np.ndarray) -> np.ndarray:
        """Negative in the patch, 0 on its border, for points x (n, 3) in the axes of its body."""
        parts = [x @ np.asarray(normal) - offset for normal, offset in self.planes]
        parts += [distance(self.within, x)] if self.within else []
        parts += [-distance(self.without, x)] if self.without else []
        return np.asarray(np.max(parts, axis=0))

    def about(self, x: np.ndarray) -> np.ndarray:
        """Which of points x (n, 3) may be near its border; all, where planes alone say where that is."""
        if self.within is None:
            return np.arange(len(x))
        p, q = np.asarray(self.within.p), np.asarray(self.within.q)
        reach = 0.5 * np.abs(q - p) + max(self.within.r) * np.asarray(self.within.scale) + 0.02
        return np.flatnonzero(np.all(np.abs(x - 0.5 * (p + q)) < reach, axis=1))

    def mirrored(self) -> Patch:
        """The same on the other side of the body."""
        return replace(
            self,
            body=other(self.body),
            within=self.within and self.within.mirrored(),
            without=self.without and self.without.mirrored(),
            planes=tuple((flip(normal), offset) for normal, offset in self.planes),
        )


FRONT = ((-1.0, 0.0, 0.0), -0.03)
LID = (UP, 0.1262)


def disc(y: float, z: float, ry: float, rz: float) -> Lump:
    """What is seen as an ellipse from in front of the face."""
    return blob("head", (0.085, y, z), (0.050, ry, rz))


def feature(region: str, within: Lump, *planes: Plane, edge: float = 0.003, **more: Lump) -> Patch:
    return Patch(region, "head", within, planes=(FRONT, *planes), edge=edge, **more)


BROW = cone("head", (0.0, 0.015, 0.1415), (0.0, 0.043, 0.1430), 0.0042, 0.0028, scale=(40.0, 1.0, 1.0))
TRUNK = ((DOWN, 0.2328), (UP, 0.235), (LEFT, 0.22), (RIGHT, 0.22))

MIDDLE = [
    Patch(SOCK, "l_lower_leg", planes=((UP, -0.345),)),
    Patch(SHOE, "l_foot", planes=((COLLAR, 0.0405),)),
    Patch(SOLE, "l_foot", planes=((UP, -0.048),)),
    Patch(SHORTS, "pelvis", planes=((UP, 0.125), (DOWN, 0.398))),
    Patch(JERSEY, "torso", planes=TRUNK),
    Patch(SKIN, "torso", cone("torso", (-0.020, 0.0, 0.300), (0.045, 0.0, 0.150), 0.072, 0.066)),
    Patch(
        HAIR, "head", blob("head", (-0.006, 0.0, 0.156), (0.107, 0.087, 0.094)), planes=((HAIRLINE, -0.1075),)
    ),
    feature(LIP, disc(0.0, 0.065, 0.025, 0.012), without=disc(0.0, 0.071, 0.033, 0.0125)),
]
SIDE = [
    Patch(SKIN, "torso", blob("torso", (-0.010, 0.220, 0.080), (0.100, 0.100, 0.140))),
    Patch(SKIN, "head", blob("head", (-0.002, 0.080, 0.118), (0.0195, 0.0125, 0.0325)), edge=0.005),
    feature(HAIR, BROW),
    feature(HAIR, disc(0.0305, 0.1226, 0.0150, 0.0080)),
    feature(EYE, disc(0.0305, 0.1215, 0.0140, 0.0072), LID),
    feature(IRIS, disc(0.0300, 0.1222, 0.0064, 0.0064), LID, edge=0.002),
]
PLAYER = [*MIDDLE, *SIDE, *(patch.mirrored() for patch in SIDE)]
"""In the order in which they are put on: neckline and armholes are skin over the jersey."""


def of(model: Model) -> list[Patch]:
    """What a model wears: the player its clothes and face, others nothing."""
    return PLAYER if is_player(model) else []
