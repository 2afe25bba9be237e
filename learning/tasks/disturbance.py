"""What a player has to stand while it moves: pushes, the forces of a ball on its hands, and arms that move
as another policy likes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

HANDS = ("l_hand", "r_hand")
PUSHED = "torso"


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


CALM = Disturbance()


class Disturber:
    """Disturbs the worlds of a `Locomotion`, fragment by fragment; `group` worlds in a row feel the same."""

    def __init__(self, what: Disturbance, task, random: np.random.Generator, group: int = 1):
        self.what, self.task, self.random, self.group = what, task, random, group
        self.count = task.sim.world_count // group
        self._left = np.zeros(self.count, int)
        self._push = np.zeros((self.count, 3))
        self._hands = np.zeros((self.count, len(HANDS), 3))
        task.calm()

    def apply(self) -> None:
        """Set the forces and the arms' offsets of the coming fragment."""
        what, task, n = self.what, self.task, self.count
        period = task.graph.period
        if what.push:
            self._left -= 1
            self._push[self._left <= 0] = 0.0
            begins = (self._left <= 0) & (self.random.random(n) < period / what.push_every)
            angle = 2.0 * np.pi * self.random.random(n)
            force = what.push * self.random.random(n)
            force = np.stack([force * np.cos(angle), force * np.sin(angle), 0.0 * force], axis=1)
            self._push[begins] = force[begins]
            self._left[begins] = round(what.push_time / period)
            self._force(PUSHED, self._push)
        if what.hands:
            begins = self.random.random(n) < period / what.hands_time
            force = self.random.standard_normal(self._hands.shape)
            size = what.hands * self.random.random((n, len(HANDS), 1))
            force *= size / np.linalg.norm(force, axis=-1, keepdims=True)
            self._hands[begins] = force[begins]
            for hand, name in enumerate(HANDS):
                self._force(name, self._hands[:, hand])
        if what.arms:
            arms = what.arms * self.random.standard_normal((n, task.arm_columns))
            task.offset[:, task.action_size :] = np.repeat(arms, self.group, axis=0)

    def _force(self, body: str, force: np.ndarray) -> None:
        self.task.sim.apply_force(body, np.repeat(force, self.group, axis=0))
