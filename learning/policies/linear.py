"""Stepwise linear feedback policies (P1 Eq. 4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from ..starts import Streams


@dataclass
class LinearPolicy:
    """pi_k(s) = M_k s + a_hat_k, evaluated once at the start of fragment k; samples of it are drawn from
    N(pi_k(s), diag(sigma_k^2))."""

    M: np.ndarray
    """(fragments, actions, states)"""
    a_hat: np.ndarray
    """(fragments, actions) [rad]"""
    sigma: np.ndarray
    """(fragments, actions) [rad]"""

    @staticmethod
    def zero(fragments: int, actions: int, states: int, sigma: float = 0.0) -> LinearPolicy:
        """The open loop, as far as fragments go: no offset whatever the state."""
        return LinearPolicy(
            M=np.zeros((fragments, actions, states)),
            a_hat=np.zeros((fragments, actions)),
            sigma=np.full((fragments, actions), float(sigma)),
        )

    def act(self, s: np.ndarray, k: np.ndarray) -> np.ndarray:
        """Actions (n, actions) [rad] for states s (n, states) at the start of fragments k (n,)."""
        a = np.einsum("ns,nas->na", s, self.M[k])  # its bits do not depend on how many worlds there are
        return np.asarray(a + self.a_hat[k])

    def copy(self) -> LinearPolicy:
        return LinearPolicy(self.M.copy(), self.a_hat.copy(), self.sigma.copy())

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """By name, for a file."""
        return dict(vars(self))

    @staticmethod
    def of(arrays: Mapping[str, np.ndarray]) -> LinearPolicy:
        """From `arrays`, whatever else is among them. Raises KeyError for what lacks any."""
        return LinearPolicy(*(arrays[f.name] for f in fields(LinearPolicy)))

    def moved(self, other: LinearPolicy, share: float) -> LinearPolicy:
        """This policy, moved a share of the way to another."""
        pairs = zip(vars(self).values(), vars(other).values())
        return LinearPolicy(*((1.0 - share) * mine + share * its for mine, its in pairs))


class Explore:
    """A policy's actions with exploration noise, drawn anew for each world; the worlds of a unit of `streams`
    are in one fragment."""

    def __init__(self, policy: LinearPolicy, streams: Streams):
        self.policy, self.streams = policy, streams

    def act(self, s: np.ndarray, k: np.ndarray) -> np.ndarray:
        """Samples (n, actions) [rad] of N(pi_k(s), diag(sigma_k^2))."""
        policy, count, group = self.policy, self.streams.count, self.streams.group
        unit = k[::group]  # one product for each unit: its bits do not depend on how many there are
        a = s.reshape(count, group, -1) @ policy.M[unit].transpose(0, 2, 1) + policy.a_hat[unit, None]
        a = a + policy.sigma[unit, None] * self.streams.normal(group, a.shape[-1])
        return np.asarray(a.reshape(count * group, -1))
