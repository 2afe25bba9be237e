"""Which hands have a recorded ball, told from where both were recorded."""

from __future__ import annotations

import numpy as np

from ..recording import Motion
from ..trees import below

NEAR = 0.1
"""[m] between the ball's surface and the nearest joint of a hand that has it: half a finger's thickness, the
fingertip beyond its last joint, and the recordings' error. BallPlay-M has the fewest frames there: hands that
hold are at 2 to 6 cm, hands that do not are anywhere beyond."""


def recorded_touch(motion: Motion, wrists: tuple[str, str], radius: float) -> np.ndarray:
    """(frames, 2) bool: the left, the right hand has the ball of a motion that recorded one. wrists: joints
    that the fingers hang from. radius [m] of the ball. Where the recording says that the ball is held, the
    nearer hand always has it."""
    if motion.ball is None or motion.ball_held is None:
        return np.zeros((motion.frame_count, 2), bool)
    places, gaps = motion.places(), []
    for wrist in wrists:
        joints = below(motion.parents, motion.index(wrist))
        gaps.append(np.linalg.norm(places[:, joints] - motion.ball[:, None], axis=2).min(axis=1) - radius)
    gap = np.stack(gaps, axis=1)
    return motion.ball_held[:, None] & ((gap < NEAR) | (gap == gap.min(axis=1, keepdims=True)))
