from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class LinearPolicy:
    """a = M_k s + a_hat_k, with exploration noise N(0, diag(sigma_k^2)) (P1 Eq. 4)."""

    M: np.ndarray
    """(fragments, actions, states)"""
    a_hat: np.ndarray
    """(fragments, actions) [rad]"""
    sigma: np.ndarray
    """(fragments, actions) [rad]"""

    @staticmethod
    def zero(fragments, actions, states, sigma):
        return LinearPolicy(
            np.zeros((fragments, actions, states)),
            np.zeros((fragments, actions)),
            np.full((fragments, actions), sigma),
        )

    def act(self, s, k):
        return np.einsum("nij,nj->ni", self.M[k], s) + self.a_hat[k]

    def copy(self):
        return LinearPolicy(self.M.copy(), self.a_hat.copy(), self.sigma.copy())
