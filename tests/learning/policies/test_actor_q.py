"""Networks of the deterministic policy gradient, their gradients and optimiser, against torch's own."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from warpdribble.learning.methods.ddpg import DdpgConfig  # noqa: E402
from warpdribble.learning.policies.actor_q import ActorQ, Adam, Mini, Weights  # noqa: E402
from warpdribble.learning.policies.bounded import BoundedPolicy, phase_table  # noqa: E402

INPUTS, ACTIONS, SIZE, SLOPE, BOUND = 7, 3, 8, 0.001, 1.0
CONFIG = replace(DdpgConfig(), rate_every=4, rectified=0)


def nets(last=1.0, seed=1):
    return ActorQ(INPUTS, ACTIONS, 11, (9, 10), SLOPE, BOUND, 0.001, (1e-3, 1e-3), last, seed)


def drawn(*shape, seed=0):
    return torch.from_numpy(np.random.default_rng(seed).normal(size=shape).astype(np.float32))


def mini(updates=1, seed=0):
    rng = np.random.default_rng(seed)

    def one(*shape):
        return rng.normal(size=(updates, SIZE, *shape)).astype(np.float32)

    idle = np.ones((updates, SIZE, ACTIONS), np.float32)
    idle[..., 2] = 0.0
    goes_on = (rng.random((updates, SIZE)) < 0.7).astype(np.float32)
    return Mini(one(INPUTS), one(ACTIONS), one(), one(INPUTS), goes_on, idle, idle)


def leaves(net: Weights):
    return {name: part.clone().requires_grad_() for name, part in net.of.items()}


def critic(w, x, a):
    """Fig. 7, said with torch's own layers."""
    leaky = torch.nn.LeakyReLU(SLOPE)
    h = leaky(x @ w["W1"] + w["b1"])
    h = leaky(torch.cat([h, a], 1) @ torch.cat([w["W2"], w["Wa"]]) + w["b2"])
    return (h @ w["w3"] + w["b3"])[:, 0]


def actor(w, x):
    """Fig. 8, Eq. 19."""
    u = torch.nn.functional.leaky_relu(x @ w["V1"] + w["c1"], SLOPE) @ w["V2"] + w["c2"]
    above, below = SLOPE * (u - BOUND) + BOUND, SLOPE * (u + BOUND) - BOUND
    return torch.where(u > BOUND, above, torch.where(u < -BOUND, below, u))


def test_the_gradient_of_the_critic():
    """Of the mean square of y - Q (Eq. 12)."""
    one, x, a, y = nets(), drawn(SIZE, INPUTS), drawn(SIZE, ACTIONS, seed=1), drawn(SIZE, seed=2)
    w = leaves(one.critic)
    value = critic(w, x, a)
    (y - value).square().mean().backward()
    assert float(one.improve_critic(x, a, y)) == pytest.approx(float(value.detach().mean()), abs=1e-6)
    for name, part in w.items():
        torch.testing.assert_close(one.critic.grad[name], part.grad, atol=1e-6, rtol=1e-4)


def test_the_gradient_of_the_actor():
    """Minus that of the mean of Q(x, pi(x)) (Eq. 16); some actions are beyond their bound, one is idle."""
    one, x = nets(last=2.0), 2.0 * drawn(SIZE, INPUTS)
    active = torch.tensor([1.0, 1.0, 0.0]).expand(SIZE, -1)
    w = leaves(one.actor)
    a = actor(w, x)
    assert 0.1 < float((a.abs() > BOUND).float().mean()) < 0.9
    critic(dict(one.critic.of), x, a * active).mean().neg().backward()
    one.improve_actor(x, active, rectify=False)
    for name, part in w.items():
        torch.testing.assert_close(one.actor.grad[name], part.grad, atol=1e-7, rtol=1e-4)
    assert not one.actor.grad["V2"][:, 2].any()


def test_rectified_gradients_lead_back_into_the_bounds():
    """Eq. 20, component by component, as the paper has it."""
    one, x = nets(last=2.0), 2.0 * drawn(SIZE, INPUTS)
    active = torch.ones(SIZE, ACTIONS)
    a = actor(one.actor.of, x).clone().requires_grad_()
    critic(dict(one.critic.of), x, a).sum().backward()
    wanted = a.grad.clone()
    for i in range(SIZE):
        for j in range(ACTIONS):
            if a[i, j] > BOUND and wanted[i, j] > 0:
                wanted[i, j] = BOUND - a[i, j]
            elif a[i, j] < -BOUND and wanted[i, j] < 0:
                wanted[i, j] = -BOUND - a[i, j]
    assert not torch.equal(wanted, a.grad)
    w = leaves(one.actor)
    actor(w, x).backward(-wanted.detach() / SIZE)
    one.improve_actor(x, active, rectify=True)
    for name, part in w.items():
        torch.testing.assert_close(one.actor.grad[name], part.grad, atol=1e-7, rtol=1e-4)


def test_the_target():
    """Eq. 13: of the target networks, and nothing beyond a terminal state."""
    one, m = nets(), mini()
    r, after, goes_on, active = (
        torch.from_numpy(part[0]) for part in (m.r, m.after, m.goes_on, m.active_after)
    )
    one.critic_target.flat.mul_(0.5)  # others than what is learned
    wanted = r.clone()
    then = critic(one.critic_target.of, after, actor(one.actor_target.of, after) * active)
    for i in range(SIZE):
        if goes_on[i]:
            wanted[i] += 0.9 * then[i]
    assert 0 < goes_on.sum() < SIZE
    torch.testing.assert_close(one.target(r, after, goes_on, active, 0.9), wanted)


