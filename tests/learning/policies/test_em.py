"""The M-step of Guided SAMCON against another way to solve it, and in its limits."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from warpdribble.learning.methods.samcon import SamconConfig
from warpdribble.learning.policies.em import Moments, descendants, improve, select
from warpdribble.learning.policies.linear import LinearPolicy

FRAGMENTS, ACTIONS, STATES, ISLANDS = 3, 2, 4, 2
SMALL = SamconConfig(lag=5)


def random_policy(random, sigma=0.3):
    policy = LinearPolicy.zero(FRAGMENTS, ACTIONS, STATES, sigma)
    policy.M += random.standard_normal(policy.M.shape)
    policy.a_hat += random.standard_normal(policy.a_hat.shape)
    return policy


@dataclass
class Samples:
    """What islands saw, one after the other."""

    S: np.ndarray
    A: np.ndarray
    k: np.ndarray
    W: np.ndarray
    """descendants"""

    @property
    def moments(self):
        """Island by island."""
        parts = [np.array_split(x, ISLANDS) for x in (self.S, self.A, self.k, self.W)]
        total, *others = (Moments.of(*part, FRAGMENTS) for part in zip(*parts))
        for other in others:
            total = total + other
        return total


def random_walk(random, rows=30, particles=6, noise=0.3, law=None, fragments=FRAGMENTS):
    """Walks whose actions follow a law (states, fragments) -> actions, about which they vary."""
    count, E = rows * particles, random.random((rows, ISLANDS, particles))
    parents = np.array([select(row, 0.5)[0] for row in E]).reshape(E.shape)
    W = np.concatenate([descendants(parents[:, i], SMALL.lag).ravel() for i in range(ISLANDS)])
    S = 2.0 + random.standard_normal((ISLANDS * count, STATES))
    k = random.integers(fragments, size=ISLANDS * count)
    A = noise * random.standard_normal((ISLANDS * count, ACTIONS)) + (law(S, k) if law else 0.0)
    return Samples(S, A, k, W)


def by_least_squares(policy, seen, config):
    """M, a_hat and sigma of each fragment from one system for [M a_hat], the pull as rows of its own."""
    S, A = seen.S, seen.A
    new = policy.copy()
    for k in range(len(policy.M)):
        w = np.where(seen.k == k, seen.W, 0.0)
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
def test_m_step_is_weighted_ridge_regression(ridge, doubt):
    """Two float64 solutions of systems with condition numbers below 1e4."""
    random = np.random.default_rng(4)
    policy, config = random_policy(random), replace(SMALL, ridge=ridge, doubt=doubt)
    seen = random_walk(random)
    new = improve(policy, seen.moments, config, feedback=True)
    assert_same(new, by_least_squares(policy, seen, config), rtol=1e-8, atol=1e-10)
    assert all((getattr(new, name) != getattr(policy, name)).all() for name in ("M", "a_hat", "sigma"))


def test_moments_are_sums_over_samples():
    """Written out, fragment by fragment; and in any parts they add up to the same."""
    random = np.random.default_rng(3)
    seen = random_walk(random)
    whole, expected = Moments.of(seen.S, seen.A, seen.k, seen.W, FRAGMENTS), []
    for k in range(FRAGMENTS):
        rows = [(w, s, a) for s, a, j, w in zip(seen.S, seen.A, seen.k, seen.W) if j == k]
        parts = [
            (w, w * w, w * s, w * a, w * np.outer(s, s), w * np.outer(s, a), w * a * a) for w, s, a in rows
        ]
        expected.append([sum(x) for x in zip(*parts)])
    for value, added, one in zip(vars(whole).values(), vars(seen.moments).values(), zip(*expected)):
        np.testing.assert_allclose(value, np.stack(one), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(added, value, rtol=1e-12, atol=1e-12)


def test_m_step_leaves_the_old_policy_alone():
    random = np.random.default_rng(5)
    policy = random_policy(random)
    before = policy.copy()
    improve(policy, random_walk(random).moments, SMALL, feedback=True)
    assert_same(policy, before, rtol=0)


@pytest.mark.parametrize("feedback", [True, False])
def test_a_fragment_that_was_not_seen_keeps_its_policy(feedback):
    random = np.random.default_rng(6)
    policy = random_policy(random)
    new = improve(policy, random_walk(random, fragments=2).moments, SMALL, feedback)
    assert_same(*(LinearPolicy(p.M[2:], p.a_hat[2:], p.sigma[2:]) for p in (new, policy)), rtol=0)
    assert (new.a_hat[:2] != policy.a_hat[:2]).all()


@pytest.mark.parametrize("feedback", [True, False])
def test_a_walk_without_descendants_teaches_nothing(feedback):
    random = np.random.default_rng(7)
    policy, seen = random_policy(random), random_walk(random)
    seen.W[:] = 0
    assert_same(improve(policy, seen.moments, SMALL, feedback), policy, rtol=0)


def test_a_noiseless_linear_policy_is_recovered():
    """Without ridge and doubt, exactly; sigma falls, but not below the least."""
    random = np.random.default_rng(8)
    true, old = random_policy(random), random_policy(random)
    seen = random_walk(random, noise=0.0, law=true.act)
    config = replace(SMALL, ridge=0.0, doubt=0.0)
    new = improve(old, seen.moments, config, feedback=True)
    np.testing.assert_allclose(new.M, true.M, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(new.a_hat, true.a_hat, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(new.sigma, 0.3 * np.sqrt(0.5), rtol=1e-9)
    for _ in range(20):
        new = improve(new, seen.moments, config, feedback=True)
    np.testing.assert_allclose(new.sigma, config.least_sigma, rtol=1e-12)


def test_boundless_doubt_keeps_the_feedback():
    """And then a_hat is the mean of what is left of the actions."""
    random = np.random.default_rng(9)
    policy, seen = random_policy(random), random_walk(random)
    new = improve(policy, seen.moments, replace(SMALL, doubt=1e15), feedback=True)
    np.testing.assert_allclose(new.M, policy.M, atol=1e-12)
    w = seen.W * (seen.k == 1)
    left = seen.A - seen.S @ policy.M[1].T
    np.testing.assert_allclose(new.a_hat[1], np.average(left, axis=0, weights=w), rtol=1e-9)


def test_only_actions_with_descendants_count():
    """What the others did may be anything."""
    random = np.random.default_rng(10)
    policy, seen = random_policy(random), random_walk(random)
    new = improve(policy, seen.moments, SMALL, feedback=True)
    dead = seen.W == 0
    assert 0.3 < np.mean(dead) < 1.0
    seen.A[dead] = seen.S[dead] = np.nan
    assert_same(improve(policy, seen.moments, SMALL, feedback=True), new, rtol=1e-12)


def test_without_feedback_offsets_go_towards_the_mean_action():
    """Part of the way, the same for all of them, and further the more samples there are."""
    random, shares = np.random.default_rng(11), []
    policy = LinearPolicy.zero(FRAGMENTS, ACTIONS, STATES, 0.3)
    policy.a_hat += random.standard_normal(policy.a_hat.shape)
    for rows in (3, 300):
        seen = random_walk(random, rows, fragments=1)
        new = improve(policy, seen.moments, SMALL, feedback=False)
        way = np.average(seen.A, axis=0, weights=seen.W) - policy.a_hat[0]
        share = (new.a_hat[0] - policy.a_hat[0]) / way
        assert share[0] == pytest.approx(share[1], rel=1e-9)
        shares.append(share[0])
        np.testing.assert_array_equal(new.M, policy.M)
        np.testing.assert_array_equal(new.sigma, policy.sigma)
    assert 0.0 < shares[0] < shares[1] < 1.0 and shares[1] > 0.95
