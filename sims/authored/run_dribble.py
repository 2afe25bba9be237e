"""Skill E written down: running straight ahead with a dribble of the right hand, a bounce every two steps.

The ball leaves the hand as the left foot lands, bounces beside that foot while it is on the ground, and comes
back to the hand as the right leg pushes off. The ground takes two fifths of the speed of a ball that does not
spin, so that the hand has to drive it forward as well as down: it meets the ball from behind and leaves it
from above.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from ..ball.flight import GRIP
from ..model import Model
from ..reference.reference import Reference
from .dribble import Dribble, Heights, bounce_of, fingers, stroke
from .gait import Gait, run
from .palm import place_palm
from .posture import Posture, Turn, Wave, hang, stand_up

POSTURE = Posture(
    pelvis=Turn(Wave(0.0, (5.0, 0.27)), Wave(8.0, twice=(1.5, 0.30)), Wave(0.0, (4.5, 0.38))),
    torso=Turn(Wave(-3.0, (16.0, 0.02)), Wave(28.0, twice=(1.5, 0.10)), Wave(1.0, (4.5, 0.12))),
    head=Turn(Wave(-2.0, (3.0, 0.05)), Wave(13.0, twice=(1.0, 0.12)), Wave(0.0, (1.5, 0.10))),
    shoulders=Wave(2.0, twice=(2.0, 0.30)),
)
GAIT = Gait()
STROKE = Dribble(hold=0.25, release_height=0.80, lowest_palm=0.81)
ARM, ELBOW = Wave(-24.0, (26.0, 0.42), (3.0, 0.2)), Wave(82.0, (12.0, 0.50))


@dataclass(frozen=True)
class RunDribble:
    """Numbers of the running dribble. Lengths in metres, angles in degrees."""

    gait: Gait = GAIT
    posture: Posture = POSTURE
    stroke: Dribble = STROKE
    """Its period is the gait's."""
    ahead: float = 0.26
    """The ball as it leaves the hand, ahead of the way's middle"""
    follow: float = 0.05
    """The hand goes on ahead so far after it."""
    side: tuple[float, float] = (-0.27, -0.33)
    """The ball as it leaves the hand, and as it meets it."""
    palm: tuple[float, ...] = (22.0, -18.0, 30.0, 42.0)
    """Tilt of the palm from down to ahead: as the ball leaves it, in its follow-through, on its way back, as
    it meets the ball."""
    arm: Wave = ARM
    """The free upper arm ahead"""
    out: float = 0.30
    """and outward, by so much of that which it is down"""
    elbow: Wave = ELBOW
    """and its elbow."""


def run_dribble(model: Model, style: RunDribble = RunDribble()) -> tuple[Reference, np.ndarray, np.ndarray]:
    """The run on the player, cyclic: reference, ball (frames, 3) [m], touch (frames, 2) bool. The clip begins
    as the left foot lands."""
    gait = style.gait
    steps = round(gait.period / model.timestep)
    times = np.arange(steps) * model.timestep
    gait = replace(gait, period=steps * model.timestep)
    style = replace(style, gait=gait, stroke=replace(style.stroke, period=gait.period))
    turns, radius = times / gait.period, model.ball_radius
    flight, height, palm = stroke(style.stroke, radius)
    ball, under = _ball(style, times, flight, height, palm, radius)
    ahead = gait.speed * times
    ball[:, 0] += ahead
    under[:, 0] += ahead
    joint_q = np.tile(fingers(model, 1.0), (steps, 1))
    stand_up(model, joint_q, style.posture, turns)
    tilt = np.radians(_tilt(style, flight, gait.period)(times))
    normal = np.column_stack([np.sin(tilt), 0.12 + 0.0 * tilt, -np.cos(tilt)])
    pointing = np.column_stack([np.cos(tilt), 0.30 + 0.0 * tilt, np.sin(tilt)])
    arm = np.radians(style.arm.at(turns))
    down = np.column_stack([np.sin(arm), np.full_like(arm, style.out), -np.cos(arm)])

    def arms(joint_q: np.ndarray) -> None:
        hang(model, joint_q, "l", down, style.elbow.at(turns), outward=-0.20)
        place_palm(model, joint_q, "r", under, normal, pointing, [0.35, -0.80, 0.50], radius)

    run(model, joint_q, gait, times, arms)
    held = (times >= flight - 1e-9) | (times == 0.0)
    joint_q, ball, held = (np.concatenate([rows, rows[:1]]) for rows in (joint_q, ball, held))
    for rows, along in ((joint_q, model.q_slice(model.root).start), (ball, 0)):
        rows[-1, along] += gait.speed * gait.period
    return Reference(joint_q, model.timestep), ball, np.column_stack([np.zeros_like(held), held])


def _ball(
    style: RunDribble, times: np.ndarray, flight: float, height: Heights, palm: Heights, radius: float
) -> tuple[np.ndarray, np.ndarray]:
    """Centres (frames, 3) [m] of the ball, and of one that lies under the palm, there or not; both without
    the way ahead."""
    period, speed = style.gait.period, style.gait.speed
    bounce = bounce_of(style.stroke, radius)
    gone, hold = float(bounce.along(flight)), period - flight
    # in the hand it gains evenly what the ground takes: on the whole it is as fast as the player
    first = speed * period / (gone + 0.5 * (1.0 + GRIP) * hold)
    fall, rise = first - speed, GRIP * first - speed
    caught = style.ahead + first * gone - speed * flight
    carried = CubicHermiteSpline([flight, period], [caught, style.ahead], [rise, fall])
    flown = style.ahead + first * bounce.along(times) - speed * times
    back = CubicHermiteSpline(
        [0.0, 0.3 * flight, flight], [style.ahead, style.ahead + style.follow, caught], [fall, 0.0, rise]
    )
    drift = (style.side[1] - style.side[0]) / flight
    inward = CubicHermiteSpline([flight, period], style.side[::-1], [drift, drift])
    free = times < flight
    side = np.where(free, style.side[0] + drift * times, inward(times))
    ball = np.column_stack([np.where(free, flown, carried(times)), side, height(times)])
    under = np.column_stack([np.where(free, back(times), carried(times)), side, palm(times) - radius])
    return ball, under


def _tilt(style: RunDribble, flight: float, period: float) -> CubicSpline:
    """[degrees] of the palm, as a function of the time since the ball left it."""
    leave, snap, back, meet = style.palm
    at = [0.0, 0.25 * flight, 0.75 * flight, flight, period]
    return CubicSpline(at, [leave, snap, back, meet, leave], bc_type="periodic")
