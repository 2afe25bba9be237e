"""The usual way to a trajectory: Gauss-Newton steps, which are exact and fast where they work, and where they
do not hold the ball closely, as in a run, the walk of particles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..arrays import Arrays, above, below
from .cycles import Window
from .newton import Newton
from .smc import Smc

LOOSE = 3.0
"""[cm] Fingers farther from the ball than this, over the first cycle, do not have it."""

SOME = 20
"""cycles that are worth keeping, though they end"""


class Usual:
    """Learns as `newton` does; once its first cycle is loose, or no step leads on before there are SOME, as
    the walk that `then` makes, from the beginning. The longer of both trajectories counts."""

    def __init__(self, newton: Newton, then: Callable[[], Smc]):
        self.then, self.before, self.iteration = then, 0, 0
        self.windows = len(newton.windows)
        self.steps: Arrays | None = None
        """what steps found before the walk"""
        self.now: Newton | Smc = newton
        self.fingers: list[float] = []

    def until(self, late: Callable[[], bool]) -> None:
        """As of the two."""
        then = self.then

        def walk() -> Smc:
            made = then()
            made.until(late)
            return made

        self.now.until(late)
        self.then = walk

    @property
    def late(self) -> bool:
        """The time was up."""
        return self.now.late

    @property
    def done(self) -> bool:
        return self.now.done

    def iterate(self) -> Window:
        """One window or cycle further."""
        if isinstance(self.now, Smc):
            return self._walked(self.now)
        now, report = self.now, self.now.iterate()
        if now.late:
            return report
        self.fingers.append(report.fingers)
        first = len(self.fingers) == len(now.windows)
        lost = now.stuck and len(self.fingers) <= SOME * len(now.windows)
        if lost or (first and not float(np.mean(self.fingers)) <= LOOSE):
            self.steps = now.result if self._whole else None
            self.before, self.now = len(self.fingers), self.then()
            report = replace(report, iteration=self.before, fresh=False)
        self.iteration = report.iteration
        return report

    def _walked(self, now: Smc) -> Window:
        report = now.iterate()
        self.iteration = self.before + now.iteration
        return Window(
            self.iteration,
            report.fresh,
            found=int(now.lost == 0),
            cycles=max(report.cycles, self._whole),
            fingers=report.fingers,
            offsets=report.offsets,
            rounds=1,
            samples_per_second=report.samples_per_second,
            outside=report.outside,
        )

    @property
    def _whole(self) -> int:
        """Cycles that steps found."""
        return int(np.isfinite(self.fingers).sum()) // self.windows

    @property
    def result(self) -> Arrays | None:
        now, steps = self.now.result, self.steps
        return steps if now is None or (steps is not None and len(steps["k"]) > len(now["k"])) else now

    @property
    def state(self) -> Arrays:
        walks = isinstance(self.now, Smc)
        own = {"walks": walks, "before": self.before, "fingers": self.fingers}
        numbers = {name: np.array(value) for name, value in own.items()}
        return self.now.state | above(usual=numbers, steps=self.steps or {})

    def restore(self, state: Arrays) -> None:
        self.before, self.fingers = int(state["usual.before"]), list(state["usual.fingers"])
        if state["usual.walks"]:
            self.now, self.steps = self.then(), below("steps", state) or None
        own = ("usual.", "steps.")
        self.now.restore({name: value for name, value in state.items() if not name.startswith(own)})
        self.iteration = self.before + self.now.iteration
