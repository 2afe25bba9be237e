"""A way through a window that no step leads to, found by sweeps of particles: sequential Monte Carlo whose
look-ahead is the number of descendants, as in `smc`, from a single state and without feedback.

In a sweep every particle, a world each, tries offsets around those of the last sweep; after each fragment the
worse half gives way to copies of the better. Offsets whose particles have many descendants a little later are
where the next sweep looks. The line of the best particle at the end is a way through.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..choose import Ahead
from ..policies.em import descendants, select
from ..rollout import Rollout
from ..tasks.arms import Arms
from .windows import Given, Moment


@dataclass(frozen=True)
class SweepConfig:
    """Parameters of the sweeps."""

    sweeps: int = 24
    """at most"""
    more: int = 4
    """of them after the first that comes through, for a better way"""
    keep: float = 0.5
    """share of the particles that have children"""
    lag: int = 12
    """fragments after which descendants are counted"""
    sigma: float = 0.2
    """[rad] exploration in the first sweep"""
    least_sigma: float = 0.05
    """[rad] and at least"""
    shrink: float = 0.9
    """by which it becomes smaller from sweep to sweep"""
    near: float = 0.2
    """[m] Distances of the fingers beyond this count less and less."""


def swept(
    task: Arms, begin: Moment, k: np.ndarray, start: np.ndarray, c: SweepConfig, random: np.random.Generator
) -> np.ndarray | None:
    """Actions (n, 20) in fragments k (n,) that keep the ball, begun at a moment; None where no sweep comes
    through. start: actions around which the first sweep looks."""
    n, P = len(k), task.worlds
    mean, sigma = start.copy(), c.sigma
    best, least, left = None, np.inf, c.sweeps
    for _ in range(c.sweeps):
        if left == 0:
            break
        left -= 1
        action = mean[:, None] + sigma * random.standard_normal((n, P, start.shape[1]))
        action[:, 0] = mean
        action = np.where(task.active[k][:, None], action, 0.0)
        parents, total = _sweep(task, begin, action, c)
        reached = len(parents)
        counts = descendants(parents, c.lag)[:, :, None]
        tried, weight = action[:reached], np.maximum(counts.sum(axis=1), 1)
        mean[:reached] = (counts * tried).sum(axis=1) / weight
        sigma = max(c.least_sigma, c.shrink * sigma)
        if reached == n and np.isfinite(total.min()):
            left = min(left, c.more)
            if total.min() < least:
                least, best = float(total.min()), _line(action, parents, int(np.argmin(total)))
    return best


def _sweep(task: Arms, begin: Moment, action: np.ndarray, c: SweepConfig) -> tuple[np.ndarray, np.ndarray]:
    """Whose copy each particle (rows, particles) was after each fragment until all were lost, and what the
    particles that stand after the last cost in all."""
    P = task.worlds
    rollout = Rollout(task, Given(action), Ahead(), begin.starts(P))
    begin.put(task)
    parents, total = [], np.zeros(P)
    usual, task.near = task.near, c.near
    try:
        for fragment in rollout.fragments(len(action)):
            parent, lost = select(fragment.cost[None], c.keep)
            if lost[0]:
                break
            parents.append(parent[0])
            total = (total + fragment.cost)[parent[0]]
            rollout.become(parent[0])
    finally:
        task.near = usual
        task.calm()
    return np.array(parents, int).reshape(-1, P), total


def _line(action: np.ndarray, parents: np.ndarray, world: int) -> np.ndarray:
    """(n, 20) what the particle that is `world` at the end has done."""
    out = np.empty((len(action), action.shape[2]))
    for row in reversed(range(len(action))):
        world = int(parents[row, world])
        out[row] = action[row, world]
    return out
