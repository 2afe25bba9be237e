"""`Trajectory`: what one world did, a row per time step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Trajectory:
    """One world beside its reference, the start included."""

    joint_q: np.ndarray
    """(frames, nq) [m, rad, -]"""
    body_q: np.ndarray
    """(frames, nbody, 7) [m, -]"""
    timestep: float
    """[s] between rows"""
    reference_q: np.ndarray
    """(frames, nq) what it should have done"""
    wall_time: float = 0.0
    """[s] that simulating it took, with all worlds beside it"""
    lost: float = np.nan
    """[s] after which a policy had fallen or lost the ball; NaN for never"""

    @property
    def frame_count(self) -> int:
        return len(self.joint_q)

    @property
    def duration(self) -> float:
        """[s] from the first to the last row."""
        return (self.frame_count - 1) * self.timestep

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per second."""
        return self.duration / max(self.wall_time, 1e-9)

    def first(self, frames: int) -> Trajectory:
        """The first rows of it."""
        return replace(
            self,
            joint_q=self.joint_q[:frames],
            body_q=self.body_q[:frames],
            reference_q=self.reference_q[:frames],
        )
