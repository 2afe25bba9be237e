"""What a recorded clip holds and what is wrong with it, in numbers and frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from ..signals import low_pass, runs, speed
from . import anatomy, defects
from .defects import Event
from .motion import Motion
from .stance import Foot, stance

SMOOTH = 6.0
"""[Hz] Speeds of the root and heights of the hands are taken below this."""
STROKE = 0.15
"""[m] A hand's height changes by at least this in a stroke."""
STROKES = (0.25, 3.0)
"""[s] between the low points of strokes that follow each other."""


@dataclass(frozen=True)
class Hand:
    """How one hand goes up and down, heights above the ground of its longest finger's tip."""

    low: float
    """[m] lowest point, median of the strokes; without strokes the lowest of all."""
    top: float
    """[m] highest point, likewise."""
    strokes: list[int]
    """Frames of the low points: a dribbling hand has one per bounce, a swinging arm may have them too."""
    rate: float
    """[Hz] of strokes that follow each other; 0 with fewer than two."""


@dataclass(frozen=True)
class Quality:
    """A clip in numbers. Frames count from the first of the motion that was looked at, plus `first_frame`."""

    frames: int
    rate: float
    """[Hz]"""
    duration: float
    """[s]"""
    root_speed_mean: float
    """[m/s] over the ground."""
    root_speed_max: float
    """[m/s]"""
    ground: float
    """[m] height of the lowest foot point in stance; NaN where no foot stands."""
    hands: dict[str, Hand]
    feet: dict[str, Foot]
    jumps: list[Event]
    frozen: list[Event]
    under_ground: list[Event]
    ball_held: list[tuple[int, int]] | None
    """Frames, where the ball was recorded."""
    ball_bounces: list[int] | None
    """Frames, where the ball was recorded."""


def examine(motion: Motion, first_frame: int = 0) -> Quality:
    """The quality report of a motion. first_frame: number of its first frame in the clip it was cut from."""
    feet, ground, under = stance(motion)
    level = 0.0 if np.isnan(ground) else ground
    fast = _root_speed(motion)
    return Quality(
        frames=motion.frame_count,
        rate=float(motion.rate),
        duration=float(motion.duration),
        root_speed_mean=float(fast.mean()),
        root_speed_max=float(fast.max()),
        ground=ground,
        hands=_hands(motion, level, first_frame),
        feet={s: Foot([_from(first_frame, c) for c in f.contacts], f.slide) for s, f in feet.items()},
        jumps=_moved(defects.jumps(motion), first_frame),
        frozen=_moved(defects.frozen(motion), first_frame),
        under_ground=_moved(under, first_frame),
        ball_held=_held(motion, first_frame),
        ball_bounces=_bounces(motion, first_frame),
    )


def _root_speed(motion: Motion) -> np.ndarray:
    """Horizontal speed (frames,) [m/s] of the root, low-pass filtered."""
    return speed(low_pass(motion.root_position[:, :2], motion.rate, SMOOTH), motion.rate)


def _hands(motion: Motion, ground: float, first_frame: int) -> dict[str, Hand]:
    found = anatomy.parts(motion.joint_names, motion.parents)
    where = motion.places()
    hands = {}
    for side in anatomy.SIDES:
        if f"{side}_hand" not in found:
            continue
        height = low_pass(where[:, found[f"{side}_hand"], 2] - ground, motion.rate, SMOOTH)
        apart = max(1, int(STROKES[0] * motion.rate))
        lows, _ = find_peaks(-height, prominence=STROKE, distance=apart)
        tops, _ = find_peaks(height, prominence=STROKE, distance=apart)
        between = np.diff(lows) / motion.rate
        between = between[between < STROKES[1]]
        hands[side] = Hand(
            low=float(np.median(height[lows]) if len(lows) else height.min()),
            top=float(np.median(height[tops]) if len(tops) else height.max()),
            strokes=[int(f) + first_frame for f in lows],
            rate=float(1.0 / np.median(between)) if len(between) else 0.0,
        )
    return hands


def _held(motion: Motion, first_frame: int) -> list[tuple[int, int]] | None:
    if motion.ball_held is None:
        return None
    return [_from(first_frame, run) for run in runs(motion.ball_held)]


def _bounces(motion: Motion, first_frame: int) -> list[int] | None:
    """Frames in which a recorded ball turns from falling to rising near the ground."""
    if motion.ball is None:
        return None
    lows, _ = find_peaks(-motion.ball[:, 2], prominence=0.05, height=-0.3)
    return [int(f) + first_frame for f in lows]


def _moved(events: list[Event], first_frame: int) -> list[Event]:
    return [Event(e.what, e.first + first_frame, e.last + first_frame, e.size) for e in events]


def _from(first_frame: int, run: tuple[int, int]) -> tuple[int, int]:
    return run[0] + first_frame, run[1] + first_frame
