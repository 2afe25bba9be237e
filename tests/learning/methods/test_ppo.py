"""PPO: its advantages and its objective against the definitions, and a short run of it."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tests.learning.methods.learners import delayed, ended, same  # noqa: E402
from warpdribble.learning import STAGES, run_trials  # noqa: E402
from warpdribble.learning.ball.optimised import Optimised  # noqa: E402
from warpdribble.learning.methods import ppo  # noqa: E402
from warpdribble.learning.methods.ppo import Ppo, PpoConfig  # noqa: E402
from warpdribble.learning.policies.actor_critic import ActorCritic, through  # noqa: E402
from warpdribble.learning.policies.batch import Batch, advantages  # noqa: E402
from warpdribble.learning.policies.network import NetworkPolicy  # noqa: E402
from warpdribble.learning.starts import Starts  # noqa: E402
from warpdribble.sims.errors import InputError  # noqa: E402

SMALL = PpoConfig(
    iterations=4, worlds=32, steps=4, epochs=2, minibatch=64, width=16, trials=16, check_every=2,
    check_seconds=0.35, episode=9, drop=1,
)  # fmt: skip


MAKE = ppo.make


def test_advantages_are_the_sums_that_define_them():
    """Eq. 16 of Schulman et al. 2016, summed up naively, cut where a world fails."""
    rng = np.random.default_rng(0)
    steps, n, gamma, smooth = 6, 5, 0.9, 0.8
    reward, value = rng.normal(size=(steps, n)), rng.normal(size=(steps + 1, n))
    failed = rng.random((steps, n)) < 0.2
    assert failed.any()
    got = advantages(reward, failed, value, gamma, smooth)
    for i in range(n):
        for t in range(steps):
            wanted, weight = 0.0, 1.0
            for u in range(t, steps):
                after = 0.0 if failed[u, i] else value[u + 1, i]
                wanted += weight * (reward[u, i] + gamma * after - value[u, i])
                if failed[u, i]:
                    break
                weight *= gamma * smooth
            assert got[t, i] == pytest.approx(wanted)


def batch_of(nets, worlds=64, steps=2, obs=6, actions=4, fragments=3):
    rng = np.random.default_rng(8)
    x = rng.normal(size=(steps + 1, worlds, obs)).astype(np.float32)
    k = rng.integers(0, fragments, (steps + 1, worlds))
    noise = rng.normal(size=(steps, worlds, actions)).astype(np.float32)
    mean = nets.network()(x[:-1].reshape(-1, obs), k[:-1].ravel()).reshape(noise.shape)
    nothing = np.zeros((steps, worlds), np.float32)
    return Batch(x, k, noise, mean, nets.log_sigma(), nothing, nothing > 0)


def test_learning_moves_towards_what_was_better_and_leaves_idle_actions_alone():
    """Actions above the mean were better in the first number, the third does nothing."""
    nets = ActorCritic(6, 4, 3, width=16, rate=3e-3, seed=1)
    batch = batch_of(nets)
    better = batch.noise[..., 0]
    active = np.ones((3, 4), bool)
    active[:, 2] = False
    before = nets.network()
    config = replace(SMALL, epochs=8, minibatch=64)
    nets.learn(batch, better, np.zeros_like(better), active, config, np.random.default_rng(0))
    x, k = batch.x[:-1].reshape(-1, 6), batch.k[:-1].ravel()
    change = nets.network()(x, k) - before(x, k)
    assert change[:, 0].mean() > 3.0 * np.abs(change[:, 1].mean())
    assert nets.log_sigma()[2] == 0.0 and nets.log_sigma()[0] != 0.0
    assert not np.any(nets.network().W3[:, 2] - before.W3[:, 2])


def test_the_critic_learns_what_is_wanted():
    nets = ActorCritic(6, 4, 3, width=16, rate=2e-3, seed=1)
    batch = batch_of(nets)
    wanted = batch.x[:-1, :, 0] + batch.k[:-1]
    config, nothing = replace(SMALL, epochs=300, divergence=1.0), np.zeros_like(wanted)
    nets.learn(batch, nothing, wanted, np.ones((3, 4), bool), config, np.random.default_rng(0))
    assert np.std(nets.value(batch.x, batch.k)[:-1] - wanted) < 0.1 * np.std(wanted)


def test_the_objective_is_clipped():
    """What is likelier by more than the clip already is not pushed further: no gradient, nothing moves."""
    nets = ActorCritic(6, 4, 3, width=16, rate=1e-3, seed=1)
    batch = batch_of(nets)
    shifted = replace(batch, mean=batch.mean + 0.0, noise=np.ones_like(batch.noise))
    with torch.no_grad():
        nets.actor["b3"] += 0.5  # every action is likelier now than when it was drawn
    before = nets.network()
    gain = np.ones(batch.reward.shape, np.float32)
    nets.learn(shifted, gain, gain, np.ones((3, 4), bool), replace(SMALL, epochs=1), np.random.default_rng(0))
    np.testing.assert_array_equal(nets.network().W3, before.W3)
    with torch.no_grad():
        mu = through(nets.actor, torch.from_numpy(batch.x[:-1]), torch.from_numpy(batch.k[:-1]))
    assert mu.shape == batch.noise.shape


def test_it_runs_and_says_how(learned):
    _, reports = learned
    assert [r.iteration for r in reports] == [1, 2, 3, 4]
    assert [r.fresh for r in reports] == [False, True, False, True]
    assert all(np.isfinite([r.reward, r.lost, r.sigma, r.rate, r.samples_per_second]).all() for r in reports)
    assert 0.0 < reports[0].reward < 1.0 and 0.0 <= reports[-1].survived <= 1.0


def test_what_was_learned_is_a_policy_that_acts(learned, context):
    one, _ = learned
    task = ppo.STAGE.task(context, 8)
    controller = ppo.STAGE.controller(context, one.result)
    assert isinstance(controller, NetworkPolicy)
    starts = Starts(*(one.result[f"states.{name}"] for name in ("k", "joint_q", "joint_qd")))
    trials = run_trials(task, controller, starts, 0.5)
    assert trials.survived.shape == (8,) and trials.lived.min() > 0.0


def test_a_state_goes_on_to_the_bit(learned, context):
    """Half of it, then the rest by another, though the next batch was simulated already."""
    one, other = ppo.make(context), ppo.make(context)
    for _ in range(2):
        one.iterate()
    other.restore({name: np.array(value) for name, value in one.state.items()})
    same(learned[0], ended(other))


def test_a_slow_learner_simulates_the_same(learned, context, monkeypatch):
    """What is simulated beside learning does not see what is learned meanwhile, whichever is slower."""
    same(learned[0], ended(delayed(ppo.make(context), monkeypatch, 0.3)))


def test_a_state_of_another_network_is_refused(learned, context):
    one = ppo.make(replace(context, config=replace(SMALL, width=8)))
    with pytest.raises(ValueError, match="has the shape"):
        one.restore(learned[0].state)


@pytest.mark.parametrize("wrong", [{"state": "all"}, {"base": "all"}])
def test_unknown_names_are_refused(context, wrong):
    with pytest.raises(InputError, match="there is no"):
        ppo.make(replace(context, config=replace(SMALL, **wrong)))


def test_bases(context):
    """What is done before anything is learned: P1's regression, its mean, nothing."""
    found = Optimised.of(context.needs["ball"])
    k = np.arange(context.graph.count)
    for base in ppo.BASES:
        policy = ppo.make(replace(context, config=replace(SMALL, base=base))).policy
        assert policy.M.shape[2] == (76 if base == "linear" else 0)
        done = policy.base(np.zeros((len(k), 76)), k)
        if base == "offsets":
            np.testing.assert_allclose(done[0], found.action[found.k == 0].mean(axis=0))
        assert done.any() == (base != "nothing")


def test_a_learner_needs_no_ppo_to_be_shown():
    """Names of stages are there without torch."""
    assert STAGES["policy"].make is ppo.make and Ppo.__doc__
