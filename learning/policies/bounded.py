"""The policy of Liu and Hodgins 2018, Fig. 8: a hidden layer of leaky units, a bounded output.

    h = f(V_1 x + c_1),  a = g(V_2 h + c_2),  x = (s, k)

f is Eq. 18, g Eq. 19. Eq. 3 and Fig. 8 leave open how the number k of a fragment enters a network; PHASES
has three ways.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

LIMIT = 8.0
"""Of each number of the state."""
PHASES = ("one-hot", "circle", "none")
"""One number for each fragment, that of k one; sine and cosine of how far the cycle has gone; nothing."""


def phase_table(kind: str, fragments: int) -> np.ndarray:
    """(fragments, n) the numbers that stand for each fragment. Raises ValueError for a kind not in PHASES."""
    if kind == "none":
        return np.zeros((fragments, 0))
    if kind == "circle":
        angle = 2.0 * np.pi * np.arange(fragments) / fragments
        return np.stack([np.sin(angle), np.cos(angle)], axis=1)
    if kind == "one-hot":
        return np.eye(fragments)
    raise ValueError(f"there is no phase '{kind}'; there are {', '.join(PHASES)}")


@dataclass(frozen=True)
class BoundedPolicy:
    """The policy; deterministic."""

    mean: np.ndarray
    """(obs,) of the state"""
    scale: np.ndarray
    """(obs,) by which it varies"""
    phase: np.ndarray
    """(fragments, n) numbers that stand for each fragment"""
    active: np.ndarray
    """(fragments, actions) 1 for actions that do anything in a fragment, 0 for others"""
    V1: np.ndarray
    """(obs + n, H)"""
    c1: np.ndarray
    V2: np.ndarray
    """(H, actions)"""
    c2: np.ndarray
    bound: np.ndarray
    """() b of Eq. 19"""
    slope: np.ndarray
    """() of leaky units, and beyond the bound"""

    def act(self, s: np.ndarray, k: np.ndarray) -> np.ndarray:
        """Actions (n, actions) [rad] for states s (n, obs) at the start of fragments k (n,)."""
        z = self.felt(s, k) @ self.V1 + self.c1
        u = np.maximum(z, self.slope * z) @ self.V2 + self.c2
        inside = np.clip(u, -self.bound, self.bound)
        return np.asarray((inside + self.slope * (u - inside)) * self.active[k])

    def felt(self, s: np.ndarray, k: np.ndarray) -> np.ndarray:
        """x (n, obs + n) float32, what the network is given."""
        x = np.clip((s - self.mean) / self.scale, -LIMIT, LIMIT)
        return np.concatenate([x, self.phase[k]], axis=1).astype(np.float32)

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """By name, for a file."""
        return {name: np.asarray(part) for name, part in vars(self).items()}

    @staticmethod
    def of(arrays: Mapping[str, np.ndarray]) -> BoundedPolicy:
        """From `arrays`. Raises KeyError for what lacks any."""
        return BoundedPolicy(*(np.asarray(arrays[f.name]) for f in fields(BoundedPolicy)))
