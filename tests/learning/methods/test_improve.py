"""The M-step of Guided SAMCON against another way to solve it, and in its limits."""

from dataclasses import replace

import numpy as np
import pytest

from warpdribble.learning.methods.samcon import SamconConfig, Walk, descendants, improve, select
from warpdribble.learning.policies.linear import LinearPolicy

FRAGMENTS, ACTIONS, STATES = 3, 2, 4
SMALL = SamconConfig(lag=5)


def random_policy(random, sigma=0.3):
    policy = LinearPolicy.zero(FRAGMENTS, ACTIONS, STATES, sigma)
    policy.M += random.standard_normal(policy.M.shape)
    policy.a_hat += random.standard_normal(policy.a_hat.shape)
    return policy


def random_walk(random, rows=30, particles=12, noise=0.3, law=None, fragments=FRAGMENTS):
    """A walk whose actions follow a law (states, fragments) -> actions, about which they vary."""
    seen = Walk(whole=True)
    for _ in range(rows):
        s, k = 2.0 + random.standard_normal((particles, STATES)), random.integers(fragments, size=particles)
        a = noise * random.standard_normal((particles, ACTIONS)) + (law(s, k) if law else 0.0)
        E = random.random(particles)
        for values, new in zip((seen.S, seen.A, seen.k, seen.E), (s, a, k, E)):
            values.append(new)
        seen.parent.append(select(E.reshape(2, -1), 0.5, random)[0])
    return seen


def by_least_squares(policy, seen, config, end):
    """M, a_hat and sigma of each fragment from one system for [M a_hat], the pull as rows of its own."""
    W = np.concatenate(descendants(seen.parent, config.lag, end)).astype(float)
    S, A, K = (np.concatenate(x[:end]) for x in (seen.S, seen.A, seen.k))
    new = policy.copy()
    for k in range(len(policy.M)):
        w = np.where(k == K, W, 0.0)
        if not w.any():
            continue
        w = w / w.sum()
        pull = config.ridge + config.doubt * np.sum(w**2)
        rows = np.sqrt(w)[:, None] * np.c_[S, np.ones(len(S))]
        rows = np.r_[rows, np.sqrt(pull) * np.eye(STATES, STATES + 1)]
        wanted = np.r_[np.sqrt(w)[:, None] * A, np.sqrt(pull) * policy.M[k].T]
        solved = np.linalg.lstsq(rows, wanted, rcond=None)[0]
        new.M[k], new.a_hat[k] = solved[:-1].T, solved[-1]
        missed = A - S @ new.M[k].T - new.a_hat[k]
        variance = 0.5 * policy.sigma[k] ** 2 + 0.5 * np.average(missed**2, axis=0, weights=w)
        new.sigma[k] = np.sqrt(np.maximum(variance, config.least_sigma**2))
    return new


def assert_same(one, two, **tolerance):
    for name in ("M", "a_hat", "sigma"):
        np.testing.assert_allclose(getattr(one, name), getattr(two, name), err_msg=name, **tolerance)


@pytest.mark.parametrize(("ridge", "doubt"), [(0.02, 20.0), (1.0, 0.0), (0.0, 5.0), (1e-6, 1e-6)])
@pytest.mark.parametrize("whole", [True, False], ids=["", "given up"])
def test_m_step_is_weighted_ridge_regression(ridge, doubt, whole):
    """Two float64 solutions of systems with condition numbers below 1e4."""
    random = np.random.default_rng(4)
    policy, config = random_policy(random), replace(SMALL, ridge=ridge, doubt=doubt)
    seen = random_walk(random)
    seen.whole = whole
    end = len(seen) if whole else len(seen) - config.lag
    new = improve(policy, seen, config, feedback=True)
    assert_same(new, by_least_squares(policy, seen, config, end), rtol=1e-8, atol=1e-10)
    assert all((getattr(new, name) != getattr(policy, name)).all() for name in ("M", "a_hat", "sigma"))


def test_m_step_leaves_the_old_policy_alone():
    random = np.random.default_rng(5)
    policy = random_policy(random)
    before = policy.copy()
    improve(policy, random_walk(random), SMALL, feedback=True)
    assert_same(policy, before, rtol=0)


@pytest.mark.parametrize("feedback", [True, False])
def test_a_fragment_that_was_not_seen_keeps_its_policy(feedback):
    random = np.random.default_rng(6)
    policy = random_policy(random)
    new = improve(policy, random_walk(random, fragments=2), SMALL, feedback)
    assert_same(*(LinearPolicy(p.M[2:], p.a_hat[2:], p.sigma[2:]) for p in (new, policy)), rtol=0)
    assert (new.a_hat[:2] != policy.a_hat[:2]).all()


