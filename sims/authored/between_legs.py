"""Dribbling in place between the legs written down: the left foot well in front, the ball from the right hand
in front through the legs to the left hand behind, and back.

The palms are outside the ball and swing it as a pendulum. A ball that palms only press down, as in the other
dribbles, would fly as high as the chest in so long a time.

The centre of mass stays between the feet, nearly at rest, and the pelvis moves against ball and trunk.

Measured on BallPlay-M's 044 lleg_2, put on the player; lengths in cm, angles in degrees:

| | lleg_2 | here |
|---|---|---|
| cycle [s] | 1.47 | 1.45 |
| ankles apart, ahead and to the side | 75, 73 | 68, 52 |
| pelvis' height, and half of its way, twice a cycle | 70, 4 | 72, 3 |
| ball at its highest in the right hand, ahead of the pelvis, to the left, up | 44, -33, 68 | 54, -36, 75 |
| in the left hand | -19, 49, 62 | -18, 48, 75 |
| pelvis' and trunk's turn to the left, most with the ball in the left hand | 14, 24 | 12, 24 |
| torso bent by | 80 | 75 |
| centre of mass before the line from ankle to ankle | 5.5 | 5.6 |
| heel of the foot behind risen by | 0 to 24 | 6 to 22 |
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from ..ball.flight import GRAVITY, GRIP, Bounce
from ..model import Model
from ..reference.reference import Reference
from .balance import balance
from .dribble import fingers
from .feet import place_foot, planted
from .palm import place_palm
from .posture import Posture, Turn, Wave, stand_up

LEFT = 0.34
"""When the left hand has the ball highest, in cycles."""
POSTURE = Posture(
    pelvis=Turn(Wave(0.0, (12.0, LEFT)), Wave(18.0, (7.0, LEFT + 0.5), (2.0, 0.05)), Wave(-3.0, (2.0, LEFT))),
    torso=Turn(
        Wave(8.0, (24.0, LEFT - 0.03)), Wave(75.0, (3.0, LEFT), (3.0, 0.05)), Wave(0.0, (8.0, LEFT + 0.47))
    ),
    head=Turn(Wave(2.0, (14.0, LEFT)), Wave(48.0, (2.0, LEFT), (2.0, 0.05)), Wave(0.0, (3.0, LEFT + 0.5))),
    shoulders=Wave(1.0, twice=(3.0, 0.33)),
)


@dataclass(frozen=True)
class Grasp:
    """How a hand plays. Lengths in metres, from the middle between the feet."""

    leave: tuple[float, float]
    """The ball ahead and to the left as it leaves the hand,"""
    meet: tuple[float, float]
    """and as the hand meets it."""
    rest: tuple[float, float, float]
    """A ball under the hand that waits."""
    normal: tuple[tuple[float, float, float], ...]
    """Of the palm, as it leaves the ball, waits, meets the ball, and has it highest."""
    pointing: tuple[tuple[float, float, float], ...]
    """Of the fingers, then."""
    elbow: tuple[float, float, float]
    """Where its axis would point; of a left arm, that of its mirror image."""


RIGHT_HAND = Grasp(
    leave=(0.33, -0.15),
    meet=(0.34, -0.18),
    rest=(0.28, -0.20, 0.58),
    normal=((-0.5, 0.6, -0.6), (-0.4, 0.6, -0.5), (-0.45, 0.7, 0.35), (-0.55, 0.8, -0.05)),
    pointing=((0.5, 0.3, -0.6), (0.4, 0.3, -0.9), (0.6, 0.3, -0.5), (0.6, 0.2, -0.6)),
    elbow=(0.35, -0.80, 0.50),
)
LEFT_HAND = Grasp(
    leave=(-0.01, 0.26),
    meet=(-0.06, 0.30),
    rest=(0.18, 0.30, 0.57),
    normal=((0.5, -0.7, -0.6), (0.3, -0.7, -0.5), (0.5, -0.65, 0.15), (0.55, -0.75, -0.1)),
    pointing=((0.3, -0.2, -0.8), (0.4, -0.2, -0.9), (0.1, -0.1, -1.0), (0.05, -0.1, -1.0)),
    elbow=(0.35, -0.80, 0.50),
)


HEEL = Wave(14.0, (8.0, LEFT))
PELVIS, OVER = (
    Wave(0.72, (0.005, LEFT + 0.5), (0.03, 0.33)),
    (Wave(0.115, (0.012, 0.07)), Wave(0.0, (0.010, 0.07))),
)


@dataclass(frozen=True)
class BetweenLegs:
    """Numbers of the dribble between the legs. Lengths in metres, times in seconds, speeds in m/s, angles in
    degrees."""

    period: float = 1.45
    height: tuple[float, float] = (0.48, 0.55)
    """Of the ball as it leaves a hand, and as the other meets it."""
    speed: float = 3.0
    """Downward, with which it leaves."""
    restitution: float = 0.8
    right: Grasp = RIGHT_HAND
    left: Grasp = LEFT_HAND
    posture: Posture = POSTURE
    pelvis: Wave = PELVIS
    """How high it is."""
    over: tuple[Wave, Wave] = OVER
    """Where the centre of mass is, ahead and to the left."""
    feet: tuple[tuple[float, float, float], ...] = ((0.34, 0.25, 8.0), (-0.34, -0.27, 32.0))
    """Left and right ankle: ahead, to the left, turned out."""
    heel: Wave = HEEL
    """Of the foot behind, risen over its toes."""


def between_legs(
    model: Model, style: BetweenLegs = BetweenLegs()
) -> tuple[Reference, np.ndarray, np.ndarray]:
    """The dribble on the player, cyclic: reference, ball (frames, 3) [m], touch (frames, 2) bool. The clip
    begins as the ball leaves the right hand."""
    steps = round(style.period / model.timestep)
    times, radius = np.arange(steps + 1) * model.timestep, model.ball_radius
    turns, half = times / times[-1], 0.5 * times[-1]
    bounce = Bounce(style.height[0], style.speed, radius, style.restitution)
    flight = bounce.down + bounce.rise_to(style.height[1])
    ball, under = _ball(style, times, half, flight, bounce)

    joint_q = np.tile(fingers(model, 1.0, "lr"), (steps + 1, 1))
    root = model.q_slice(model.root).start
    over = np.column_stack([wave.at(turns) for wave in style.over])
    joint_q[:, root : root + 3] = np.column_stack([over, style.pelvis.at(turns)])
    stand_up(model, joint_q, style.posture, turns)
    up = model.zero_pose[model.body("l_foot"), 2]

    def limbs(joint_q: np.ndarray) -> None:
        for side, (ahead, left, out), heel in zip("lr", style.feet, (Wave(0.0), style.heel)):
            flat = np.tile([ahead, left, up], (steps + 1, 1))
            place_foot(model, joint_q, side, *planted(model, side, flat, out, heel.at(turns)))
        for side, grasp, begin in (("l", style.left, half), ("r", style.right, 0.0)):
            when = begin + np.array([0.0, 0.5 * (half + flight), half + flight, 1.5 * half + 0.5 * flight])
            normal, pointing = (
                _cyclic(when, keys, 2.0 * half)(times) for keys in (grasp.normal, grasp.pointing)
            )
            place_palm(model, joint_q, side, under[side], normal, pointing, grasp.elbow, radius)

    balance(model, joint_q, over, limbs)
    joint_q[-1] = joint_q[0]
    own = times % half >= flight - 1e-9
    held = np.column_stack([own & (times < half), own & (times > half)])
    held[0, 1] = held[-1, 1] = True
    return Reference(joint_q, model.timestep), ball, held


def _ball(
    style: BetweenLegs, times: np.ndarray, half: float, flight: float, bounce: Bounce
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Centres (frames, 3) [m] of the ball, and of one under each palm, there or not."""
    gone, now = float(bounce.along(flight)), times % (2.0 * half)
    ball, under = np.empty((len(times), 3)), {}
    hands = {"r": style.right, "l": style.left}
    over = {"r": _over(style.right, style.left, gone), "l": _over(style.left, style.right, gone)}
    fall, rise = -style.speed, style.restitution * bounce.impact - GRAVITY * (flight - bounce.down)
    for side, other, begin in (("r", "l", 0.0), ("l", "r", half)):
        since = (now - begin) % (2.0 * half)  # the hand lets go at 0, and has the ball again at half + flight
        free = since < flight
        ball[free, :2] = hands[side].leave + bounce.along(since[free])[:, None] * over[side]
        ball[free, 2] = bounce.at(since[free])
        leave = np.array([*hands[side].leave, style.height[0]])
        meet = np.array([*hands[side].meet, style.height[1]])
        away, home = np.array([*over[side], fall]), np.array([*(GRIP * over[other]), rise])
        has = CubicHermiteSpline([half + flight, 2.0 * half], [meet, leave], [home, away])
        follow = leave + 0.025 * away
        waits = CubicHermiteSpline(
            [0.0, 0.09, 0.5 * (half + flight), half + flight - 0.09, half + flight],
            [leave, follow, hands[side].rest, meet - 0.03 * home, meet],
            [away, 0.0 * away, 0.0 * away, 0.0 * away, home],
        )
        own = since >= half + flight
        under[side] = np.where(own[:, None], has(since), waits(since))
        ball[own] = under[side][own]
    return ball, under


def _over(one: Grasp, other: Grasp, gone: float) -> np.ndarray:
    """(2,) [m/s] over the ground with which a ball leaves one hand to come to the other."""
    return (np.array(other.meet) - np.array(one.leave)) / gone


def _cyclic(when: np.ndarray, keys: tuple[tuple[float, float, float], ...], period: float) -> CubicSpline:
    """A smooth cyclic way through keys at times `when` [s]."""
    through = np.array([*keys, keys[0]])
    return CubicSpline([*when, when[0] + period], through, bc_type="periodic")
