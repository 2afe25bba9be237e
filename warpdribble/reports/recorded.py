"""Whether a recorded ball moves as a ball can: how fast it falls, what a bounce leaves of its speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..sims.signals import runs

GRAVITY = 9.81
"""[m/s^2]"""
RESTITUTION = 0.8
"""of a basketball on the ground"""
OFF = (0.15, 0.3)
"""What may be missing to the restitution, and what share of gravity."""
FEWEST = 3
"""Frames of an arc."""


@dataclass(frozen=True)
class Physics:
    """A recorded ball."""

    e: float
    """median restitution of its bounces; NaN for none"""
    fall: float
    """[m/s^2] its acceleration in flight, down; NaN where it does not fly"""

    @property
    def possible(self) -> bool:
        """Whether both are near those of a basketball; what was not seen is."""
        e, fall = abs(self.e - RESTITUTION), abs(self.fall / GRAVITY - 1.0)
        return not (e > OFF[0] or fall > OFF[1])


def physics(ball: np.ndarray, held: np.ndarray, rate: float) -> Physics:
    """Of a path (frames, 3) [m] that hands have while it is `held` (frames,). All arcs are parabolas of one
    acceleration, by least squares; a bounce is where two of them meet, about a flight's lowest frame, which
    belongs to neither."""
    height = ball[:, 2]
    arcs: list[np.ndarray] = []
    meets: list[tuple[int, int]] = []
    for a, b in runs(~held):
        low = a + int(np.argmin(height[a : b + 1]))
        parts = (a, low), (low + 1, b + 1)
        fit = [np.arange(*part) for part in parts if part[1] - part[0] >= FEWEST]
        if len(fit) == 2:
            meets.append((len(arcs), low))
        arcs += fit
    if not arcs:
        return Physics(np.nan, np.nan)
    # z = z_0 + v t - fall t^2 / 2, t from each arc's first frame
    count, rows = len(arcs), sum(map(len, arcs))
    left, right, at = np.zeros((rows, 2 * count + 1)), np.zeros(rows), 0
    for i, arc in enumerate(arcs):
        t, own = (arc - arc[0]) / rate, slice(at, at + len(arc))
        left[own, 2 * i], left[own, 2 * i + 1], left[own, -1] = 1.0, t, -0.5 * t**2
        right[own], at = height[arc], at + len(arc)
    x = np.linalg.lstsq(left, right)[0]
    fall, e = float(x[-1]), []
    for i, low in meets:
        time = np.linspace(low - 1, low + 1, 201)
        (z, v), (z_after, v_after) = (
            (x[2 * j] + x[2 * j + 1] * t - 0.5 * fall * t**2, x[2 * j + 1] - fall * t)
            for j in (i, i + 1)
            for t in [(time - arcs[j][0]) / rate]
        )
        meet = int(np.argmin(np.abs(z - z_after)))
        e.append(-v_after[meet] / v[meet])
    return Physics(float(np.median(e)) if e else np.nan, fall)
