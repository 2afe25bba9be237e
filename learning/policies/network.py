"""Policies that are networks: on top of a linear one, two hidden layers that feel the state and know which
fragment it is.

    h_1 = elu(W_1 x + e_k),  h_2 = elu(W_2 h_1 + b_2),  a = M_k s + a_hat_k + r (W_3 h_2 + b_3)

x is the state s, in units in which it varies by one, cut off at LIMIT; e_k are numbers that each fragment
has for itself, as if x had a one-hot number of the fragment.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

OWN = ("M", "a_hat", "mean", "scale", "reach")
LIMIT = 8.0
"""Of each number that a network is given."""


@dataclass(frozen=True)
class Network:
    """Layers as arrays, single precision."""

    W1: np.ndarray
    """(obs, H)"""
    e: np.ndarray
    """(fragments, H)"""
    W2: np.ndarray
    """(H, H)"""
    b2: np.ndarray
    W3: np.ndarray
    """(H, out)"""
    b3: np.ndarray

    def __call__(self, x: np.ndarray, k: np.ndarray) -> np.ndarray:
        """(n, out) for x (n, obs) in fragments k (n,)."""
        h = elu(x @ self.W1 + self.e[k])
        h = elu(h @ self.W2 + self.b2)
        return np.asarray(h @ self.W3 + self.b3)

    @staticmethod
    def names() -> list[str]:
        return [f.name for f in fields(Network)]


def elu(x: np.ndarray) -> np.ndarray:
    """x where it is positive, exp(x) - 1 where not."""
    return np.maximum(x, 0.0) + np.expm1(np.minimum(x, 0.0))


@dataclass(frozen=True)
class NetworkPolicy:
    """The policy; deterministic."""

    M: np.ndarray
    """(fragments, actions, n) what a linear policy does with the first n numbers of the state"""
    a_hat: np.ndarray
    """(fragments, actions) [rad]"""
    mean: np.ndarray
    """(obs,) of the state"""
    scale: np.ndarray
    """(obs,) by which it varies"""
    reach: np.ndarray
    """() [rad] r, what the network's numbers count"""
    network: Network

    def act(self, s: np.ndarray, k: np.ndarray) -> np.ndarray:
        """Actions (n, actions) [rad] for states s (n, obs) at the start of fragments k (n,)."""
        return self.base(s, k) + self.reach * self.network(self.felt(s), k)

    def base(self, s: np.ndarray, k: np.ndarray) -> np.ndarray:
        """What is done without the network."""
        a = np.einsum("ns,nas->na", s[:, : self.M.shape[2]], self.M[k])
        return np.asarray(a + self.a_hat[k])

    def felt(self, s: np.ndarray) -> np.ndarray:
        """x (n, obs), what the network is given."""
        x = (s - self.mean) / self.scale
        return np.clip(x, -LIMIT, LIMIT).astype(np.float32)

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """By name, for a file."""
        own = {name: np.asarray(getattr(self, name)) for name in OWN}
        return own | {f"network.{name}": np.asarray(getattr(self.network, name)) for name in Network.names()}

    @staticmethod
    def of(arrays: Mapping[str, np.ndarray]) -> NetworkPolicy:
        """From `arrays`. Raises KeyError for what lacks any."""
        layers = {name: np.asarray(arrays[f"network.{name}"], np.float32) for name in Network.names()}
        own = {name: np.asarray(arrays[name], float) for name in OWN}
        return NetworkPolicy(**own, network=Network(**layers))
