"""Cycle after cycle of offsets, a window an iteration (P1 Fig. 6); how a window is optimised is another's."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Arrays, above, below
from ..runs.stage import Report
from ..starts import Starts
from ..tasks.arms import Arms, OutOfTime
from .hold import in_hand
from .optimised import Optimised
from .windows import Moment, holding, windows_of

SHRINK = 0.9
"""[-] of what was found before, where a fragment is optimised anew (P1 5.1)"""
FRESH = 20
"""windows after which the result is written"""
MEMORY = 10
"""times that a fragment was optimised after which its moving average forgets (Eq. 10)"""


@dataclass
class Window(Report):
    """A window in numbers."""

    found: int
    """1; 0: the player loses the ball whatever was tried, or the time is up, and that was the last window"""
    cycles: int
    """found so far"""
    fingers: float
    """[cm] mean distance from the ball in H, the first term of Eq. 6"""
    offsets: float
    """[rad] mean length of the offsets of the arms that act on the ball (Fig. 11)"""
    rounds: int
    """batches of candidates that were tried"""
    samples_per_second: float
    """fragments simulated per second of everything"""
    outside: float
    """share of the time that is not simulation"""


@dataclass(frozen=True)
class Chosen:
    """What was found for a window."""

    found: Optimised
    after: Moment
    """where it ended, when the next one begins"""
    ahead: np.ndarray
    """(n, 20) what the next window begins with"""


def moved(mean: np.ndarray, action: np.ndarray, times: np.ndarray) -> np.ndarray:
    """The moving average of actions (n, 20) optimised for the `times`-th (n,) time (Eq. 10)."""
    beta = 1.0 / np.minimum(times, MEMORY)[:, None]
    return np.asarray((1.0 - beta) * mean + beta * action)


class Cycles:
    """Optimises window after window, each from where the one before ended; everything that its future
    depends on is in `state`. tasks: worlds to try candidates in, all with the same graph. cycles: to be
    found, in `tries` windows at most.

    The first begins with the ball in the hands that have it at the first checkpoint."""

    def __init__(self, tasks: Sequence[Arms], cycles: int, tries: int, seed: int = 0):
        self.tasks, self.tries, self.seed = list(tasks), tries, seed
        task = self.tasks[0]
        graph, self.active = task.graph, task.active
        self.windows = windows_of(graph)
        self.wanted = (1 if graph.ends else cycles) * len(self.windows)
        k = int(self.windows[0][0])
        self.begin = self.in_hand(k)
        self.found: list[Optimised] = []
        self.mean, self.times = np.zeros((graph.count, task.actions)), np.zeros(graph.count, int)
        self.ahead = np.zeros((len(self.windows[0]), task.actions))
        self.iteration, self.stuck, self.late = 0, False, False

    def until(self, late: Callable[[], bool]) -> None:
        """Search only until `late` says true, which is asked all the time: a window that is not found by then
        is given up (`late`)."""
        self.late = False
        for task in self.tasks:
            task.late = late

    def in_hand(self, k: int) -> Moment:
        """The ball in the hand, when fragment k begins."""
        task, graph = self.tasks[0], self.tasks[0].graph
        joint_q = in_hand(task.model, graph.start_q[k], holding(graph, k))
        joint_qd = graph.start_qd[k]
        task.reset(Starts(*(np.repeat(np.array([x]), task.worlds, axis=0) for x in (k, joint_q, joint_qd))))
        return Moment.of(task, k)

    @property
    def done(self) -> bool:
        return self.stuck or self.late or self.iteration >= min(self.wanted, self.tries)

    def window(self, later: int = 0) -> np.ndarray:
        """The fragments of the window that comes next, or of a later one."""
        return self.windows[(self.iteration + later) % len(self.windows)]

    def known(self, k: np.ndarray) -> np.ndarray:
        """(n, 20) what windows of fragments k begin with that were optimised in an earlier cycle, if any."""
        return np.asarray(SHRINK * self.mean[k])

    def optimise(self) -> Chosen | None:
        """The next window, begun at `begin` with `ahead`; None where the ball is lost whatever is tried."""
        raise NotImplementedError

    def iterate(self) -> Window:
        """One window further."""
        began, before, rounds = time.perf_counter(), self._spent, self.rounds
        try:
            chosen = self.optimise()
            self.stuck = chosen is None
        except OutOfTime:
            chosen, self.late = None, True
        if chosen is None:
            fingers = offsets = np.nan
        else:
            k, action = chosen.found.k, chosen.found.action
            mean, times = self.mean.copy(), self.times.copy()
            times[k] += 1
            mean[k] = moved(mean[k], action, times[k])
            self.mean, self.times = mean, times
            self.found = [*self.found, chosen.found]
            self.begin, self.ahead = chosen.after, chosen.ahead
            self.iteration += 1
            held = self.tasks[0].held[k]
            fingers = 100.0 * float(np.nansum(chosen.found.fingers * held) / held.sum())
            offsets = float(chosen.found.offsets(self.active[k]).mean())
        seconds = time.perf_counter() - began
        samples, simulating = np.subtract(self._spent, before)
        return Window(
            self.iteration,
            fresh=bool(self.found) and (self.done or self.iteration % FRESH == 0),
            found=int(chosen is not None),
            cycles=self.iteration // len(self.windows),
            fingers=fingers,
            offsets=offsets,
            rounds=self.rounds - rounds,
            samples_per_second=float(samples / seconds),
            outside=float(1.0 - simulating / seconds),
        )

    rounds = 0
    """batches tried so far, in this process"""

    @property
    def _spent(self) -> tuple[float, float]:
        """Fragments simulated so far, and the seconds that this took."""
        return sum(task.samples for task in self.tasks), sum(task.simulating for task in self.tasks)

    @property
    def result(self) -> Arrays | None:
        """All that was found; None before the first."""
        return Optimised.joined(self.found).result if self.found else None

    @property
    def state(self) -> Arrays:
        """Arrays by name, from which `restore` goes on exactly as this object would."""
        found = Optimised.joined(self.found).arrays if self.found else {}
        return {
            "iteration": np.array(self.iteration),
            "stuck": np.array(self.stuck),
            "mean": self.mean,
            "times": self.times,
            "ahead": self.ahead,
            **above(begin=self.begin.arrays, found=found),
        }

    def restore(self, state: Arrays) -> None:
        """Go on from what `state` was."""
        if state["mean"].shape != self.mean.shape:
            raise ValueError(f"mean has the shape {state['mean'].shape}")
        self.mean, self.times, self.ahead = state["mean"], state["times"], state["ahead"]
        self.iteration, self.stuck = int(state["iteration"]), bool(state["stuck"])
        self.begin = Moment.from_arrays(below("begin", state))
        found = below("found", state)
        self.found = [Optimised.of(found)] if found else []
