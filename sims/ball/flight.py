"""A ball in flight with one bounce: free fall, and e times the speed back (P1 7: e = 0.8)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from scipy.optimize import brentq

T = TypeVar("T", float, np.ndarray)
GRAVITY, BOUNCE = 9.81, 0.8
"""[m/s^2] and [-], of the ball in references; the simulated one has its model's."""
FASTEST = 15.0
"""[m/s] at which a ball leaves a hand."""


@dataclass(frozen=True)
class Bounce:
    """A ball that leaves `height` [m] downward at `speed` [m/s], falls and comes back from the ground."""

    height: float
    """[m] of its centre"""
    speed: float
    radius: float
    """[m]"""
    restitution: float = BOUNCE

    @cached_property
    def impact(self) -> float:
        """[m/s] at which it meets the ground"""
        return float(np.sqrt(self.speed**2 + 2.0 * GRAVITY * max(self.height - self.radius, 0.0)))

    @cached_property
    def down(self) -> float:
        """[s] until it does"""
        return (self.impact - self.speed) / GRAVITY

    def falling(self, since: T) -> T:
        """Height [m] `since` seconds after it was let go, before the ground."""
        return self.height - self.speed * since - 0.5 * GRAVITY * since**2

    def rising(self, after: T) -> T:
        """Height [m] `after` seconds on from the ground, up to the second time there."""
        return self.radius + self.restitution * self.impact * after - 0.5 * GRAVITY * after**2

    def at(self, since: np.ndarray) -> np.ndarray:
        """Height [m] `since` seconds after it was let go, up to its second time on the ground."""
        rising = self.rising(np.maximum(since - self.down, 0.0))
        return np.where(since < self.down, self.falling(since), rising)


def speed_to_meet(height: float, after: float, duration: float, radius: float) -> float | None:
    """Downward speed [m/s] with which a ball bounces once from `height` to the height `after` [m] in
    `duration` [s]; None when there is none."""

    def missed(speed: float) -> float:
        return float(Bounce(height, speed, radius).at(np.array(duration))) - after

    speeds = np.linspace(-2.0, FASTEST, 171)
    low = next((v for v in speeds if Bounce(height, v, radius).down < duration), None)
    if low is None or missed(low) > 0.0 or missed(FASTEST) < 0.0:
        return None
    return float(brentq(missed, low, FASTEST))


def speed_to_return(height: float, radius: float) -> float:
    """Downward speed [m/s] with which a ball comes back to just the `height` [m] that it leaves."""
    return float(np.sqrt(2.0 * GRAVITY * max(height - radius, 0.0) * (BOUNCE**-2 - 1.0)))


def thrown(place: np.ndarray, velocity: np.ndarray, times: np.ndarray, radius: float) -> np.ndarray:
    """Centres (n, 3) [m] at `times` (n,) [s] of a ball that flies from `place` (3,) with `velocity` (3,)
    [m/s], bouncing until it rolls."""
    out = place + velocity * times[:, None]
    start, height, speed = 0.0, max(place[2], radius), float(velocity[2])
    for k, t in enumerate(times):
        while True:
            impact = np.sqrt(max(speed**2 + 2.0 * GRAVITY * (height - radius), 0.0))
            lands = (speed + impact) / GRAVITY
            if t - start < lands or impact < 0.2:
                break
            start, height, speed = start + lands, radius, BOUNCE * impact
        since = t - start
        falling = height + speed * since - 0.5 * GRAVITY * since**2
        out[k, 2] = max(radius, falling) if impact >= 0.2 else radius
    return out
