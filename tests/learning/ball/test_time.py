"""Searches whose time is up end in the midst of a window, whatever the method, and may go on."""

import numpy as np
import pytest

from warpdribble.learning.ball.sweeps import SweepConfig, swept
from warpdribble.learning.ball.windows import Moment, windows_of
from warpdribble.learning.methods.ball import BallConfig, ball_in_hand, make
from warpdribble.learning.runs.stage import Context
from warpdribble.learning.starts import Starts
from warpdribble.learning.tasks.arms import Arms, OutOfTime


class Clock:
    """Time that is up once it has been asked for so often; `asked` says how often."""

    def __init__(self, times):
        self.times, self.asked = times, 0

    def __call__(self):
        self.asked += 1
        return self.asked > self.times


def equal(one, other):
    assert one.keys() == other.keys()
    for name, value in one.items():
        np.testing.assert_array_equal(other[name], value, err_msg=name)


@pytest.mark.parametrize("method", ["newton", "usual", "paper", "smc"])
def test_a_search_ends_with_the_fragment_in_which_its_time_is_up(method, dribbled, needs):
    """The first window takes more than one try of 14 fragments."""
    search = make(Context(dribbled, BallConfig(method=method), needs=needs))
    clock = Clock(20)
    search.until(clock)
    while not search.done:
        before = search.state
        report = search.iterate()
    assert clock.asked == 21 and search.late
    assert not getattr(report, "found", 0) and search.iteration == (1 if method == "smc" else 0)
    equal(before, search.state)
    assert search.result is None


def test_with_more_time_it_goes_on_as_if_nothing_had_been(learner, dribbled, needs, cycles):
    _, states, _ = learner
    search = make(Context(dribbled, BallConfig(method="newton", cycles=cycles), needs=needs))
    search.until(Clock(33))
    assert not search.iterate().found and search.done
    search.until(lambda: False)
    assert not search.done and search.iterate().found
    equal(states[0], search.state)


def test_sweeps_end_and_leave_the_task_as_it_was(full, dribbled, legs):
    task = Arms(full, dribbled, 16, legs)
    (k,) = windows_of(dribbled)
    start = ball_in_hand(full, dribbled)
    task.reset(Starts(*(np.repeat(part, 16, axis=0) for part in vars(start).values())))
    begin = Moment.of(task, int(k[0]))
    task.late = clock = Clock(5)
    with pytest.raises(OutOfTime):
        swept(task, begin, k, np.zeros((len(k), 20)), SweepConfig(), np.random.default_rng(0))
    assert clock.asked == 6 and np.isinf(task.near)
