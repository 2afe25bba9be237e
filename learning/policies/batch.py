"""What a policy did in many worlds for some fragments, and how much better than expected that was."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np


@dataclass
class Batch:
    """What all worlds did in `steps` fragments; arrays (steps, worlds, ...), single precision."""

    x: np.ndarray
    """(steps + 1, worlds, obs) what the network felt, after the last fragment too"""
    k: np.ndarray
    """(steps + 1, worlds) fragments"""
    noise: np.ndarray
    """(steps, worlds, actions) how far actions were from the policy's, in sigma"""
    mean: np.ndarray
    """(steps, worlds, actions) what the network added"""
    log_sigma: np.ndarray
    """(actions,)"""
    reward: np.ndarray
    """(steps, worlds)"""
    failed: np.ndarray
    """(steps, worlds) bool"""


class Climb(Protocol):
    """Parameters of the climb of a clipped objective; see `ppo.PpoConfig`."""

    @property
    def epochs(self) -> int: ...

    @property
    def minibatch(self) -> int: ...

    @property
    def clip(self) -> float: ...

    @property
    def divergence(self) -> float: ...


def advantages(
    reward: np.ndarray, failed: np.ndarray, value: np.ndarray, gamma: float, smooth: float
) -> np.ndarray:
    """(steps, n) how much better than expected what followed was (GAE). reward, failed: (steps, n), value:
    (steps + 1, n)."""
    out, later = np.zeros_like(reward), np.zeros_like(reward[0])
    for t in reversed(range(len(reward))):
        goes_on = gamma * ~failed[t]
        later = reward[t] + goes_on * value[t + 1] - value[t] + smooth * goes_on * later
        out[t] = later
    return out
