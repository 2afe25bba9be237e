"""Skill A written down: standing, both hands on the ball, swinging it from side to side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model import Model
from ..reference.reference import Reference
from .breath import Breath
from .dribble import Dribble, fingers, legs, trunk
from .palm import place_palm

STANCE = Dribble(
    pelvis_height=0.875,
    pelvis_back=0.03,
    lean=(6.0, 7.0, 6.0),
    pelvis_left=0.0,
    tilt=0.0,
    breath=Breath(
        up=(0.008, 0.5),
        forward=(0.004, 0.0),
        left=(0.020, 0.45),
        pelvis=(1.0, 0.5),
        torso=(1.0, 0.0),
        yaw=(12.0, 0.5),
        roll=(-2.0, 0.45),
        head=(0.8, 0.5),
        face=(8.0, 0.55),
        shoulders=(2.5, 0.5),
    ),
    feet=((0.02, 0.16, 12.0), (0.02, -0.16, -12.0)),
)


@dataclass(frozen=True)
class Carry:
    """Numbers of the authored swing. Lengths in metres, times in seconds, angles in degrees."""

    period: float = 1.5
    reach: float = 0.40
    """The ball in front of the middle between the feet."""
    swing: float = 0.20
    """To each side."""
    height: float = 0.96
    rise: float = 0.05
    """Higher at the ends of the swing."""
    yaw: float = 20.0
    """The ball, and the hands with it, turn with the swing."""
    stance: Dribble = STANCE


def carry(model: Model, style: Carry = Carry()) -> tuple[Reference, np.ndarray, np.ndarray]:
    """The swing on the player, cyclic: reference, ball (frames, 3) [m], touch (frames, 2) bool."""
    steps = round(style.period / model.timestep)
    phase = 2.0 * np.pi * np.arange(steps + 1) / steps
    joint_q = np.tile(fingers(model, 0.6, "lr"), (steps + 1, 1))
    trunk(model, joint_q, style.stance, phase / np.pi, sideways=0.5)
    legs(model, joint_q, style.stance)
    side = np.sin(phase)
    yaw = np.radians(style.yaw) * side
    ball = np.column_stack(
        [style.reach - 0.04 * side**2, style.swing * side, style.height + style.rise * side**2]
    )
    ahead = np.column_stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)])
    left = np.column_stack([-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)])
    for name, sign in (("r", 1.0), ("l", -1.0)):
        normal = sign * left - 0.18 * ahead + [0.0, 0.0, 0.15]
        pointing = ahead - [0.0, 0.0, 0.35]
        place_palm(model, joint_q, name, ball, normal, pointing, [0.25, -0.75, 0.6], model.ball_radius)
    joint_q[-1] = joint_q[0]
    return Reference(joint_q, model.timestep), ball, np.ones((steps + 1, 2), bool)
