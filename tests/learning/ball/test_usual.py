"""The usual method: which of the two goes on, and that a file brings it back."""

from types import SimpleNamespace

import numpy as np
import pytest

from warpdribble.learning.ball.cycles import Window
from warpdribble.learning.ball.smc import Smc
from warpdribble.learning.ball.usual import LOOSE, SOME, Usual


class Steps:
    """Gauss-Newton steps of two windows a cycle, whose fingers are as far off as they are told [cm]."""

    windows = (0, 1)

    def __init__(self, fingers):
        self.fingers, self.iteration, self.stuck, self.found = fingers, 0, False, []
        self.late = False

    @property
    def done(self):
        return self.stuck or self.iteration == len(self.fingers)

    def iterate(self):
        off = self.fingers[self.iteration]
        if np.isnan(off):
            self.stuck = True
        else:
            self.iteration += 1
            self.found.append(off)
        return Window(self.iteration, self.done, int(not self.stuck), 0, off, 0.2, 1, 1.0, 0.5)

    @property
    def result(self):
        return {"k": np.zeros(len(self.found)), "by": "steps"} if self.found else None

    @property
    def state(self):
        return {"steps": np.array(self.iteration)}

    def restore(self, state):
        self.iteration = int(state["steps"])


class Walk(Smc):
    """A walk that finds a cycle each time."""

    def __init__(self):
        self.iteration, self.lost = 0, 0

    done = property(lambda self: self.iteration == 3)
    result = property(lambda self: {"k": np.zeros(2 * self.iteration), "by": "walk"})
    state = property(lambda self: {"walk": np.array(self.iteration)})

    def restore(self, state):
        self.iteration = int(state["walk"])

    def iterate(self):
        self.iteration += 1
        return SimpleNamespace(
            fresh=self.done,
            cycles=self.iteration,
            fingers=1.0,
            offsets=0.3,
            samples_per_second=9.0,
            outside=0.1,
        )


def learned(fingers):
    learner, reports = Usual(Steps(fingers), Walk), []
    while not learner.done:
        reports.append(learner.iterate())
    return learner, reports


def test_steps_that_hold_the_ball_go_on():
    learner, reports = learned([1.0, 2.0, 9.0, 1.0])
    assert isinstance(learner.now, Steps) and [r.iteration for r in reports] == [1, 2, 3, 4]


@pytest.mark.parametrize("fingers", [[1.0, 2 * LOOSE, 1.0], [np.nan], [1.0, 1.0, np.nan]])
def test_steps_that_do_not_give_way_to_the_walk(fingers):
    learner, reports = learned(fingers)
    assert isinstance(learner.now, Walk)
    assert [r.iteration for r in reports] == list(range(1, len(reports) + 1))
    assert reports[-1].cycles == 3 and reports[-1].fresh


def test_what_was_found_before_is_kept_by_steps_that_get_stuck():
    learner, reports = learned([1.0] * 2 * SOME + [np.nan])
    assert isinstance(learner.now, Steps) and reports[-1].found == 0


@pytest.mark.parametrize(("cycles", "by"), [(2, "walk"), (4, "steps")])
def test_the_longer_of_both_counts(cycles, by):
    """The walk's has three cycles."""
    learner, reports = learned([1.0] * 2 * cycles + [np.nan])
    assert learner.result["by"] == by and reports[-1].cycles == max(3, cycles)


def test_a_part_of_a_cycle_is_nothing_to_start_from():
    learner = Usual(Steps([1.0, np.nan]), Walk)
    learner.iterate(), learner.iterate()
    assert isinstance(learner.now, Walk) and learner.steps is None


def test_what_steps_found_is_there_again_beside_the_walk():
    learner = Usual(Steps([1.0] * 6 + [np.nan]), Walk)
    while not isinstance(learner.now, Walk):
        learner.iterate()
    learner.iterate()
    other = Usual(Steps([np.nan]), Walk)
    other.restore(learner.state)
    assert other.result["by"] == learner.result["by"] == "steps" and len(other.result["k"]) == 6


def test_it_goes_on_as_what_it_was():
    learner = Usual(Steps([np.nan]), Walk)
    learner.iterate(), learner.iterate()
    other = Usual(Steps([np.nan]), Walk)
    other.restore(learner.state)
    assert isinstance(other.now, Walk) and other.iteration == learner.iteration == 2
    assert other.iterate().cycles == learner.iterate().cycles == 2
