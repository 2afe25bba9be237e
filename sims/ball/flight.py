"""A ball in flight with one bounce: free fall, and e times the speed back (P1 7: e = 0.8)."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

GRAVITY, BOUNCE = 9.81, 0.8
FASTEST = 15.0
"""[m/s] at which a ball leaves a hand."""


def time_to_ground(height: float, speed: float, radius: float) -> float:
    """[s] until a ball that leaves `height` [m] downward at `speed` [m/s] touches the ground."""
    impact = np.sqrt(speed**2 + 2.0 * GRAVITY * max(height - radius, 0.0))
    return float((impact - speed) / GRAVITY)


def flight_height(since: np.ndarray, height: float, speed: float, radius: float) -> np.ndarray:
    """Height [m] of the ball's centre `since` seconds after it left `height` downward at `speed` [m/s], up to
    its second time on the ground."""
    impact = np.sqrt(speed**2 + 2.0 * GRAVITY * max(height - radius, 0.0))
    down = (impact - speed) / GRAVITY
    up = np.maximum(since - down, 0.0)
    rising = radius + BOUNCE * impact * up - 0.5 * GRAVITY * up**2
    return np.where(since < down, height - speed * since - 0.5 * GRAVITY * since**2, rising)


def speed_to_meet(height: float, after: float, duration: float, radius: float) -> float | None:
    """Downward speed [m/s] with which a ball bounces once from `height` to the height `after` [m] in
    `duration` [s]; None when there is none."""

    def missed(speed):
        return float(flight_height(np.array(duration), height, speed, radius)) - after

    speeds = np.linspace(-2.0, FASTEST, 171)
    low = next((v for v in speeds if time_to_ground(height, v, radius) < duration), None)
    if low is None or missed(low) > 0.0 or missed(FASTEST) < 0.0:
        return None
    return float(brentq(missed, low, FASTEST))


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
