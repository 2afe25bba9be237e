"""Which pushes a policy stands, by force and direction (P1 8)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...sims.planar import planar
from ..choose import RandomWalk
from ..rollout import Controller, Rollout
from ..starts import Starts, Streams
from ..tasks.follow import Follow
from ..tasks.locomotion import Locomotion

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
    controller: Controller,
    starts: Starts,
    seed: int = 0,
    progress: Callable[[int, str], None] | None = None,
) -> PushTable:
    """Push the players of a task ever harder until no direction is survived. progress: called with the
    rows done and a note."""
    rows: list[np.ndarray] = []
    for force in FORCES:
        rows.append(push_survival(task, controller, starts, force, seed))
        if progress:
            progress(len(rows), f" of {force} N")
        if not np.logical_and.accumulate(np.array(rows) >= ENOUGH, axis=0)[-1].any():
            break
    return PushTable(list(FORCES[: len(rows)]), np.array(rows))


def push_survival(
    task: Locomotion, controller: Controller, starts: Starts, force: float, seed: int = 0
) -> np.ndarray:
    """Share (8,) of players that stand AFTER seconds after a push of `force` [N] on the trunk, by the
    direction of the push from the way they face: forward, forward left, left, ...; NaN where nobody stood
    to be pushed. The worlds of the task share the directions; each is pushed at a random moment."""
    streams, period = Streams([np.random.default_rng(seed)], task.worlds), task.graph.period
    start = starts.draw(streams)
    moment = (streams.uniform() * task.graph.cycle).astype(int)
    push = Push(force, round(SETTLE / period) + moment, max(1, round(PUSH_TIME / period)), task.worlds)
    ends = push.begins + push.lasts + round(AFTER / period)
    fell, before = np.zeros(task.worlds, bool), np.zeros(task.worlds, bool)
    for fragment in Rollout(task, controller, RandomWalk(streams), start, push).fragments(ends.max()):
        before |= fell & (fragment.row == push.begins)
        fell |= fragment.failed & (fragment.row < ends)
        push.spared = fell
    pushed = np.bincount(push.way[~before], minlength=len(DIRECTIONS))
    stood = np.bincount(push.way[~before & ~fell], minlength=len(DIRECTIONS))
    return np.divide(stood, pushed, out=np.full(len(DIRECTIONS), np.nan), where=pushed > 0)


class Push:
    """Disturbs each world once, by a push from one of the DIRECTIONS."""

    def __init__(self, force: float, begins: np.ndarray, lasts: int, worlds: int):
        self.force, self.begins, self.lasts = force, begins, lasts
        self.way = np.arange(worlds) % len(DIRECTIONS)
        self.spared = np.zeros(worlds, bool)
        """who (worlds,) lies already"""
        self._row = 0

    def apply(self, task: Follow) -> None:
        """Set the forces of the coming fragment."""
        now = (self._row == self.begins) & ~self.spared
        facing = planar(task.sim.joint_q)[:, 2] + self.way * 2.0 * np.pi / len(DIRECTIONS)
        force = self.force * np.stack([np.cos(facing), np.sin(facing), 0.0 * facing], axis=1)
        task.course.push[now, 0] = force[now]
        task.course.push[self._row == self.begins + self.lasts, 0] = 0.0
        self._row += 1
