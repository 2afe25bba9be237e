"""Skill D written down: dribbling in place from hand to hand, in front of the body.

One half of the cycle is the mirror image of the other: the right hand pushes the ball across, the left one
meets it, carries it up and out and pushes it back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ..model import Model
from ..reference.mirror import mirrored
from ..reference.reference import Reference
from .breath import Breath
from .dribble import Dribble, Heights, fingers, legs, stroke, trunk
from .palm import place_palm, shift

STANCE = Dribble(
    period=0.75,
    hold=0.27,
    release_height=0.72,
    lowest_palm=0.72,
    pelvis_height=0.82,
    pelvis_back=0.09,
    lean=(16.0, 16.0, 14.0),
    pelvis_left=0.0,
    tilt=0.0,
    breath=Breath(up=(0.030, 0.60), pelvis=(3.0, 0.65), left=(0.010, 0.25)),
    feet=((0.0, 0.20, 16.0), (0.0, -0.20, -16.0)),
)


@dataclass(frozen=True)
class Switch:
    """Numbers of the authored change of hands. Lengths in metres, times in seconds."""

    ahead: float = 0.40
    wide: float = 0.20
    """Where the ball leaves and meets the hands, to each side."""
    wait: float = 0.78
    """Height of the empty palm that waits."""
    stance: Dribble = STANCE


def switch(model: Model, style: Switch = Switch()) -> tuple[Reference, np.ndarray, np.ndarray]:
    """The change of hands on the player, cyclic: reference, ball (frames, 3) [m], touch (frames, 2) bool. The
    clip begins as the ball leaves the right hand."""
    half = round(style.stance.period / model.timestep)
    stance = replace(style.stance, period=half * model.timestep)
    times = np.arange(2 * half + 1) * model.timestep
    period, radius = stance.period, model.ball_radius
    flight, height, palm = stroke(stance, radius)
    ball = np.empty((len(times), 3))
    ball[:, 0] = style.ahead
    ball[:, 1] = _across(style, times, period, flight)
    ball[:, 2] = height(times % period)

    joint_q = np.tile(fingers(model, 1.0, "lr"), (len(times), 1))
    trunk(model, joint_q, stance, times / period, sideways=0.5)
    legs(model, joint_q, stance)
    late = 2.0 * period - (period - flight)  # the right hand has the ball from here to the end
    centre, normal = _right_palm(style, times, ball, palm, period, flight, late, radius)
    pointing = np.array([1.0, 0.35, -0.25])
    place_palm(model, joint_q, "r", centre, normal, pointing, [0.35, -0.8, 0.5], radius)
    other = shift(mirrored(model, Reference(joint_q, model.timestep)).joint_q, half)
    for joint in ("l_shoulder", "l_elbow", "l_wrist"):
        joint_q[:, model.q_slice(joint)] = other[:, model.q_slice(joint)]
    joint_q[-1] = joint_q[0]
    held = np.column_stack([(times >= flight) & (times <= period), (times >= late) | (times == 0.0)])
    return Reference(joint_q, model.timestep), ball, held


def _across(style: Switch, times: np.ndarray, period: float, flight: float) -> np.ndarray:
    """[m] to the left: straight in flight, out and back in a hand."""
    speed, hold = 2.0 * style.wide / flight, period - flight
    t = times % period
    share = np.clip((t - flight) / hold, 0.0, 1.0)
    side = np.where(t < flight, -style.wide + speed * t, style.wide + speed * hold * (share - share**2))
    return np.where((times // period).astype(int) % 2 == 0, side, -side)


def _right_palm(
    style: Switch,
    times: np.ndarray,
    ball: np.ndarray,
    palm: Heights,
    period: float,
    flight: float,
    late: float,
    radius: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Centre (frames, 3) [m] of a ball under the right palm, there or not, and the palm's normal."""
    speed = 2.0 * style.wide / flight
    top, step = float(ball[0, 2]), 1e-4
    down = float((palm(np.array(2e-4)) - palm(np.array(1e-4))) / step)
    catch = float(palm(np.array(flight + step))) - radius
    rise = float((palm(np.array(flight + 2 * step)) - palm(np.array(flight + step))) / step)
    low = style.stance.lowest_palm - radius
    up = CubicHermiteSpline(
        [0.0, 2.0 * (top - low) / -down, period, late],
        [top, low, style.wait - radius, catch],
        [down, 0.0, 0.0, rise],
    )
    side = CubicHermiteSpline(
        [0.0, 0.16, period, late],
        [-style.wide, -style.wide + 0.04, -style.wide - 0.05, -style.wide],
        [speed, 0.0, 0.0, -speed],
    )
    own = times >= late
    centre = ball.copy()
    empty = np.minimum(times, late)
    centre[:, 1] = np.where(own, ball[:, 1], side(empty))
    centre[:, 2] = np.where(own, ball[:, 2], up(empty))
    lean = 0.30 + 0.0 * times
    normal = np.column_stack([0.05 + 0.0 * times, lean, -1.0 + 0.0 * times])
    return centre, normal
