"""A policy that tries something beside what it knows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rollout import Controller


@dataclass
class Noisy:
    """A controller with exploration; or, without any, nothing else."""

    policy: Controller | None
    sigma: float
    """[rad] of what is added to each action"""
    active: np.ndarray
    """(fragments, actions) bool: actions that do anything; the others are zero"""
    random: np.random.Generator

    def act(self, s: np.ndarray, k: np.ndarray) -> np.ndarray:
        noise = self.sigma * self.random.standard_normal((len(k), self.active.shape[1]))
        wanted = noise if self.policy is None else self.policy.act(s, k) + noise
        return np.where(self.active[k], wanted, 0.0)
