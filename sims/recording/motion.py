"""A recorded motion as data: a tree of joints, their rotations over time, and where the root goes.

World frame: metres, Z up, ground near z = 0; the rest pose faces +X with the left side toward +Y,
as the player does. Quaternions are xyzw. End sites of the recording are joints without motion,
named `<parent>_end`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..signals import interpolate_lines, interpolate_rotations

RECORDED = ("positions", "ball", "ball_held")
"""What only some formats record, a row per frame; None in a motion without it."""


@dataclass(frozen=True)
class Motion:
    """Joint rotations of a skeleton over time.

    Parents come before their children; the root is joint 0.
    """

    joint_names: tuple[str, ...]
    parents: np.ndarray
    """(joints,) int, -1 for the root."""
    offsets: np.ndarray
    """(joints, 3) [m], joint origin in the parent joint's frame; the root's is not used."""
    rotations: np.ndarray
    """(frames, joints, 4) [-], xyzw, joint frame in the parent joint's frame."""
    root_position: np.ndarray
    """(frames, 3) [m]."""
    rate: float
    """[Hz]."""
    rest_rotations: np.ndarray
    """(joints, 4) [-], xyzw, the T-pose that calibrates retargeting (identity where none was
    recorded)."""
    positions: np.ndarray | None = None
    """(frames, joints, 3) [m], joint origins as recorded, where the format has them: they may differ from
    forward kinematics by the recording's own error."""
    ball: np.ndarray | None = None
    """(frames, 3) [m], centre of the recorded ball."""
    ball_held: np.ndarray | None = None
    """(frames,) bool, a hand holds or touches the ball."""

    def __post_init__(self) -> None:
        joints, frames = len(self.joint_names), len(self.root_position)
        for field, shape in (
            ("parents", (joints,)),
            ("offsets", (joints, 3)),
            ("rotations", (frames, joints, 4)),
            ("root_position", (frames, 3)),
            ("rest_rotations", (joints, 4)),
            ("positions", (frames, joints, 3)),
            ("ball", (frames, 3)),
            ("ball_held", (frames,)),
        ):
            if field in RECORDED and getattr(self, field) is None:
                continue
            if np.shape(getattr(self, field)) != shape:
                raise ValueError(f"{field} is {np.shape(getattr(self, field))}, should be {shape}")
        if frames < 1:
            raise ValueError("a motion needs at least one frame")
        if self.parents[0] != -1 or np.any(self.parents[1:] >= np.arange(1, joints)):
            raise ValueError("parents must come before their children, with one root first")

    @property
    def frame_count(self) -> int:
        return len(self.root_position)

    @property
    def duration(self) -> float:
        """[s] from the first to the last frame."""
        return (self.frame_count - 1) / self.rate

    def index(self, joint: str) -> int:
        """Number of a joint. Raises ValueError that lists the names there are."""
        try:
            return self.joint_names.index(joint)
        except ValueError:
            raise ValueError(
                f"no joint '{joint}' in this motion; it has {', '.join(self.joint_names)}"
            ) from None

    def slice(self, first: int, last: int) -> Motion:
        """Frames first..last, both included. Raises ValueError when they are not in the motion."""
        if not 0 <= first < last < self.frame_count:
            raise ValueError(f"frames {first} to {last} are not a range within 0 to {self.frame_count - 1}")
        part = slice(first, last + 1)
        return replace(
            self,
            rotations=self.rotations[part],
            root_position=self.root_position[part],
            **self._recorded(lambda values: values[part]),
        )

    def resample(self, rate: float) -> Motion:
        """The same motion at another rate [Hz].

        Rotations move along geodesics between the recorded frames, the root, recorded positions and the
        ball along straight lines; `ball_held` takes the nearest frame's. The last frame is kept to
        within half a new frame.
        """
        if rate <= 0:
            raise ValueError(f"a rate must be positive, not {rate}")
        count = round(self.duration * rate) + 1
        at = np.linspace(0.0, self.frame_count - 1.0, count) if count > 1 else np.zeros(1)
        return replace(
            self,
            rotations=interpolate_rotations(self.rotations, at),
            root_position=interpolate_lines(self.root_position, at),
            rate=(count - 1) / self.duration if count > 1 else rate,
            **self._recorded(lambda values: interpolate_lines(values, at)),
        )

    def _recorded(self, change: Callable[[np.ndarray], np.ndarray]) -> dict[str, Any]:
        """The recorded fields that there are, each with `change` applied; true or false stays so."""
        has = {name: getattr(self, name) for name in RECORDED if getattr(self, name) is not None}
        new = {name: change(values.astype(float)) for name, values in has.items()}
        return {n: v > 0.5 if has[n].dtype == bool else v for n, v in new.items()}

    def forward(self) -> tuple[np.ndarray, np.ndarray]:
        """Forward kinematics: joint origins (frames, joints, 3) [m] and joint frames (frames,
        joints, 4) xyzw."""
        return _forward(self.parents, self.offsets, self.rotations, self.root_position)

    def places(self) -> np.ndarray:
        """Joint origins (frames, joints, 3) [m]: as recorded where the format has them."""
        return self.forward()[0] if self.positions is None else self.positions

    def rest(self) -> tuple[np.ndarray, np.ndarray]:
        """Forward kinematics of the rest pose, root at the origin: (joints, 3) [m], (joints, 4)."""
        positions, frames = _forward(self.parents, self.offsets, self.rest_rotations[None], np.zeros((1, 3)))
        return positions[0], frames[0]


def _forward(
    parents: np.ndarray, offsets: np.ndarray, rotations: np.ndarray, root_position: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    positions = np.empty((*rotations.shape[:2], 3))
    frames = [Rotation.from_quat(rotations[:, 0])]
    positions[:, 0] = root_position
    for joint in range(1, len(parents)):
        parent = frames[parents[joint]]
        frames.append(parent * Rotation.from_quat(rotations[:, joint]))
        positions[:, joint] = positions[:, parents[joint]] + parent.apply(offsets[joint])
    return positions, np.stack([f.as_quat() for f in frames], axis=1)
