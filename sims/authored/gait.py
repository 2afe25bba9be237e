"""Running written down: two flights a cycle in which the centre of mass falls, two planted feet, legs that
swing through in between.

The centre of mass comes first: in flight it falls, on the ground it is pushed up by a force that grows and
fades as half a sine, and braked and driven by a whole one. A foot on the ground lands on its heel, lies flat,
and rises over its toes; in the air its leg goes from where it left the ground to where it lands on through a
few key angles. The pelvis is where the centre of mass then is where it should be.

Measured on recorded runs, put on the player: CMU 09_01, and BallPlay-M's 013 pick2run_3, which dribbles. Half
of the way of a first harmonic, @ when it is at its top, in cycles after the left foot lands; the rest in
degrees:

| | 09_01 | pick2run_3 | here |
|---|---|---|---|
| speed [m/s] | 3.8 | 2.1 | 2.5 |
| cycle, contact of a foot [s] | 0.73, 0.2 | 0.87, 0.3 | 0.70, 0.25 |
| pelvis' height, from lowest to highest [cm] | 8 | 13 | 8 |
| pelvis' yaw to the left | 4.5 @ .27 | 2 @ .4 | 5 @ .27 |
| pelvis' roll to the right | 5.5 @ .40 | 5 @ .0 | 4.5 @ .38 |
| torso's yaw to the left | 9.5 @ .90 | 28 @ .10 | 16 @ .02 |
| torso's pitch, mean | 12 | 38 | 28 |
| thigh ahead, from, to | -38, 44 | -34, 40 | -24, 36 |
| knee as the foot lands, in mid-stance, as it leaves | 22, 44, 13 | 23, 52, 15 | 21, 50, 27 |
| knee in the air | 117 | 77 | 97 |
| free upper arm ahead | 31 @ .36 | 22 @ .66 | 26 @ .42 |
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ..ball.flight import GRAVITY
from ..model import Model, pose
from .balance import balance
from .breath import Swing, swing
from .feet import foot_turn, place_foot, planted


@dataclass(frozen=True)
class Gait:
    """Numbers of a run ahead. Lengths in metres, times in seconds, angles in degrees."""

    period: float = 0.70
    """Of two steps; the left foot lands at its beginning."""
    speed: float = 2.5
    contact: float = 0.25
    """How long a foot is on the ground."""
    height: float = 1.0
    """Of the centre of mass as a foot lands."""
    brake: float = 2.6
    """[m/s^2] The largest by which landing slows it."""
    sway: Swing = (0.010, 0.18)
    """Of the centre of mass, to the left."""
    reach: float = 0.165
    """The ankle ahead of the centre of mass as the foot lands."""
    width: float = 0.045
    """The ankles to the side of the way."""
    out: float = 6.0
    """The feet turned out."""
    heel: float = 7.0
    """Toes up as the foot lands"""
    flat: tuple[float, float] = (0.06, 0.11)
    """When after that the foot lies flat, and its heel leaves the ground."""
    rise: float = 40.0
    """Of the foot over its toes as they leave the ground"""
    keys: tuple[tuple[float, float, float, float, float], ...] = (
        (0.17, -25.0, 32.0, 10.0, -12.0),
        (0.45, 7.0, 90.0, 3.0, 0.0),
        (0.72, 34.0, 74.0, -4.0, 0.0),
        (0.90, 30.0, 23.0, -3.0, 0.0),
    )
    """Of a leg in the air: when, in parts of its time there; the thigh ahead, the knee, the ankle's stretch,
    the toes."""
    aside: float = 0.03
    """A foot in the air is farther out by this much in between."""


def centre_of_mass(gait: Gait, times: np.ndarray) -> np.ndarray:
    """Where it is (frames, 3) [m] at times (frames,) [s]; it runs along X."""
    step, contact = 0.5 * gait.period, gait.contact
    done, t = np.divmod(times, step)
    fly = step - contact
    down = np.minimum(t, contact)  # so long on the ground
    up = np.maximum(t - contact, 0.0)  # and so long in the air
    push = 0.5 * np.pi * GRAVITY * step / contact
    way = contact / np.pi
    high = -0.5 * GRAVITY * (fly * down + down**2) + push * way * (down - way * np.sin(down / way))
    high = high + 0.5 * GRAVITY * (fly * up - up**2)
    slow = gait.brake * contact / (2.0 * np.pi)
    fast = gait.speed + slow * contact / step
    along = fast * t - slow * (down - 0.5 * way * np.sin(2.0 * down / way))
    side = swing(gait.sway, times / gait.period)
    return np.column_stack([gait.speed * step * done + along, side, gait.height + high])


def run(
    model: Model, joint_q: np.ndarray, gait: Gait, times: np.ndarray, arms: Callable[[np.ndarray], None]
) -> None:
    """Legs and root of joint_q (frames, nq), in place, for a trunk that is turned already; times: (frames,)
    [s]; arms: puts them to where they have to be for where the root is."""
    root = model.q_slice(model.root).start
    goal = centre_of_mass(gait, times)
    joint_q[:, root : root + 3] = goal

    def limbs(joint_q: np.ndarray) -> None:
        arms(joint_q)
        for side, strike in (("l", 0.0), ("r", 0.5 * gait.period)):
            _leg(model, joint_q, gait, times, side, strike)

    balance(model, joint_q, goal, limbs)


def _leg(model: Model, joint_q: np.ndarray, gait: Gait, times: np.ndarray, side: str, strike: float) -> None:
    """One leg, whose foot lands at `strike` [s], solved for where the pelvis is."""
    upper, lower, foot = pose.limb_bodies(model, f"{side}_knee")
    zero = model.zero_pose[:, :3]
    long = float(zero[upper, 2] - zero[lower, 2]), float(zero[lower, 2] - zero[foot, 2])
    sign = 1.0 if side == "l" else -1.0
    since = (times - strike) % gait.period
    down = since <= gait.contact
    hip = pose.forward(model, joint_q, [upper])[:, upper, :3]

    pitch = _roll_off(gait, since)
    landed = gait.speed * (times - since) + gait.reach
    flat = np.column_stack([landed, 0.0 * since + sign * gait.width, 0.0 * since + zero[foot, 2]])
    ankle, _, toes = planted(model, side, flat, gait.out, pitch)
    thigh, knee = _bent(ankle - hip, long)
    leg = np.column_stack([thigh, knee, pitch - (knee - thigh), toes, sign * ankle[:, 1]])

    when, keys = np.split(np.array(gait.keys), [1], axis=1)
    wide = gait.width + gait.aside * np.sin(np.pi * when)
    when = gait.contact + when[:, 0] * (gait.period - gait.contact)
    swung = _through(since[down], leg[down], when, np.column_stack([keys, wide]), gait.period)
    leg[~down] = swung(since[~down])

    thigh, knee, stretch, toes, wide = leg.T
    ankle = hip + _straight(thigh, knee, long)
    ankle[:, 1] = sign * wide
    turned = foot_turn(0.0 * knee + sign * gait.out, stretch + knee - thigh)
    place_foot(model, joint_q, side, ankle, turned, toes)


def _roll_off(gait: Gait, since: np.ndarray) -> np.ndarray:
    """Pitch (frames,) [degrees], toes down, of a foot that landed `since` (frames,) [s] ago."""
    down, lift = gait.flat
    landing = np.clip(1.0 - since / down, 0.0, 1.0)
    leaving = np.clip((since - lift) / (gait.contact - lift), 0.0, 1.0)
    return -gait.heel * landing**2 + gait.rise * leaving**2.3


def _through(
    times: np.ndarray, values: np.ndarray, when: np.ndarray, keys: np.ndarray, period: float
) -> CubicSpline:
    """A smooth cyclic way through values (frames, n) at `times` (frames,) [s] and keys (m, n) at `when` (m,)
    [s]."""
    order = np.argsort(times)
    at = np.concatenate([times[order], when, times[order][:1] + period])
    through = np.concatenate([values[order], keys, values[order][:1]])
    return CubicSpline(at, through, bc_type="periodic")


def _bent(reach: np.ndarray, long: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """How far ahead a thigh points and how far the knee is bent (frames,) [degrees], for a leg of lengths
    `long` [m] from the hip to the ankle `reach` (frames, 3) [m]; sideways does not count."""
    a, b = long
    far = np.minimum(np.hypot(reach[:, 0], reach[:, 2]), 0.9999 * (a + b))
    knee = np.arccos((far**2 - a**2 - b**2) / (2.0 * a * b))
    ahead = np.arctan2(reach[:, 0], -reach[:, 2]) + np.arcsin(b * np.sin(knee) / far)
    return np.degrees(ahead), np.degrees(knee)


def _straight(thigh: np.ndarray, knee: np.ndarray, long: tuple[float, float]) -> np.ndarray:
    """From the hip to the ankle (frames, 3) [m]; undoes `_bent`."""
    a, b = long
    first, second = np.radians(thigh), np.radians(thigh - knee)
    x, z = a * np.sin(first) + b * np.sin(second), a * np.cos(first) + b * np.cos(second)
    return np.column_stack([x, 0.0 * x, -z])
