"""The best policy of all that a learner tried, with states that it comes through."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from ..arrays import Arrays, above, below
from ..evaluate.trials import record_starts
from ..rollout import Controller
from ..starts import Starts
from ..tasks.locomotion import Locomotion

SPARSE, SETTLED, AHEAD = 3, 20, 40
"""[fragments] States to start from are every third that a policy of arms comes through, a second after a
start, and lives on from for two."""


class Written(Controller, Protocol):
    """A policy that arrays say all of."""

    @property
    def arrays(self) -> Arrays: ...


P = TypeVar("P", bound=Written)


@dataclass
class Kept(Generic[P]):
    """What the highest score was for."""

    policy: P
    starts: Starts
    score: float = -np.inf

    @property
    def result(self) -> Arrays | None:
        """As `Learner.result`: None before anything was tried."""
        if not np.isfinite(self.score):
            return None
        return self.policy.arrays | above(states=vars(self.starts))

    @property
    def state(self) -> Arrays:
        """Arrays by name, for `restore`."""
        arrays = above(best=self.policy.arrays, best_starts=vars(self.starts))
        return arrays | {"best_score": np.array(self.score)}

    def restore(self, state: Arrays, read: Callable[[Arrays], P]) -> None:
        """What was kept in a `state`; other arrays in it are left alone. read: arrays of a policy -> it."""
        self.policy, self.starts = read(below("best", state)), Starts(**below("best_starts", state))
        self.score = float(state["best_score"])


def passed(task: Locomotion, policy: Controller, start: Starts, seed: int) -> Starts:
    """States that a policy of arms comes through."""
    return record_starts(task, policy, start, seed, every=SPARSE, settled=SETTLED, ahead=AHEAD)
