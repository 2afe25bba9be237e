"""What a hand's motion says of a bounce: how it pushes, and which hand meets the ball again.

A palm that pushes a ball goes the way it looks, seen from the player, and goes down so fast that the ball
comes back; arms that swing go edge first. The ball leaves the hand after the palm's fastest moment, falls,
bounces, and is met by a hand that comes up with it, where the push has sent it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .flight import BOUNCE, GRAVITY, speed_to_meet
from .hands import Hands

FLICK = 1.4
"""[-] The wrist and fingers make the ball this much faster than the palm."""
LEAVES = 0.07
"""[s] after the palm's fastest moment the fingers let the ball go."""
SLOWEST = 0.7
"""[m/s] downward, of a hand that may push at all."""
APART = 0.1
"""[s] A push is a hand's fastest moment within this time."""
PALM, PALM_SPREAD = 1.05, 0.2
"""[m/s] at which a palm goes the way it looks when it may be either pushing or swinging, and how much more
makes it sure."""
RETURN, RETURN_SPREAD = 0.85, 0.1
"""[-] The same of the height to which the ball comes back, over the push's."""
BELOW, BELOW_SPREAD = 0.13, 0.1
"""[m] The same of the hand below its shoulder."""
REACHES = 0.05
"""[m] Fingers reach down to the ball by this."""
SOONEST, LONGEST = 0.08, 1.0
"""[s] from a release to the catch, and from a push to it."""
RISING, LOOK = 0.9, (0.03, 0.12)
"""[m/s] A hand that meets the ball comes up this fast within these times [s] before and after."""
TIMING, ASIDE, LATE = 2.0, 0.7, 2.0
"""What a catch costs: for each doubling of the flick that its time takes, or halving; and [s/m] where the
ball was sent elsewhere, or the hand does not come up."""


@dataclass(frozen=True)
class Push:
    row: int
    """at which the hand is fastest on its way down"""
    hand: int
    surety: float
    """[-] from -1 (a hand that goes down anyhow) to 1 (a push)"""


@dataclass(frozen=True)
class Catch:
    row: int
    """at which a hand meets the ball; the row after the last when that lies beyond the clip"""
    cost: float


def find_pushes(hands: Hands) -> list[Push]:
    """Every moment at which a hand may push, in order."""
    found = []
    reach = round(APART / hands.timestep)
    for hand in (0, 1):
        down, height = -hands.velocity[:, hand, 2], hands.centre[:, hand, 2]
        fall = np.maximum(height - hands.radius, 0.01)
        back = BOUNCE**2 * (1.0 + (FLICK * down) ** 2 / (2.0 * GRAVITY * fall))
        margin = np.minimum.reduce(
            [
                (hands.push[:, hand] - PALM) / PALM_SPREAD,
                (back - RETURN) / RETURN_SPREAD,
                (hands.shoulder[:, hand] - height - BELOW) / BELOW_SPREAD,
            ]
        )
        for row in range(1, len(down) - 1):
            near = down[max(row - reach, 0) : row + reach + 1]
            if down[row] > SLOWEST and down[row] == near.max() and down[row] > down[row + 1]:
                found.append(Push(row, hand, float(np.clip(margin[row], -1.0, 1.0))))
    return sorted(found, key=lambda push: push.row)


def find_catch(hands: Hands, push: Push, hand: int) -> Catch | None:
    """Where a hand best meets the ball of a push; None when the clip ends before it can."""
    row, step, frames = push.row, hands.timestep, len(hands.centre)
    start, velocity = hands.centre[row, push.hand], hands.velocity[row, push.hand]
    first = row + round((LEAVES + SOONEST) / step)
    rows = np.arange(first, min(row + round(LONGEST / step), frames))
    if not len(rows):
        return None
    times, met = (rows - row) * step, hands.centre[rows, hand] - [0.0, 0.0, REACHES]
    speed = speed_to_meet(start[2], met[:, 2], times, hands.radius)
    impact = np.sqrt(speed**2 + 2.0 * GRAVITY * max(start[2] - hands.radius, 0.0))
    speed[BOUNCE * impact < GRAVITY * times - impact + speed] = np.nan  # it is met on its way up
    flick = np.abs(np.log2(np.maximum(speed, 0.1) / (-FLICK * velocity[2])))
    before, after = (round(time / step) for time in LOOK)
    up = np.pad(hands.velocity[:, hand, 2], (before, after), mode="edge")
    up = sliding_window_view(up, before + after + 1).max(axis=1)[rows]
    needed = (met - start)[:, :2] / times[:, None] - velocity[:2]
    aside = np.linalg.norm(needed, axis=1)
    cost = TIMING * flick + ASIDE * aside + LATE * np.maximum(RISING - up, 0.0)
    best = int(np.argmin(np.where(np.isnan(cost), np.inf, cost)))
    return Catch(int(rows[best]), float(cost[best])) if np.isfinite(cost[best]) else None
