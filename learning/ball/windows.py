"""A cycle cut into windows at its checkpoints (P1 5.1, Fig. 6), and candidates for them that are tried at
once, a world each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...sims.worlds import State
from ..arrays import Arrays
from ..choose import Ahead
from ..graph import STEPS, ControlGraph
from ..rollout import Rollout
from ..starts import Starts
from ..tasks.arms import Arms
from .optimised import Optimised

LONGEST = 16
"""Fragments of a window, unless nobody has the ball for so long."""


def windows_of(graph: ControlGraph) -> list[np.ndarray]:
    """The fragments (n,) of each window of a cycle, the first of which begins after the first checkpoint;
    each ends with the fragment of a checkpoint, or before, while a hand has the ball, if it would be longer
    than LONGEST. A clip's first begins when a hand first has the ball, its last ends with the clip. Raises
    ValueError for a graph that is neither a cycle nor a clip, or has no checkpoint."""
    return [part for window in _between_checkpoints(graph) for part in _short(graph, window)]


def holding(graph: ControlGraph, k: int) -> np.ndarray:
    """(2,) bool: the hands that should have the ball when fragment k begins."""
    assert graph.touch is not None
    return np.asarray(graph.touch[0 if k == 0 and graph.ends else k * STEPS - 1])


def _short(graph: ControlGraph, window: np.ndarray) -> list[np.ndarray]:
    """A window, or parts of it that end while a hand has the ball."""
    if len(window) <= LONGEST or graph.touch is None:
        return [window]
    held = graph.touch[(window + 1) * STEPS - 1].any(axis=1)[:-1]
    if not held.any():
        return [window]
    places = np.flatnonzero(held) + 1
    cut = int(places[np.argmin(np.abs(places - len(window) / 2))])
    return [part for half in np.split(window, [cut]) for part in _short(graph, half)]


def _between_checkpoints(graph: ControlGraph) -> list[np.ndarray]:
    if graph.checkpoints is None or not len(graph.checkpoints):
        raise ValueError("the graph has no checkpoint: nothing says when a hand must have the ball")
    ends = set((np.asarray(graph.checkpoints) // STEPS).tolist())
    if graph.ends:
        begins = [k for k in range(graph.count) if holding(graph, k).any()]
        if not begins:
            raise ValueError("no hand has the ball where a fragment begins")
        line = np.arange(begins[0], graph.count)
        return [part for part in np.split(line, np.flatnonzero([k in ends for k in line]) + 1) if len(part)]
    cycle = [int(graph.follow(np.array([min(ends)]))[0])]
    while len(cycle) < graph.count and cycle[-1] != min(ends):
        cycle.append(int(graph.follow(np.array(cycle[-1:]))[0]))
    if cycle[-1] != min(ends) or not ends <= set(cycle):
        raise ValueError("the graph is no cycle that goes through all of its checkpoints")
    cuts = np.flatnonzero([k in ends for k in cycle])[:-1] + 1
    return np.split(np.array(cycle), cuts)


@dataclass(frozen=True)
class Moment:
    """A world between two fragments: all that decides how it goes on."""

    k: int
    """fragment that begins"""
    state: State
    """of one world"""
    heading: float
    """[rad] that it should face"""
    felt: np.ndarray
    """(n,) what the task's probe said last"""

    @staticmethod
    def of(task: Arms, k: int, world: int = 0) -> Moment:
        """A world as it is now."""
        return Moment(k, task.sim.state().select([world]), float(task.heading[world]), task.felt[world])

    def put(self, task: Arms) -> None:
        """All worlds of a task become it."""
        task.sim.place(self.state, np.zeros(task.worlds, int))
        task.heading = np.full(task.worlds, self.heading)
        task.felt = np.repeat(self.felt[None], task.worlds, axis=0)

    def starts(self, worlds: int) -> Starts:
        """The same without contact history, for each world."""
        q, qd = self.state.joint_q, self.state.joint_qd
        return Starts(np.full(worlds, self.k), np.repeat(q, worlds, axis=0), np.repeat(qd, worlds, axis=0))

    @property
    def arrays(self) -> Arrays:
        """By name, for a file."""
        state = {f"state.{name}": value for name, value in self.state.arrays.items()}
        return state | {"k": np.array(self.k), "heading": np.array(self.heading), "felt": self.felt}

    @staticmethod
    def from_arrays(arrays: Arrays) -> Moment:
        state = {name[6:]: value for name, value in arrays.items() if name.startswith("state.")}
        return Moment(int(arrays["k"]), State.made(state), float(arrays["heading"]), arrays["felt"])


