"""When the feet of a recording stand on the ground, where that ground is, and how far they slide on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..signals import runs, speed
from . import anatomy
from .defects import Event
from .motion import Motion

SLOW = 0.5
"""[m/s] A point of the foot that stands is slower, though recordings slide."""
NEAR = 0.04
"""[m] A point of the foot that stands is no higher than this above where it stands lowest."""
SHORT = 0.05
"""[s] No step and no break in a step is shorter."""
UNDER = 0.05
"""[m] A foot farther below the ground than this is wrong."""


@dataclass(frozen=True)
class Foot:
    """How one foot meets the ground."""

    contacts: list[tuple[int, int]]
    """First and last frame of each stance, both included."""
    slide: float
    """[m/s] median horizontal speed of the ball of the foot while it stands; 0 without a stance."""


def stance(motion: Motion) -> tuple[dict[str, Foot], float, list[Event]]:
    """The feet ("left", "right") that the skeleton names, the height of the ground [m], and feet under it.

    The ground is the median height of the lowest point of a foot that stands: with CMU the sole at the
    toes, with BallPlay-M the toe joint, a few centimetres above the sole. NaN where no foot ever stands.
    """
    found = anatomy.parts(motion.joint_names, motion.parents)
    where = motion.places()
    feet, lowest, ground = {}, {}, []
    for side in anatomy.SIDES:
        names = (f"{side}_ankle", f"{side}_toe", f"{side}_toe_tip")
        points = [found[n] for n in names if n in found]
        if not points:
            continue
        stands = _stands(where[:, points[:2]], motion.rate)
        lowest[side] = where[:, points, 2].min(axis=1)
        ground.append(lowest[side][stands])
        moving = speed(where[:, points[min(1, len(points) - 1)], :2], motion.rate)
        slide = float(np.median(moving[stands])) if stands.any() else 0.0
        feet[side] = Foot(runs(stands), slide)
    level = np.concatenate(ground) if ground else np.zeros(0)
    height = float(np.median(level)) if len(level) else float("nan")
    under = [
        Event(f"{side} foot", first, last, float((height - heights[first : last + 1]).max()))
        for side, heights in lowest.items()
        for first, last in runs(heights < height - UNDER, join=int(SHORT * motion.rate))
    ]
    return feet, height, under


def _stands(points: np.ndarray, rate: float) -> np.ndarray:
    """Frames (frames,) bool in which a foot stands on one of its points (frames, points, 3)."""
    stands = np.zeros(len(points), bool)
    for point in np.moveaxis(points, 1, 0):
        slow = speed(point, rate) < SLOW
        if slow.any():
            level = np.quantile(point[slow, 2], 0.1)
            stands |= slow & (point[:, 2] < level + NEAR)
    short = int(SHORT * rate)
    kept = np.zeros_like(stands)
    for first, last in runs(stands, join=short):
        kept[first : last + 1] = last - first + 1 > short
    return kept
