"""Sweeps of particles find a way through a window, which plays back to the bit; where there is none they say
so."""

from dataclasses import replace

import numpy as np
import pytest

from warpdribble.learning.ball.sweeps import SweepConfig, _line, swept
from warpdribble.learning.ball.windows import Moment, attempt, windows_of
from warpdribble.learning.methods.ball import ball_in_hand
from warpdribble.learning.tasks.arms import Arms

PARTICLES = 64


@pytest.fixture(scope="module")
def begun(full, dribbled, legs):
    """Worlds, the window of a cycle, and the ball in the hand where it begins."""
    task = Arms(full, dribbled, PARTICLES, legs)
    (k,) = windows_of(dribbled)
    start = ball_in_hand(full, dribbled)
    assert start.k[0] == k[0]
    task.reset(replace(start, **{name: np.repeat(v, PARTICLES, axis=0) for name, v in vars(start).items()}))
    return task, k, Moment.of(task, int(k[0]))


def test_a_way_is_found_from_nothing_and_plays_back(begun, full, dribbled, legs):
    task, k, moment = begun
    nothing = np.zeros((len(k), task.actions))
    assert attempt(task, moment, k, np.repeat(nothing[:, None], PARTICLES, axis=1), len(k)).failed.any()
    action = swept(task, moment, k, nothing, SweepConfig(sweeps=12), np.random.default_rng(1))
    assert action is not None and not action[~task.active[k]].any()
    other = Arms(full, dribbled, 8, legs)
    again = attempt(other, moment, k, np.repeat(action[:, None], 8, axis=1), len(k))
    assert again.failed.shape == (len(k), 8) and not again.failed.any()
    assert np.isinf(task.near), "what it has changed is as before"


def test_a_ball_out_of_reach_has_no_way(begun, full):
    task, k, moment = begun
    starts = moment.starts(PARTICLES)
    starts.joint_q[:, full.q_slice(full.roles.one("ball_joint")).start] += 3.0
    task.reset(starts)
    lost = Moment.of(task, int(k[0]))
    nothing = np.zeros((len(k), task.actions))
    assert swept(task, lost, k, nothing, SweepConfig(sweeps=2), np.random.default_rng(1)) is None


def test_the_line_of_a_particle_is_its_ancestors():
    """By hand: after row 1 the third particle is a copy of the first, which was one of the second."""
    action = np.arange(6.0).reshape(2, 3, 1)
    parents = np.array([[1, 1, 2], [0, 2, 0]])
    np.testing.assert_array_equal(_line(action, parents, 2)[:, 0], [1.0, 3.0])
    np.testing.assert_array_equal(_line(action, parents, 1)[:, 0], [2.0, 5.0])