@pytest.mark.parametrize("decay", [0.0, 0.02])
def test_the_optimiser(decay):
    """The steps of torch's Adam; decay is its weight_decay."""
    net = nets().critic
    own, other = Adam(net, 1e-3, decay), net.flat.clone().requires_grad_()
    adam = torch.optim.Adam([other], 1e-3, weight_decay=decay)
    for seed in range(5):
        gradient = drawn(len(net.flat), seed=seed)
        net.slope.copy_(gradient)
        other.grad = gradient
        own.step(), adam.step()
    torch.testing.assert_close(net.flat, other.detach(), atol=1e-7, rtol=1e-5)


def test_a_step_is_the_papers():
    """Lines 17 to 21 of Algorithm 1 in their order: the actor learns from the critic that has just learned,
    the targets follow both."""
    one, other, m = nets(), nets(), mini()
    before = one.critic_target.flat.clone()
    one.learn(m, CONFIG)
    x, a, r, after, goes_on, active, then = (torch.from_numpy(part[0]) for part in vars(m).values())
    with torch.no_grad():
        other.improve_critic(x, a, other.target(r, after, goes_on, then, CONFIG.gamma))
        other.adam["critic"].step()
        other.improve_actor(x, active, rectify=False)
        other.adam["actor"].step()
    for mine, wanted in ((one.critic, other.critic), (one.actor, other.actor)):
        torch.testing.assert_close(mine.flat, wanted.flat, atol=0.0, rtol=0.0)
    torch.testing.assert_close(
        one.critic_target.flat, (1 - CONFIG.average) * before + CONFIG.average * one.critic.flat
    )


def test_the_critic_learns_the_slower_the_higher_its_values_are():
    """1e-4 x 10^(-0.04 Q), Q the mean over so many steps: a hundredth at 50."""
    one = nets()
    one.critic.of["b3"].fill_(50.0)
    m = mini(4)
    one.learn(Mini(*(0.0 * part for part in vars(m).values())), CONFIG)
    assert one.steps == 4 and one.q == pytest.approx(50.0, abs=0.5)
    assert one.rate == pytest.approx(1e-6, rel=0.05)
    one.learn(m, CONFIG)
    assert one.q < 50.0 and one.rate > 1e-6


def test_it_learns_what_an_action_is_worth():
    """A bandit: the reward is the less, the farther the action is from what the state asks for."""
    one = ActorQ(INPUTS, ACTIONS, 64, (64, 64), SLOPE, BOUND, 0.0, (1e-3, 1e-3), 0.01, 1)
    config = replace(CONFIG, critic_rate=1e-3)
    rng = np.random.default_rng(0)
    for _ in range(40):
        x = rng.normal(size=(50, 32, INPUTS)).astype(np.float32)
        a = rng.uniform(-1, 1, (50, 32, ACTIONS)).astype(np.float32)
        r = -((a - 0.5 * np.tanh(x[..., :ACTIONS])) ** 2).sum(-1)
        one.learn(Mini(x, a, r, x, np.zeros_like(r), np.ones_like(a), np.ones_like(a)), config)
    x = torch.from_numpy(rng.normal(size=(500, INPUTS)).astype(np.float32))
    off = one.actions(one.actor, x)[2] - 0.5 * torch.tanh(x[:, :ACTIONS])
    assert float(off.square().mean().sqrt()) < 0.15  # doing nothing: 0.31


def test_a_state_goes_on_to_the_bit():
    one, other, m = nets(), nets(seed=5), mini(6)
    one.learn(m, CONFIG)
    other.restore({name: np.array(part) for name, part in one.state.items()})
    one.learn(m, CONFIG), other.learn(m, CONFIG)
    for name, part in one.state.items():
        np.testing.assert_array_equal(other.state[name], part, err_msg=name)
    with pytest.raises(ValueError, match="has the shape"):
        ActorQ(INPUTS, ACTIONS, 5, (9, 10), SLOPE, BOUND, 0.0, (1e-3, 1e-3), 1.0, 0).restore(one.state)


def test_the_policy_does_what_the_actor_does():
    """In arrays of double precision, with the state's scale in it."""
    one, rng = nets(last=2.0), np.random.default_rng(3)
    phase = phase_table("circle", 5)
    active = np.ones((5, ACTIONS))
    active[1, 0] = 0.0
    policy = BoundedPolicy(
        mean=rng.normal(size=5), scale=rng.uniform(0.5, 2.0, 5), phase=phase, active=active,
        bound=np.array(BOUND), slope=np.array(SLOPE), **one.weights(),
    )  # fmt: skip
    s, k = rng.normal(size=(40, 5)), rng.integers(0, 5, 40)
    x = np.concatenate([(s - policy.mean) / policy.scale, phase[k]], axis=1)
    wanted = actor(one.actor.of, torch.from_numpy(x.astype(np.float32))).numpy() * active[k]
    np.testing.assert_allclose(policy.act(s, k), wanted, atol=1e-5)
    again = BoundedPolicy.of(policy.arrays)
    np.testing.assert_array_equal(again.act(s, k), policy.act(s, k))


def test_phases():
    table = phase_table("circle", 8)
    np.testing.assert_allclose(np.linalg.norm(table, axis=1), 1.0)
    np.testing.assert_allclose(table[2], [1.0, 0.0], atol=1e-12)
    assert phase_table("none", 8).shape == (8, 0)
    np.testing.assert_array_equal(phase_table("one-hot", 8)[3], np.arange(8) == 3)
    with pytest.raises(ValueError, match="there is no phase 'clock'"):
        phase_table("clock", 8)
