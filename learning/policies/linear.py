"""Stepwise linear feedback policies (P1 Eq. 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
        a = self.a_hat[k]
        for i in np.unique(k):
            rows = k == i
            a[rows] += s[rows] @ self.M[i].T
        return a

    def sample(self, s: np.ndarray, k: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Actions with exploration noise."""
        return self.act(s, k) + self.sigma[k] * random.standard_normal((len(k), self.a_hat.shape[1]))

    def copy(self) -> LinearPolicy:
        return LinearPolicy(self.M.copy(), self.a_hat.copy(), self.sigma.copy())

    def moved(self, other: LinearPolicy, share: float) -> LinearPolicy:
        """This policy, moved a share of the way to another."""
        pairs = zip(vars(self).values(), vars(other).values())
        return LinearPolicy(*((1.0 - share) * mine + share * its for mine, its in pairs))
