"""One long walk that learns: what it finds plays back exactly, and it goes on from a file to the bit."""

from dataclasses import replace

import numpy as np
import pytest

from warpdribble.learning import STAGES, Run
from warpdribble.learning.ball.optimised import Optimised, observed, played, states_of
from warpdribble.learning.ball.smc import Smc, SmcConfig
from warpdribble.learning.methods.ball import ball_in_hand
from warpdribble.learning.methods.linear import regressed
from warpdribble.learning.tasks.arms import Arms, BallWeights
from warpdribble.skills import read_skill, skill_graph

SMALL = SmcConfig()


@pytest.fixture(scope="module")
def made(full):
    """A function that makes worlds of the authored dribble with the shipped legs."""
    graph, _ = skill_graph(read_skill("dribble-right-authored"))
    legs = Run.load("dribble-right-authored").learned(STAGES, "locomotion").controller
    return lambda worlds: Arms(full, graph, worlds, legs)


@pytest.fixture(scope="module")
def walk(made):
    task = made(SMALL.particles)
    one = Smc(task, SMALL, cycles=3, tries=80, start=ball_in_hand(task.model, task.graph), seed=0)
    reports = []
    while not one.done:
        reports.append(one.iterate())
    return one, reports


def test_cycles_are_found(walk):
    one, reports = walk
    assert one.found_cycles == 3 and reports[-1].cycles == 3
    assert np.isfinite(reports[-1].fingers) and reports[-1].fresh
    found = one.found
    np.testing.assert_array_equal(found.k, (found.k[0] + np.arange(len(found))) % one.task.graph.count)
    assert not found.action[:, :10].any(), "the idle arm does nothing"


def test_what_was_found_plays_back_to_the_bit(walk, made):
    """In other worlds, of another number: the ball is kept throughout, and the fingers are as near."""
    found = walk[0].found
    lived, fingers = played(made(3), found)
    assert (lived == len(found)).all()
    np.testing.assert_array_equal(fingers, found.fingers)


def test_without_what_was_found_the_ball_is_lost(walk, made):
    """The targets alone lose it within two cycles: what was found is what keeps it."""
    found = walk[0].found
    still = Optimised(found.k, 0.0 * found.action, found.joint_q, found.joint_qd, found.fingers)
    lived, _ = played(made(3), still)
    assert (lived < 2 * walk[0].task.graph.count).all()


def test_it_goes_on_from_its_state_to_the_bit(made):
    def fresh():
        task = made(SMALL.particles)
        return Smc(task, SMALL, cycles=3, tries=80, start=ball_in_hand(task.model, task.graph), seed=3)

    one = fresh()
    for _ in range(5):
        one.iterate()
    state = {name: np.array(value) for name, value in one.state.items()}
    other = fresh()
    other.restore(state)
    for _ in range(4):
        assert repr(one.iterate().cost) == repr(other.iterate().cost)
    for name, value in one.state.items():
        np.testing.assert_array_equal(other.state[name], value, err_msg=name)


def test_walks_that_are_lost_soon_teach_as_well(full, made):
    """Where a ball is lost a hand's breadth off its reference, every walk ends before half of the lag."""
    shipped = made(1)
    task = Arms(full, shipped.graph, SMALL.particles, shipped.legs, weights=BallWeights(lost=0.1))
    config = replace(SMALL, lag=32)
    one = Smc(task, config, cycles=1, tries=1, start=ball_in_hand(task.model, task.graph), seed=0)
    one.iterate()
    assert 2 <= task.samples / SMALL.particles <= config.lag // 2
    assert one.policy.a_hat.any()


def test_a_state_of_another_task_is_refused(walk, made):
    one = Smc(made(SMALL.particles), SMALL, 1, 1, walk[0].start)
    state = walk[0].state | {"policy.M": np.zeros((2, 3, 4))}
    with pytest.raises(ValueError, match="has the shape"):
        one.restore(state)


def test_results_are_arrays_that_become_it_again(walk):
    arrays = walk[0].result
    found = Optimised.of(arrays)
    assert len(found) == len(walk[0].found)
    np.testing.assert_array_equal(arrays["states.joint_q"][0], found.joint_q[0])
    assert found.distance(14).shape == (3,)
    active = walk[0].task.active[found.k]
    np.testing.assert_allclose(found.offsets(active), np.linalg.norm(found.action[:, 10:], axis=1))


def test_states_are_seen_from_where_the_reference_begins(walk, made):
    """They feel what was felt on the way, though the player has walked on and turned."""
    task, found = made(32), walk[0].found
    obs = observed(task, states_of(task, found))
    assert obs.shape == (len(found), task.obs) and np.isfinite(obs).all()
    again = observed(made(7), states_of(task, found))
    np.testing.assert_allclose(obs, again, atol=1e-6)
    assert np.abs(obs[:, -1]).max() < 2.0, "headings stay near the reference's"


def test_the_regression_is_exact_on_what_is_linear():
    """A policy is found again from samples of it, for every fragment; ridge pulls towards the mean."""
    rng = np.random.default_rng(5)
    fragments, states, actions = 3, 4, 20
    M, a_hat = rng.normal(size=(fragments, actions, states)), rng.normal(size=(fragments, actions))
    k = np.arange(240) % fragments
    s = rng.normal(size=(len(k), states))
    a = np.einsum("ns,nas->na", s, M[k]) + a_hat[k]
    none = np.zeros((len(k), 0))
    found = Optimised(k, a, none, none, np.zeros(len(k)))
    policy = regressed(found, s, fragments, drop=30, ridge=0.0, sigma=0.1)
    np.testing.assert_allclose(policy.M, M, atol=1e-9)
    np.testing.assert_allclose(policy.a_hat, a_hat, atol=1e-9)
    flat = regressed(found, s, fragments, drop=30, ridge=1e9, sigma=0.1)
    np.testing.assert_allclose(flat.M, 0.0, atol=1e-6)
    for i in range(fragments):
        np.testing.assert_allclose(flat.a_hat[i], a[30:][k[30:] == i].mean(axis=0), atol=1e-6)
