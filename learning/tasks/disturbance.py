"""What a player has to stand while it moves: pushes, the forces of a ball on its hands, and arms that move
as another policy likes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..starts import Streams

if TYPE_CHECKING:
    from .follow import Follow


@dataclass(frozen=True)
class Disturbance:
    """Sizes of random disturbances; by default there are none."""

    push: float = 0.0
    """[N] largest horizontal force on the torso, in any direction"""
    push_time: float = 0.2
    """[s] that a push lasts (P1 8)"""
    push_every: float = 3.0
    """[s] between pushes, on average"""
    arms: float = 0.0
    """[rad] standard deviation of the offsets of all arm targets, drawn anew for every fragment"""
    hands: float = 0.0
    """[N] largest force on each hand, in any direction; dribbling takes about three times the ball's weight
    of 6.1 N"""
    hands_time: float = 0.25
    """[s] that such a force lasts, on average"""

    @property
    def about(self) -> str:
        """A line for a person, as "pushes up to 400 N, arms 0.2 rad off"; "" for none."""
        parts = {
            f"pushes up to {self.push:g} N": self.push,
            f"arms {self.arms:g} rad off": self.arms,
            f"up to {self.hands:g} N on each hand": self.hands,
        }
        return ", ".join(text for text, size in parts.items() if size)


CALM = Disturbance()


class Disturber:
    """Disturbs the worlds of a task, fragment by fragment; the worlds of a unit of `streams` feel the same.

    The task's course pushes a trunk and two hands, in this order; its offsets beyond the policy's are the
    arms'."""

    def __init__(self, what: Disturbance, streams: Streams):
        self.what, self.streams = what, streams
        self._left = np.zeros(streams.count, int)
        self._forces = np.zeros((streams.count, 3, 3))

    @property
    def state(self) -> dict[str, np.ndarray]:
        """What goes on beyond a fragment, by name, for `restore`."""
        return {"left": self._left.copy(), "forces": self._forces.copy()}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on from a `state`."""
        self._left, self._forces = np.array(state["left"]), np.array(state["forces"])

    def apply(self, task: Follow) -> None:
        """Set the forces and the arms' offsets of the coming fragment."""
        what, streams, period = self.what, self.streams, task.graph.period
        if not (what.push or what.hands or what.arms):
            return
        even, normal = streams.uniform(6), streams.normal(6 + task.others.shape[1])
        if what.push:
            self._push(even[:, :3], period)
        if what.hands:
            self._pull(even[:, 3:], normal[:, :6].reshape(-1, 2, 3), period)
        if what.push or what.hands:
            task.course.push[:] = streams.worlds(self._forces)
        if what.arms:
            task.others[:] = streams.worlds(what.arms * normal[:, 6:])

    def _push(self, drawn: np.ndarray, period: float) -> None:
        """drawn (count, 3): whether a push begins, from where, how hard."""
        what, trunk = self.what, self._forces[:, 0]
        self._left -= 1
        trunk[self._left <= 0] = 0.0
        begins = (self._left <= 0) & (drawn[:, 0] < period / what.push_every)
        angle, force = 2.0 * np.pi * drawn[:, 1], what.push * drawn[:, 2]
        level = np.stack([force * np.cos(angle), force * np.sin(angle), 0.0 * force], axis=1)
        trunk[begins] = level[begins]
        self._left[begins] = round(what.push_time / period)

    def _pull(self, drawn: np.ndarray, way: np.ndarray, period: float) -> None:
        """drawn (count, 3): whether new forces begin, how large each hand's is; way (count, 2, 3): where
        to."""
        begins = drawn[:, 0] < period / self.what.hands_time
        force = way * (self.what.hands * drawn[:, 1:, None] / np.linalg.norm(way, axis=-1, keepdims=True))
        self._forces[begins, 1:] = force[begins]
