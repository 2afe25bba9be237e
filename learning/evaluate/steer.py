"""A policy at work, one time step after the other."""

from __future__ import annotations

import numpy as np

from ..graph import STEPS
from ..policies.linear import LinearPolicy
from ..tasks.disturbance import CALM, Disturbance, Disturber
from ..tasks.locomotion import Locomotion


class Steered:
    """Steers all worlds of a task along its control graph, from fragments k (world_count,) on."""

    def __init__(
        self, task: Locomotion, policy: LinearPolicy, k: np.ndarray, random, disturbance: Disturbance = CALM
    ):
        self.task, self.policy, self.random = task, policy, random
        self.k = np.array(k)
        """fragment of each world"""
        self._disturber = Disturber(disturbance, task, random)
        self._done = 0

    def step(self) -> None:
        """Advance by a time step; the policy is asked where fragments begin."""
        task = self.task
        if self._done == STEPS:
            self.k, self._done = task.graph.follow(self.k, self.random), 0
        if self._done == 0:
            self._disturber.apply()
            state = task.state(task.character.sense(self.k), self.k)
            task.offset[:, : task.action_size] = self.policy.act(state, self.k)
        task.character.step(1, self.k * STEPS + self._done, task.offset)
        self._done += 1
