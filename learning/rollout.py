"""The closed loop: disturb, act, simulate, judge, follow. Nothing else calls `act` and `advance`; learners,
trials, pushes and recordings are folds over it.

    for fragment in Rollout(task, controller, chooser, starts).fragments(200):
        ...
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .graph import STEPS, ControlGraph

if TYPE_CHECKING:
    from .choose import Chooser
    from .starts import Starts


class Controller(Protocol):
    """What decides: linear, a network, nothing at all."""

    def act(self, obs: np.ndarray, k: np.ndarray) -> np.ndarray:
        """Actions (worlds, actions) [rad] for observations (worlds, obs) at the start of fragments k."""
        ...


class Disturbs(Protocol):
    """What a task's worlds have to stand."""

    def apply(self, task: Any) -> None:
        """Set the forces and offsets of the coming fragment."""
        ...


class Task(Protocol):
    """A control problem in `worlds` worlds that follow a control graph."""

    graph: ControlGraph
    worlds: int
    actions: int
    obs: int

    def reset(self, starts: Starts, which: np.ndarray | None = None) -> None:
        """Put worlds into states, all of them or those of a mask (worlds,), a state for each."""
        ...

    def observe(self, k: np.ndarray) -> np.ndarray:
        """(worlds, obs) at the start of fragments k."""
        ...

    def advance(self, k: np.ndarray, action: np.ndarray, first: int = 0, count: int = STEPS) -> None:
        """Simulate steps first ... first + count - 1 of fragments k under actions (worlds, actions)."""
        ...

    def judge(self, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the fragments k that have just ended cost (worlds,), infinite for who has failed, and who
        has (worlds,) bool."""
        ...

    def become(self, sources: np.ndarray) -> None:
        """Every world becomes a copy of another (worlds,)."""
        ...

    def calm(self) -> None:
        """End all disturbances."""
        ...


@dataclass
class Fragment:
    """A control fragment that all worlds have gone through."""

    row: int
    """fragments before it"""
    k: np.ndarray
    """(worlds,) which it was"""
    obs: np.ndarray
    """(worlds, obs) at its start"""
    action: np.ndarray
    """(worlds, actions) [rad]"""
    cost: np.ndarray
    """(worlds,), infinite for who has failed"""
    failed: np.ndarray
    """(worlds,) bool"""


class Rollout:
    """A task, a controller and a chooser in a closed loop, from `starts`, a state for each world."""

    def __init__(
        self,
        task: Task,
        controller: Controller,
        chooser: Chooser,
        starts: Starts,
        disturber: Disturbs | None = None,
    ):
        self.task, self.controller, self.chooser, self.disturber = task, controller, chooser, disturber
        self.k = np.array(starts.k)
        """(worlds,) fragment that each world is in"""
        self.failed = np.zeros(task.worlds, bool)
        """(worlds,) who has failed in the last fragment"""
        self.row = 0
        self._began = np.zeros(task.worlds, bool)
        task.calm()
        task.reset(starts)
        if begin := getattr(controller, "begin", None):
            begin()  # of a controller that remembers what it has done

    def fragments(self, count: int) -> Iterator[Fragment]:
        """Go through so many fragments, whole ones at a time. Disturbances end with the last."""
        for _ in range(count):
            obs, action = self._act()
            self.task.advance(self.k, action)
            yield self._end(obs, action)
            self._follow()
        self.task.calm()

    def steps(self, count: int) -> Iterator[int]:
        """The same, a time step at a time: yields the step, from 0, of the fragment `k`."""
        for _ in range(count):
            obs, action = self._act()
            for step in range(STEPS):
                self.task.advance(self.k, action, step, 1)
                yield step
            self._end(obs, action)
            self._follow()
        self.task.calm()

    def become(self, sources: np.ndarray) -> None:
        """After a fragment: every world becomes a copy of another (worlds,), and goes its way."""
        self.task.become(sources)
        self.k, self._began = self.k[sources], self._began[sources]

    def restart(self, starts: Starts, which: np.ndarray) -> None:
        """After a fragment: those of a mask (worlds,) go on from `starts` instead, a state for each of
        them."""
        self.task.reset(starts, which)
        self.k = np.array(self.k)
        self.k[which] = starts.k
        self._began = self._began | which

    def _act(self) -> tuple[np.ndarray, np.ndarray]:
        if self.disturber is not None:
            self.disturber.apply(self.task)
        obs = self.task.observe(self.k)
        return obs, self.controller.act(obs, self.k)

    def _end(self, obs: np.ndarray, action: np.ndarray) -> Fragment:
        cost, failed = self.task.judge(self.k)
        self.row += 1
        self.failed = failed
        return Fragment(self.row - 1, self.k, obs, action, cost, failed)

    def _follow(self) -> None:
        after = self.chooser.next(self.task.graph, self.k)
        self.k = np.where(self._began, self.k, after)
        self._began = np.zeros_like(self._began)
