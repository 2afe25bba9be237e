"""What learners of linear policies by expectation maximisation share: particles that give way to copies of
better ones, how many descendants an action has a little later, and the weighted ridge regression of the
actions on the states they were taken in. docs/locomotion.md derives it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .linear import LinearPolicy


class Regression(Protocol):
    """Parameters of the M-step; see `samcon.SamconConfig`."""

    @property
    def ridge(self) -> float: ...

    @property
    def doubt(self) -> float: ...

    @property
    def least_sigma(self) -> float: ...


def select(E: np.ndarray, keep: float) -> tuple[np.ndarray, np.ndarray]:
    """The particle (islands, particles) of its island whose copy each one becomes, and which islands
    (islands,) have none left; E: costs (islands, particles). The best `keep` of an island stay; the others
    become copies of them, of the best first."""
    islands, particles = E.shape
    own, order = np.arange(islands)[:, None], np.argsort(E, axis=1, kind="stable")
    alive = np.minimum(np.isfinite(E).sum(axis=1), max(1, round(keep * particles)))
    child = np.arange(particles) % np.maximum(alive, 1)[:, None]
    parent = np.empty((islands, particles), int)
    parent[own, order] = order[own, child]
    return parent, alive == 0


def descendants(parent: np.ndarray, lag: int) -> np.ndarray:
    """How many particles `lag` rows later descend from each one (rows, particles), or at the end, for the
    last rows. parent: (rows, particles), whose copy each one is after its row; -1: the walk began anew."""
    rows, particles = parent.shape
    nobody = np.concatenate([parent, np.full((rows, 1), -1)], axis=1)
    counts = np.zeros((rows, particles), int)
    for row in range(rows):
        line = np.arange(particles)
        for later in nobody[row : row + lag + 1][::-1]:
            line = later[line]
        counts[row] = np.bincount(line[line >= 0], minlength=particles)
    return counts


@dataclass
class Moments:
    """What the M-step has to know of the actions that had descendants: sums over them by fragment, which
    add up over islands. w: descendants, s: state (S), a: action (A)."""

    w: np.ndarray
    """(fragments,)"""
    ww: np.ndarray
    """(fragments,)"""
    s: np.ndarray
    """(fragments, S) of w s"""
    a: np.ndarray
    """(fragments, A)"""
    ss: np.ndarray
    """(fragments, S, S)"""
    sa: np.ndarray
    """(fragments, S, A)"""
    aa: np.ndarray
    """(fragments, A) of w a^2"""

    @staticmethod
    def of(S: np.ndarray, A: np.ndarray, k: np.ndarray, W: np.ndarray, fragments: int) -> Moments:
        """From samples: states S (n, S), actions A (n, A), fragments k (n,), descendants W (n,)."""
        n, m = S.shape[1], A.shape[1]
        shapes = ((), (), (n,), (m,), (n, n), (n, m), (m,))
        out = Moments(*(np.zeros((fragments, *shape)) for shape in shapes))
        used = W > 0
        S, A, k, W = S[used], A[used], k[used], W[used].astype(float)
        for i in np.unique(k):
            s, a, w = (x[k == i] for x in (S, A, W))
            ws, wa = w[:, None] * s, w[:, None] * a
            parts = w.sum(), w @ w, ws.sum(axis=0), wa.sum(axis=0), ws.T @ s, ws.T @ a, np.sum(wa * a, axis=0)
            for total, part in zip(vars(out).values(), parts):
                total[i] = part
        return out

    def scaled(self, by: float) -> Moments:
        """Of actions that each count `by` as much."""
        return Moments(*(by * by * x if name == "ww" else by * x for name, x in vars(self).items()))

    def __add__(self, other: Moments) -> Moments:
        return Moments(*(x + y for x, y in zip(vars(self).values(), vars(other).values())))


def improve(policy: LinearPolicy, seen: Moments, config: Regression, feedback: bool) -> LinearPolicy:
    """M-step: the policy that makes the actions with descendants likely, near the old one.

    With weights w that sum to one, means s_, a_ and residuals about them, M solves
    min sum w |a - M s|^2 + (ridge + doubt / n) |M - M_old|^2, n = 1 / sum w^2; then
    a_hat = a_ - M s_ and sigma^2 is the mean of the old one and the residuals'. Without feedback only
    a_hat moves.
    """
    new = policy.copy()
    for k in np.flatnonzero(seen.w):
        w = seen.w[k]
        n = w**2 / seen.ww[k]
        mean_s, mean_a = seen.s[k] / w, seen.a[k] / w
        if not feedback:
            new.a_hat[k] += n / (n + 5.0) * (mean_a - policy.a_hat[k])
            continue
        ss = seen.ss[k] / w - np.outer(mean_s, mean_s)
        sa = seen.sa[k] / w - np.outer(mean_s, mean_a)
        aa = seen.aa[k] / w - mean_a**2
        pull = (config.ridge + config.doubt / n) * np.eye(len(ss))
        new.M[k] += np.linalg.solve(ss + pull, sa - ss @ policy.M[k].T).T
        new.a_hat[k] = mean_a - new.M[k] @ mean_s
        M = new.M[k]
        spread = aa - 2.0 * np.sum(M * sa.T, axis=1) + np.sum(M @ ss * M, axis=1)
        spread = np.maximum(spread, 0.0)
        new.sigma[k] = np.sqrt(np.maximum(0.5 * policy.sigma[k] ** 2 + 0.5 * spread, config.least_sigma**2))
    return new


def added(parts: Sequence[Moments]) -> Moments:
    """Their sum, in their order."""
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total
