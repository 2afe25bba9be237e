"""Skill C written down: the ball goes round the waist, from hand to hand in front and behind.

The ball runs on an oval about the hips. The right hand takes it from behind along the right side to
the front, the left hand on along the left side; the hand that has given it away swings back to where it comes
from.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ..model import Model
from ..reference.reference import Reference
from .breath import Breath
from .dribble import Dribble, fingers, legs, trunk
from .palm import MIRROR, place_palm

STANCE = Dribble(
    pelvis_height=0.885,
    pelvis_back=0.02,
    lean=(3.0, 4.0, 4.0),
    pelvis_left=0.0,
    tilt=0.0,
    breath=Breath(
        up=(0.010, 0.0),
        forward=(0.012, 0.5),
        left=(0.018, 0.75),
        pelvis=(1.5, 0.0),
        torso=(3.5, 0.0),
        yaw=(3.0, 0.80),
        roll=(2.0, 0.25),
        head=(1.5, 0.0),
        face=(3.0, 0.15),
        shoulders=(2.5, 0.0),
    ),
    feet=((0.0, 0.17, 14.0), (0.0, -0.17, -14.0)),
    gaze=8.0,
)


@dataclass(frozen=True)
class Waist:
    """Numbers of the authored circle. Lengths in metres, times in seconds."""

    period: float = 0.9
    oval: tuple[float, float] = (0.30, 0.33)
    """Half axes of the ball's way: ahead, to the side."""
    middle: float = -0.02
    """The oval's middle, forward of the middle between the feet."""
    height: float = 0.99
    shared: float = 0.10
    """[s] around the front and the back in which both hands have the ball."""
    aside: float = 0.05
    """An empty hand keeps this much farther out."""
    palm: dict[str, tuple[np.ndarray, np.ndarray]] = field(
        default_factory=lambda: {
            "normal": (np.array([-0.25, 1.0, 0.45]), np.array([0.35, 1.0, 0.5])),
            "fingers": (np.array([0.85, 0.15, -0.35]), np.array([-0.45, 0.35, -0.8])),
            "elbow": (np.array([0.59, -0.66, 0.36]), np.array([0.85, -0.26, -0.56])),
        }
    )
    """Of the right hand, in front and behind: the palm's normal, where its fingers point, the elbow's axis. A
    hand keeps to its own side of the ball, a little under it."""
    stance: Dribble = STANCE


def waist(model: Model, style: Waist = Waist()) -> tuple[Reference, np.ndarray, np.ndarray]:
    """The circle on the player, cyclic: reference, ball (frames, 3) [m], touch (frames, 2) bool. The clip
    begins with the ball in front; it goes to the left first."""
    steps = round(style.period / model.timestep)
    times = np.arange(steps + 1) * model.timestep
    period, radius = steps * model.timestep, model.ball_radius
    angle = 2.0 * np.pi * times / period
    joint_q = np.tile(fingers(model, 0.7, "lr"), (steps + 1, 1))
    trunk(model, joint_q, style.stance, times / period)
    legs(model, joint_q, style.stance)
    ball, _ = _oval(style, angle)
    touch = np.zeros((steps + 1, 2), bool)
    for hand, (side, middle) in enumerate((("l", 0.25), ("r", 0.75))):
        own = (times / period - middle + 0.5) % 1.0 - 0.5  # 0 where the ball passes the hand's side
        reach = 0.25 + 0.5 * style.shared / period
        touch[:, hand] = np.abs(own) <= reach + 1e-9
        way = 2.0 * np.pi * (middle + _hand(own, reach))
        centre, outward = _oval(style, way)
        away = np.clip((np.abs(own) - reach) / (0.5 - reach), 0.0, 1.0)
        centre = centre + (style.aside * (1.0 - (1.0 - away) ** 2))[:, None] * outward
        behind = 0.5 - 0.5 * np.cos(way)[:, None]
        normal, pointing, elbow = (front + behind * (back - front) for front, back in style.palm.values())
        if side == "l":
            normal, pointing = normal * MIRROR, pointing * MIRROR
        place_palm(model, joint_q, side, centre, normal, pointing, elbow, radius)
    joint_q[-1] = joint_q[0]
    return Reference(joint_q, model.timestep), ball, touch


def _oval(style: Waist, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 3) [m] on the ball's way and the directions (n, 3) out of it; angle 0 is in front."""
    a, b = style.oval
    place = np.column_stack([style.middle + a * np.cos(angle), b * np.sin(angle), 0.0 * angle + style.height])
    out = np.column_stack([b * np.cos(angle), a * np.sin(angle), 0.0 * angle])
    return place, out / np.linalg.norm(out, axis=1, keepdims=True)


def _hand(own: np.ndarray, reach: float) -> np.ndarray:
    """Where a hand is on the way, in turns from its side, at a time `own` (n,) in turns of the ball: with the
    ball up to `reach`, then back."""
    back = CubicHermiteSpline([reach, 1.0 - reach], [reach, -reach], [1.0, 1.0])
    late = np.where(own < 0.0, own + 1.0, own)
    return np.where(np.abs(own) <= reach, own, back(np.clip(late, reach, 1.0 - reach)))