@dataclass(frozen=True)
class Tried:
    """What became of candidates, a world each, fragment after fragment, until all had lost the ball."""

    k: np.ndarray
    """(total,) fragments that were to be simulated, of which n were"""
    action: np.ndarray
    """(total, worlds, 20)"""
    joint_q: np.ndarray
    """(n, worlds, nq) where each fragment began"""
    joint_qd: np.ndarray
    """(n, worlds, nv)"""
    felt: np.ndarray
    """(n, worlds, p) what the task's probe said where it ended"""
    fingers: np.ndarray
    """(n, worlds) [m] mean distance of the fingers from the ball in H (Eq. 7), NaN where H has no frame"""
    missed: np.ndarray
    """(n, worlds) no hand at the ball at a checkpoint"""
    failed: np.ndarray
    """(n, worlds) the task says so"""
    room: np.ndarray
    """(n, worlds, 2) [m] between the ball and both forearms; seen closely only"""
    trouble: np.ndarray
    """(n, worlds) step of the first bad contact or fall, -1 where there is none; seen closely only"""
    height: np.ndarray
    """(n, worlds) [m] of the ball at a checkpoint; seen closely only"""
    after: tuple[State, np.ndarray] | None
    """all worlds, and the headings (worlds,), where the first window ended; None where none came so far"""

    def found(self, world: int, count: int) -> Optimised:
        """The first `count` fragments of a world."""
        own = (slice(count), world)
        parts = (self.action[own], self.joint_q[own], self.joint_qd[own], self.fingers[own])
        return Optimised(self.k[:count], *(part.copy() for part in parts))

    def moment(self, world: int, count: int, k: int) -> Moment:
        """A world after `count` fragments, the first window, when fragment k begins."""
        assert self.after is not None
        state, heading = self.after
        return Moment(k, state.select([world]), float(heading[world]), self.felt[count - 1, world].copy())


def actions_of(candidates: np.ndarray, free: np.ndarray) -> np.ndarray:
    """(total, m, 20) that candidates (m, n) say, the numbers that are free (total, 20) in a row."""
    action = np.zeros((len(candidates), *free.shape))
    action[:, free] = candidates
    return action.transpose(1, 0, 2)


class Given:
    """The controller that does what it is given, (n, worlds, 20), fragment after fragment."""

    def __init__(self, action: np.ndarray):
        self.action, self.row = action, 0

    def act(self, obs: np.ndarray, k: np.ndarray) -> np.ndarray:
        self.row += 1
        return np.asarray(self.action[self.row - 1])


def attempt(task: Arms, begin: Moment, k: np.ndarray, action: np.ndarray, count: int) -> Tried:
    """Actions (total, worlds, 20) in fragments k (total,) that follow each other, from a moment on, in all
    worlds of a task. count: fragments of the first window. Ends where the ball was missed in all worlds, as
    P1 ends each at a failed checkpoint."""
    rollout = Rollout(task, Given(action), Ahead(), begin.starts(task.worlds))
    begin.put(task)
    rows: list[tuple[np.ndarray, ...]] = []
    after, lost = None, np.zeros(task.worlds, bool)
    joint_q, joint_qd = task.sim.joint_q, task.sim.joint_qd
    for fragment in rollout.fragments(len(k)):
        seen = (task.felt, task.fingers, task.missed, fragment.failed, task.room, task.trouble, task.height)
        rows.append((joint_q, joint_qd, *seen))
        joint_q, joint_qd = task.sim.joint_q, task.sim.joint_qd
        if len(rows) == count:
            after = task.sim.state(), task.heading.copy()
        lost |= task.missed
        if lost.all():
            break
    names = ("joint_q", "joint_qd", "felt", "fingers", "missed", "failed", "room", "trouble", "height")
    columns = {name: np.stack(column) for name, column in zip(names, zip(*rows))}
    return Tried(k, action, after=after, **columns)
