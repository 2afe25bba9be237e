"""DDPG: its reward and its replay buffer against the definitions, and a short run of it."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tests.learning.methods.learners import delayed, ended, same  # noqa: E402
from warpdribble.learning import STAGES  # noqa: E402
from warpdribble.learning.methods import ddpg  # noqa: E402
from warpdribble.learning.methods.ddpg import DdpgConfig, Reward  # noqa: E402
from warpdribble.learning.policies.bounded import BoundedPolicy  # noqa: E402
from warpdribble.learning.policies.noisy import Noisy  # noqa: E402
from warpdribble.learning.policies.replay import Replay  # noqa: E402
from warpdribble.learning.rollout import Fragment  # noqa: E402
from warpdribble.sims.errors import InputError  # noqa: E402

SMALL = DdpgConfig(
    iterations=4, worlds=8, steps=6, begin_count=60, memory=96, minibatch=4, actor=8, critic=(8, 8), trials=8,
    check_every=2, check_seconds=0.35, drop=1, rate_every=5, few=0, cycles=1,
)  # fmt: skip


MAKE = ddpg.make

# ------------------------------------------------------------------------------------------- the buffer


def filled(path=None, rows=23, worlds=3, size=30, spare=5):
    """A buffer in which everything says of which row and world it is."""
    one = Replay(path, worlds, obs=2, actions=1, size=size, spare=spare)
    for row in range(rows):
        add(one, row, worlds)
    return one


def add(one, row, worlds=3):
    world = np.arange(worlds)
    x = np.stack([np.full(worlds, row), world], axis=1)
    one.add(x, (row + world) % 4, 10.0 * x[:, :1] + x[:, 1:], 0.5 * x[:, 0], (row + world) % 7 == 0)


def test_transitions_belong_together():
    """The state that followed is that of the next row in the same world; only the last `size` are drawn, all
    of them, the newest not yet."""
    one = filled()
    assert len(one) == 27
    some = one.draw(np.random.default_rng(0), 2000)
    row, world = some.x[:, 0], some.x[:, 1]
    np.testing.assert_array_equal(some.after, np.stack([row + 1, world], axis=1))
    np.testing.assert_array_equal(some.k, (row + world) % 4)
    np.testing.assert_array_equal(some.k_after, (row + 1 + world) % 4)
    np.testing.assert_array_equal(some.action[:, 0], 10 * row + world)
    np.testing.assert_array_equal(some.reward, 0.5 * row)
    np.testing.assert_array_equal(some.over, (row + world) % 7 == 0)
    assert set(np.unique(row)) == set(range(13, 22)) and set(np.unique(world)) == {0, 1, 2}


def test_a_buffer_that_is_not_full_has_what_there_is():
    one = filled(rows=4)
    assert len(one) == 9 and len(Replay(None, 3, 2, 1, 30, 5)) == 0
    assert set(np.unique(one.draw(np.random.default_rng(0), 500).x[:, 0])) == {0, 1, 2}
    mean, spread = one.states()
    np.testing.assert_allclose(mean, [1.5, 1.0])
    np.testing.assert_allclose(spread, [np.std(range(4)), np.std(range(3))])


def test_what_was_written_after_a_checkpoint_is_written_again(tmp_path):
    """As many rows as are spare may be: what is drawn then is what was drawn before."""
    one = filled(tmp_path / "replay.npy")
    kept, wanted = one.rows, one.draw(np.random.default_rng(1), 300)
    for row in range(kept, kept + 5):
        add(one, row)
    other = Replay(tmp_path / "replay.npy", 3, 2, 1, 30, 5)
    other.rows = kept
    for got, part in zip(vars(other.draw(np.random.default_rng(1), 300)).values(), vars(wanted).values()):
        np.testing.assert_array_equal(got, part)


def test_a_file_of_another_buffer_is_refused(tmp_path):
    filled(tmp_path / "replay.npy")
    with pytest.raises(InputError, match="not"):
        filled(tmp_path / "replay.npy", size=60)


# ------------------------------------------------------------------------------------------- the learner


def test_the_reward(learned):
    """Eq. 17, number by number."""
    one, _ = learned
    task, n = one.task, one.task.worlds
    fragment = Fragment(0, np.arange(n), None, np.full((n, 20), 0.1), None, None)
    task.fingers = np.where(np.arange(n) % 2, 0.02, np.nan)
    got = one.rewards(fragment)
    for i in range(n):
        off = np.linalg.norm(task.felt[i, task.columns["ball"]] - one.ball[i])
        wanted = 1.0 - np.sqrt(20 * 0.01) - max(0.0, off - task.model.ball_radius)
        wanted -= 10.0 * 0.02 if i % 2 else 0.0
        assert got[i] == pytest.approx(wanted)
    assert one.config.reward == Reward(1.0, 1.0, 10.0, 1.0)


def test_its_parameters_are_the_papers():
    c = DdpgConfig()
    assert (c.gamma, c.noise, c.average, c.decay, c.minibatch) == (0.99, 0.05, 1e-3, 1e-3, 32)
    assert (c.begin_count, c.memory, c.critic, c.actor) == (200_000, 1_000_000, (400, 600), 500)
    assert (c.critic_rate, c.critic_slows, c.actor_rate) == (1e-4, -0.04, 1e-4)
    assert (c.rectified, c.bound, c.slope, c.few, c.cycles) == (50_000, 1.0, 1e-3, 5, 1000)
    assert c.worlds * c.steps == 10_000


def test_it_fills_the_buffer_first_and_then_learns_once_for_each_transition(learned):
    one, reports = learned
    assert [r.iteration for r in reports] == [1, 2, 3, 4]
    assert [r.transitions for r in reports] == [48, 96, 144, 192]
    assert one.nets.steps == 192 - 64  # eight rows are 60 or more
    assert reports[0].q == 0.0 and reports[-1].q != 0.0
    assert [np.isfinite(r.survived) for r in reports] == [r.fresh for r in reports]
    assert all(np.isfinite([r.reward, r.lost, r.samples_per_second, r.critic_rate]).all() for r in reports)
    assert one.policy.scale.min() >= 0.05 and one.policy.mean.any()


def test_idle_arms_do_nothing(learned):
    one, _ = learned
    rng = np.random.default_rng(0)
    k = np.arange(one.task.graph.count)
    for who in (one.linear, None, one.policy):
        action = Noisy(who, 0.05, one.task.active, rng).act(np.zeros((len(k), one.task.obs)), k)
        assert not action[~one.task.active].any() and action[one.task.active].all()


def test_the_fingers_count_only_where_they_have_the_ball(learned, context):
    """H of the task is a part of the reference's; what acts, and checkpoints, are the reference's."""
    one, _ = learned
    usual = ddpg.STAGE.task(context, 8)
    assert (one.task.held <= usual.held).all() and one.task.held.sum() > 0
    np.testing.assert_array_equal(one.task.active, usual.active)
    np.testing.assert_array_equal(one.task.marked, usual.marked)


def test_what_was_learned_is_a_policy_that_acts(learned, context):
    one, _ = learned
    controller = ddpg.STAGE.controller(context, one.result)
    assert isinstance(controller, BoundedPolicy)
    task = ddpg.STAGE.task(context, 8)
    assert controller.act(np.zeros((8, task.obs)), np.arange(8)).shape == (8, 20)


def test_a_state_goes_on_to_the_bit(learned, context, tmp_path):
    """Half of it, then a bit more whose checkpoint was lost, then the rest by another."""
    kept = replace(context, folder=tmp_path)
    one = ddpg.make(kept)
    one.iterate(), one.iterate()
    state = {name: np.array(value) for name, value in one.state.items()}
    one.iterate()
    other = ddpg.make(kept)
    other.restore(state)
    same(learned[0], ended(other))


def test_a_slow_learner_simulates_the_same(learned, context, monkeypatch):
    """What is simulated beside learning does not see what is learned meanwhile, whichever is slower."""
    same(learned[0], ended(delayed(ddpg.make(context), monkeypatch, 0.02)))


@pytest.mark.parametrize("wrong", [{"state": "all"}, {"begin": "all"}, {"phase": "all"}])
def test_unknown_names_are_refused(context, wrong):
    with pytest.raises(InputError, match=r"there is no .* 'all'"):
        ddpg.make(replace(context, config=replace(SMALL, **wrong)))


def test_it_is_over_when_all_trials_last(context, monkeypatch):
    """After an iteration with few enough terminal states, if every trial lasts as long as it shall."""
    one = ddpg.make(replace(context, config=replace(SMALL, few=10**6)))
    asked = []

    class Lasted:
        survived = lived = np.ones(8)

    def tried(task, policy, starts, cycles, seed):
        asked.append(cycles)
        return Lasted

    monkeypatch.setattr(ddpg, "run_trials", tried)
    one.iterate(), one.iterate()
    assert not asked[:-1] and asked[-1] == SMALL.cycles and one.done and one.iteration == 2


def test_stages_know_it():
    assert STAGES["ddpg"].make is ddpg.make and ddpg.REPLAY == "replay.npy"
