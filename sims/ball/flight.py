"""A ball in flight with one bounce: free fall, and e times the speed back (P1 7: e = 0.8)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

T = TypeVar("T", float, np.ndarray)
GRAVITY, BOUNCE = 9.81, 0.8
"""[m/s^2] and [-], of the ball in references; the simulated one has its model's."""
GRIP = 0.6
"""[-] Of its speed over the ground that a ball without spin keeps as the ground grips it. What the ground
takes spins it, m (v - v') r = 2/3 m r^2 w, until it rolls, v' = w r: a hollow ball keeps three fifths."""
SLOWEST, FASTEST = -2.0, 15.0
"""[m/s] downward, at which a ball leaves a hand."""


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

    def rise_to(self, height: float) -> float:
        """[s] from the ground up to a height [m] on its way up; nan where it comes less high."""
        back = self.restitution * self.impact
        return float((back - np.sqrt(back**2 - 2.0 * GRAVITY * (height - self.radius))) / GRAVITY)

    def along(self, since: T) -> T:
        """How far over the ground [s], in times of its first speed there, it is after `since` [s]: the ground
        grips it."""
        return np.minimum(since, self.down) + GRIP * np.maximum(since - self.down, 0.0)


def speed_to_meet(
    height: float, after: np.ndarray | float, duration: np.ndarray | float, radius: float
) -> np.ndarray:
    """Downward speeds [m/s] with which a ball bounces once from `height` to the heights `after` [m] in the
    times `duration` [s]; nan where there is none from SLOWEST to FASTEST."""
    after, duration = np.broadcast_arrays(np.asarray(after, float), np.asarray(duration, float))
    fall = max(height - radius, 0.0)
    least, most = np.full(duration.shape, 1e-6), np.maximum(duration, 2e-6)
    for _ in range(50):  # the later it falls, the lower it is in the end: its time down, by halving
        down = 0.5 * (least + most)
        up = duration - down
        rises = BOUNCE * (fall / down + 0.5 * GRAVITY * down) * up - 0.5 * GRAVITY * up**2
        high = rises > after - radius
        least, most = np.where(high, down, least), np.where(high, most, down)
    speed = fall / down - 0.5 * GRAVITY * down
    return np.where((speed >= SLOWEST) & (speed <= FASTEST), speed, np.nan)


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
