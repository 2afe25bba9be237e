"""Linear policies: their actions, samples about them, and what lies between two of them."""

import numpy as np
import pytest

from warpdribble.learning.policies.linear import Explore, LinearPolicy
from warpdribble.learning.starts import Streams

FRAGMENTS, ACTIONS, STATES = 3, 2, 4
NAMES = ("M", "a_hat", "sigma")


def random_policy(random):
    policy = LinearPolicy.zero(FRAGMENTS, ACTIONS, STATES)
    for part in vars(policy).values():
        part += random.standard_normal(part.shape)
    policy.sigma[:] = random.uniform(0.1, 0.5, policy.sigma.shape)
    return policy


def streams(seed, units, group=1):
    seeds = np.random.SeedSequence(seed).spawn(units)
    return Streams([np.random.default_rng(s) for s in seeds], group=group)


def test_actions_are_linear_in_the_state():
    random = np.random.default_rng(12)
    policy = random_policy(random)
    s, k = random.standard_normal((50, STATES)), random.integers(FRAGMENTS, size=50)
    expected = np.array([policy.M[j] @ x + policy.a_hat[j] for x, j in zip(s, k)])
    np.testing.assert_allclose(policy.act(s, k), expected, rtol=1e-12, atol=1e-14)
    assert policy.act(s[:0], k[:0]).shape == (0, ACTIONS)


def test_the_policy_that_adds_nothing():
    policy = LinearPolicy.zero(FRAGMENTS, ACTIONS, STATES, 0.25)
    assert not policy.act(np.ones((5, STATES)), np.zeros(5, int)).any()
    assert (policy.sigma == 0.25).all() and policy.M.shape == (FRAGMENTS, ACTIONS, STATES)


def test_samples_vary_about_the_actions_with_the_fragment_s_spread():
    """From 13000 samples a spread is known to 0.6 %, a mean to 0.005. Samples of a unit's worlds are
    independent."""
    random = np.random.default_rng(13)
    policy, k = random_policy(random), np.repeat(np.arange(FRAGMENTS), 13000)
    s = random.standard_normal((len(k), STATES))
    noise = Explore(policy, streams(1, FRAGMENTS, 13000)).act(s, k) - policy.act(s, k)
    for j in range(FRAGMENTS):
        np.testing.assert_allclose(noise[k == j].std(axis=0), policy.sigma[j], rtol=0.04)
        np.testing.assert_allclose(noise[k == j].mean(axis=0), 0.0, atol=0.03)
    correlation = np.corrcoef(noise[:-1, 0], noise[1:, 0])[0, 1]
    assert abs(correlation) < 0.03 and abs(np.corrcoef(noise.T)[0, 1]) < 0.03


@pytest.mark.parametrize(("group", "states"), [(1, STATES), (8, STATES), (16, 18)])
def test_a_unit_explores_to_the_bit_as_it_would_alone(group, states):
    """Products too, not only the random numbers."""
    random = np.random.default_rng(14)
    policy = LinearPolicy.zero(FRAGMENTS, 11, states, 0.2)
    policy.M += random.standard_normal(policy.M.shape)
    s = random.standard_normal((5 * group, states))
    k = np.repeat(np.arange(5) % FRAGMENTS, group)
    whole = Explore(policy, streams(2, 5, group)).act(s, k).reshape(5, group, -1)
    for unit in range(5):
        drawn = streams(2, 5, group).only(np.arange(5) == unit)
        own = slice(unit * group, (unit + 1) * group)
        np.testing.assert_array_equal(Explore(policy, drawn).act(s[own], k[own]), whole[unit])


def test_between_two_policies():
    random = np.random.default_rng(15)
    policy, other = random_policy(random), random_policy(random)
    for name in NAMES:
        one, two = getattr(policy, name), getattr(other, name)
        np.testing.assert_allclose(getattr(policy.moved(other, 0.0), name), one, rtol=1e-12)
        np.testing.assert_allclose(getattr(policy.moved(other, 1.0), name), two, rtol=1e-12)
        np.testing.assert_allclose(getattr(policy.moved(other, 0.25), name), 0.75 * one + 0.25 * two)


def test_a_copy_is_its_own():
    policy = random_policy(np.random.default_rng(16))
    copy = policy.copy()
    for name in NAMES:
        getattr(copy, name)[:] = 0.0
        assert getattr(policy, name).any()
    assert LinearPolicy(**policy.arrays).M is policy.M
