"""`Trajectory`: what one world did, a row per time step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .model import Model


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


def centred(model: Model, seen: Trajectory) -> Trajectory:
    """The same moved over the ground, so that the player's root begins above the origin. Where something
    stands fixed in the world, nothing is moved."""
    fixed = any(joint.kind != "free" for joint in model.joints if joint.parent == 0)
    fixed = fixed or any(model.body_link[s.body] == 0 for s in model.shapes if s.body >= 0)
    if fixed or any(s.body < 0 and s.kind != "plane" for s in model.shapes):
        return seen
    off = seen.body_q[0, model.body(model.roles.one("root_body")), :2]
    of_pose, of_q = np.zeros(7), np.zeros(model.nq)
    of_pose[:2] = off
    for joint in model.joints:
        if joint.kind == "free":
            of_q[joint.q.start : joint.q.start + 2] = off
    return replace(
        seen,
        joint_q=seen.joint_q - of_q,
        body_q=seen.body_q - of_pose,
        reference_q=seen.reference_q - of_q,
    )