@pytest.mark.parametrize("rows", [0, 1, SMALL.lag])
def test_a_walk_given_up_before_it_is_judged_teaches_nothing(rows):
    random = np.random.default_rng(7)
    policy, seen = random_policy(random), random_walk(random, rows)
    seen.whole = False
    assert_same(improve(policy, seen, SMALL, feedback=True), policy, rtol=0)


def test_a_noiseless_linear_policy_is_recovered():
    """Without ridge and doubt, exactly; sigma falls, but not below the least."""
    random = np.random.default_rng(8)
    true, old = random_policy(random), random_policy(random)
    seen = random_walk(random, noise=0.0, law=true.act)
    config = replace(SMALL, ridge=0.0, doubt=0.0)
    new = improve(old, seen, config, feedback=True)
    np.testing.assert_allclose(new.M, true.M, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(new.a_hat, true.a_hat, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(new.sigma, 0.3 * np.sqrt(0.5), rtol=1e-9)
    for _ in range(20):
        new = improve(new, seen, config, feedback=True)
    np.testing.assert_allclose(new.sigma, config.least_sigma, rtol=1e-12)


def test_boundless_doubt_keeps_the_feedback():
    """And then a_hat is the mean of what is left of the actions."""
    random = np.random.default_rng(9)
    policy, seen = random_policy(random), random_walk(random)
    new = improve(policy, seen, replace(SMALL, doubt=1e15), feedback=True)
    np.testing.assert_allclose(new.M, policy.M, atol=1e-12)
    w = np.concatenate(descendants(seen.parent, SMALL.lag, len(seen))) * (np.concatenate(seen.k) == 1)
    left = np.concatenate(seen.A) - np.concatenate(seen.S) @ policy.M[1].T
    np.testing.assert_allclose(new.a_hat[1], np.average(left, axis=0, weights=w), rtol=1e-9)


def test_only_actions_with_descendants_count():
    """What the others did may be anything."""
    random = np.random.default_rng(10)
    policy, seen = random_policy(random), random_walk(random)
    new = improve(policy, seen, SMALL, feedback=True)
    dead = [count == 0 for count in descendants(seen.parent, SMALL.lag, len(seen))]
    assert 0.3 < np.mean(dead) < 1.0
    for row, who in enumerate(dead):
        seen.A[row][who] = seen.S[row][who] = np.nan
    assert_same(improve(policy, seen, SMALL, feedback=True), new, rtol=1e-12)


def test_without_feedback_offsets_go_towards_the_mean_action():
    """Part of the way, the same for all of them, and further the more samples there are."""
    random, shares = np.random.default_rng(11), []
    policy = LinearPolicy.zero(FRAGMENTS, ACTIONS, STATES, 0.3)
    policy.a_hat += random.standard_normal(policy.a_hat.shape)
    for rows in (3, 300):
        seen = random_walk(random, rows, fragments=1)
        new = improve(policy, seen, SMALL, feedback=False)
        W = np.concatenate(descendants(seen.parent, SMALL.lag, rows))
        way = np.average(np.concatenate(seen.A), axis=0, weights=W) - policy.a_hat[0]
        share = (new.a_hat[0] - policy.a_hat[0]) / way
        assert share[0] == pytest.approx(share[1], rel=1e-9)
        shares.append(share[0])
        np.testing.assert_array_equal(new.M, policy.M)
        np.testing.assert_array_equal(new.sigma, policy.sigma)
    assert 0.0 < shares[0] < shares[1] < 1.0 and shares[1] > 0.95


def test_policies():
    """Actions, samples about them with the fragment's spread, and a share of the way to another."""
    random = np.random.default_rng(12)
    policy, other = random_policy(random), random_policy(random)
    policy.sigma[:] = random.uniform(0.1, 0.5, policy.sigma.shape)
    s, k = random.standard_normal((40000, STATES)), random.integers(FRAGMENTS, size=40000)
    expected = np.array([policy.M[j] @ x + policy.a_hat[j] for x, j in zip(s[:50], k)])
    np.testing.assert_allclose(policy.act(s, k)[:50], expected, rtol=1e-12)
    noise = policy.sample(s, k, random) - policy.act(s, k)
    for j in range(FRAGMENTS):  # a spread from 13000 samples is known to 0.6 %, a mean to 0.005
        np.testing.assert_allclose(noise[k == j].std(axis=0), policy.sigma[j], rtol=0.04)
        np.testing.assert_allclose(noise[k == j].mean(axis=0), 0.0, atol=0.03)
    assert_same(policy.moved(other, 0.0), policy, rtol=1e-12)
    assert_same(policy.moved(other, 1.0), other, rtol=1e-12)
    np.testing.assert_allclose(policy.moved(other, 0.25).M, 0.75 * policy.M + 0.25 * other.M, rtol=1e-12)
