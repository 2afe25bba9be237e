"""Gauss-Newton steps against least squares, and whole cycles of the authored dribble: played back, gone on
with from a checkpoint, and gone on with by CMA-ES."""

from dataclasses import replace

import numpy as np
import pytest

from warpdribble.learning.ball.cycles import moved
from warpdribble.learning.ball.newton import Newton, NewtonConfig, corrected, steps_down
from warpdribble.learning.ball.optimised import Optimised, played
from warpdribble.learning.ball.paper import Paper, PaperConfig
from warpdribble.learning.methods.ball import BallConfig, make
from warpdribble.learning.runs.stage import Context
from warpdribble.learning.starts import Starts
from warpdribble.learning.tasks.arms import Arms


def test_the_moving_average():
    """Eq. 10: the mean of the first ten, then nine parts of the old and one of the new."""
    actions = np.random.default_rng(0).standard_normal((12, 1, 20))
    mean = np.zeros((1, 20))
    for i, action in enumerate(actions[:10], 1):
        mean = moved(mean, action, np.array([i]))
        np.testing.assert_allclose(mean, actions[:i].mean(axis=0), rtol=1e-12)
    for i, action in enumerate(actions[10:], 11):
        mean, before = moved(mean, action, np.array([i])), mean
        np.testing.assert_allclose(mean, 0.9 * before + 0.1 * action, rtol=1e-12)


@pytest.fixture
def problem():
    random = np.random.default_rng(0)
    return random.standard_normal((30, 7)), random.standard_normal(30)


def test_a_whole_step_solves_a_linear_problem(problem):
    slope, errors = problem
    (step,) = steps_down(slope, errors, [0.0], [1.0])
    np.testing.assert_allclose(step, np.linalg.lstsq(slope, -errors)[0], rtol=1e-9)


def test_damping_is_a_ridge_and_lengths_scale(problem):
    slope, errors = problem
    mean = np.mean(np.sum(slope**2, axis=0))
    weak, strong = steps_down(slope, errors, [0.5, 3.0], [0.25, 2.0]).reshape(2, 2, 7)
    for damping, (short, long) in ((0.5, weak), (3.0, strong)):
        ridge = np.concatenate([slope, np.sqrt(damping * mean) * np.eye(7)])
        expected = np.linalg.lstsq(ridge, np.concatenate([-errors, np.zeros(7)]))[0]
        np.testing.assert_allclose(short, 0.25 * expected, rtol=1e-9)
        np.testing.assert_allclose(long, 2.0 * expected, rtol=1e-9)


def test_a_corrected_slope_has_the_step_right_and_nothing_else_changed(problem):
    slope, errors = problem
    step = np.arange(1.0, 8.0)
    after = corrected(slope, step, errors)
    np.testing.assert_allclose(after @ step, errors, rtol=1e-9)
    across = np.linalg.qr(step[:, None], mode="complete")[0][:, 1:]
    np.testing.assert_allclose(after @ across, slope @ across, atol=1e-9)


# ------------------------------------------------------------------------------------ whole cycles


def test_what_is_found_plays_back_to_the_bit(learner, cycles, full, dribbled, legs):
    """In other worlds, from its first state alone, and nothing is lost."""
    found = Optimised.of(learner[0].result)
    np.testing.assert_array_equal(found.k, (11 + np.arange(14 * cycles)) % 14)
    task = Arms(full, dribbled, 16, legs)
    lived, fingers = played(task, found)
    assert (lived == 14 * cycles).all()
    np.testing.assert_array_equal(fingers, found.fingers)
    starts = Starts(*(learner[0].result[f"states.{name}"] for name in ("k", "joint_q", "joint_qd")))
    assert len(starts) == 1 and starts.k[0] == 11


def test_fingers_are_near_the_ball_in_every_cycle(learner, cycles):
    _, _, reports = learner
    assert all(report.found for report in reports) and reports[-1].fresh
    assert max(report.fingers for report in reports) < 2.0
    assert [report.iteration for report in reports] == list(range(1, cycles + 1))


def test_offsets_change_little_from_fragment_to_fragment(learner, dribbled, needs, cycles):
    """Half as much as where changes cost nothing; then arms twitch. The ball is held as closely."""
    config = BallConfig(method="newton", cycles=cycles, newton=replace(NewtonConfig(), change=1e9))
    other = make(Context(dribbled, config, needs=needs))
    while not other.done:
        other.iterate()
    found = [Optimised.of(one.result) for one in (learner[0], other)]
    steps, fingers = zip(*((np.diff(f.action, axis=0).std(), np.nanmean(f.fingers)) for f in found))
    assert steps[0] < 0.7 * steps[1]
    assert fingers[0] < fingers[1] + 0.003


def test_only_hands_that_act_are_moved(learner, dribbled):
    found = Optimised.of(learner[0].result)
    assert (found.action[:, :10] == 0.0).all() and (found.action[:, 10:] != 0.0).any(axis=1).all()


def test_gone_on_with_to_the_bit(learner, cycles):
    whole, states, _ = learner
    other = Newton(*whole.tasks, whole.config, cycles)
    other.restore({name: np.array(value) for name, value in states[0].items()})
    while not other.done:
        other.iterate()
    for name, value in whole.state.items():
        np.testing.assert_array_equal(other.state[name], value, err_msg=name)


def test_a_state_of_another_graph_is_refused(learner):
    state = learner[0].state
    with pytest.raises(ValueError, match="mean has the shape"):
        learner[0].restore(state | {"mean": state["mean"][:-1]})


@pytest.mark.slow
def test_cma_goes_on_to_the_bit_and_plays_back(learner, cycles, full, dribbled, legs):
    """From a window that is known already, P1's search finds two more; stopped between them, the same."""
    c = PaperConfig(near=0.02)
    task = Arms(full, dribbled, 32, legs, closely=True)
    paper = Paper(task, c, cycles)
    paper.restore(learner[1][0])
    assert paper.iterate().found
    between = paper.state
    assert paper.iterate().found
    other = Paper(task, c, cycles)
    other.restore(between)
    other.iterate()
    for name, value in paper.state.items():
        np.testing.assert_array_equal(other.state[name], value, err_msg=name)
    found = Optimised.of(paper.result)
    lived, fingers = played(task, found)
    assert (lived == 42).all()
    np.testing.assert_array_equal(fingers, found.fingers)
