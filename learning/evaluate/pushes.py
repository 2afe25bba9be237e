"""Which pushes a policy stands, by force and direction (P1 8)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..policies.linear import LinearPolicy
from ..tasks.disturbance import PUSHED
from ..tasks.locomotion import Locomotion
from .trials import States, planar

DIRECTIONS = (
    "forward",
    "forward left",
    "left",
    "back left",
    "back",
    "back right",
    "right",
    "forward right",
)
"""Of pushes, from the way the player faces."""
PUSH_TIME = 0.2
"""[s]"""
SETTLE, AFTER = 1.0, 4.0
"""[s] before a push, and within which a fall is put down to it."""
PLAYERS = 64 * len(DIRECTIONS)
"""Players pushed for a row of the table."""
FORCES = tuple(range(50, 1001, 50))
"""[N] tried in turn, until all directions are lost."""
ENOUGH = 0.95
"""Share that has to survive a push that counts as survived."""


@dataclass
class PushTable:
    """Shares that survive, a row per force."""

    forces: list[int]
    """[N]"""
    survived: np.ndarray
    """(forces, 8), by direction; NaN where nobody stood to be pushed"""

    def largest(self) -> np.ndarray:
        """(8,) [N] by direction: what ENOUGH survive, as they do whatever is smaller; 0 for none."""
        holds = np.logical_and.accumulate(self.survived >= ENOUGH, axis=0)
        return np.where(holds, np.array(self.forces, float)[:, None], 0.0).max(axis=0)


def push_table(
    task: Locomotion,
    policy: LinearPolicy,
    states: States,
    seed: int = 0,
    progress: Callable[[int, str], None] | None = None,
) -> PushTable:
    """Push the players of a task ever harder until no direction is survived. progress: called with the
    rows done and a note."""
    rows = []
    for force in FORCES:
        rows.append(push_survival(task, policy, states, force, seed))
        if progress:
            progress(len(rows), f" of {force} N")
        if not np.logical_and.accumulate(np.array(rows) >= ENOUGH, axis=0)[-1].any():
            break
    return PushTable(list(FORCES[: len(rows)]), np.array(rows))


def push_survival(
    task: Locomotion, policy: LinearPolicy, states: States, force: float, seed: int = 0
) -> np.ndarray:
    """Share (8,) of players that stand AFTER seconds after a push of `force` [N] on the torso, by the
    direction of the push from the way they face: forward, forward left, left, ...; NaN where nobody stood
    to be pushed. The worlds of the task share the directions; each is pushed at a random moment."""
    random = np.random.default_rng(seed)
    graph, n = task.graph, task.sim.world_count
    start = states.draw(n, random)
    k = start.k
    felt = task.reset(k, start.joint_q, start.joint_qd)
    task.calm()
    which = np.arange(n) % len(DIRECTIONS)
    begins = round(SETTLE / graph.period) + random.integers(graph.count, size=n)
    lasts = max(1, round(PUSH_TIME / graph.period))
    after = round(AFTER / graph.period)
    fell, before, applied = np.zeros(n, bool), np.zeros(n, bool), np.zeros((n, 3))
    for row in range(begins.max() + lasts + after):
        facing = planar(task.sim.joint_q)[:, 2] + which * 2.0 * np.pi / len(DIRECTIONS)
        new = row == begins
        whom = new & ~fell
        applied[whom] = force * np.stack([np.cos(facing), np.sin(facing), 0.0 * facing], axis=1)[whom]
        applied[row == begins + lasts] = 0.0
        task.sim.apply_force(PUSHED, applied)
        before |= fell & new
        felt = task.advance(k, policy.act(task.state(felt, k), k))
        fell |= task.fallen(felt, k) & (row < begins + lasts + after)
        k = graph.follow(k, random)
    task.calm()
    pushed = np.bincount(which[~before], minlength=len(DIRECTIONS))
    stood = np.bincount(which[~before & ~fell], minlength=len(DIRECTIONS))
    return np.divide(stood, pushed, out=np.full(len(DIRECTIONS), np.nan), where=pushed > 0)
