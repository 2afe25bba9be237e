"""The Gymnasium environment: against the closed loop by hand, against Gymnasium's own checks, and by what it
promises of seeds, ends and beginnings."""

import importlib
import shutil
import sys
import warnings

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils import env_checker  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402

from warpdribble.gym import DribbleEnv, Given, phases  # noqa: E402
from warpdribble.learning import RandomWalk, Rollout, Run, Streams  # noqa: E402
from warpdribble.learning.ball.optimised import observed  # noqa: E402
from warpdribble.learning.graph import STEPS, ControlGraph  # noqa: E402
from warpdribble.learning.methods import STAGES, ppo  # noqa: E402
from warpdribble.sims.errors import InputError  # noqa: E402

NAME = "dribble-right-authored"
CALM = {"speed_noise": 0.0, "place_noise": 0.0}


@pytest.fixture(scope="module")
def env():
    return DribbleEnv(NAME, 6)


@pytest.fixture(scope="module")
def wild():
    """Whose actions lose the ball at once."""
    return DribbleEnv(NAME, 6, reach=2.0)


def actions(env, steps, seed=0):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, *env.action_space.shape)).astype(np.float32)


def gone(env, given, **reset):
    """What a reset and the steps after it say: (name -> (steps, num_envs, ...))."""
    obs, _ = env.reset(**reset)
    seen = {"obs": [obs], "reward": [], "terminated": [], "truncated": [], "fell": [], "lost": []}
    for action in given:
        *told, infos = env.step(action)
        for name, value in zip(("obs", "reward", "terminated", "truncated"), told):
            seen[name].append(value)
        for name in ("fell", "lost"):
            seen[name].append(infos[name])
            assert infos[f"_{name}"].all()
    return {name: np.array(values) for name, values in seen.items()}


def equal(one, two):
    return all(np.array_equal(one[name], two[name]) for name in one)


def test_spaces(env):
    task = ppo.STAGE.task(Run.load(NAME).context(ppo.STAGE, ppo.PpoConfig(), learns=False), 1)
    assert env.single_observation_space.shape == (task.obs + 2,)
    assert env.single_action_space == gymnasium.spaces.Box(-1.0, 1.0, (20,), np.float32)
    assert env.action_space.shape == (6, 20) and env.num_envs == 6
    assert DribbleEnv.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    seen = gone(env, actions(env, 9), seed=0)
    assert all(obs in env.observation_space for obs in seen["obs"])
    assert seen["obs"].dtype == np.float32
    assert seen["terminated"].dtype == seen["truncated"].dtype == bool


def test_the_phase_goes_round_with_the_fragments(env):
    seen = gone(env, np.zeros((5, 6, 20)), seed=0)
    turning = seen["obs"][..., -2].astype(float) + 1j * seen["obs"][..., -1]
    angles = np.angle(turning[1:] / turning[:-1])
    goes_on = ~np.concatenate([np.zeros((1, 6), bool), seen["terminated"][:-1]])  # the step after begins anew
    assert goes_on.mean() > 0.8
    np.testing.assert_allclose(angles[goes_on], 2.0 * np.pi / env.graph.count, atol=1e-5)


def graph_of(edges, count=4):
    none = np.zeros((count, 1))
    return ControlGraph(np.zeros((count * STEPS, 1)), none, none, none, none, np.array(edges), 0.01)


def test_the_phase_of_what_is_no_single_cycle_is_one_hot():
    cycle = [(0, 1), (1, 2), (2, 3), (3, 0)]
    np.testing.assert_allclose(phases(graph_of(cycle)), [[1, 0], [0, 1], [-1, 0], [0, -1]], atol=1e-12)
    np.testing.assert_array_equal(phases(graph_of([*cycle, (1, 3)])), np.eye(4))
    np.testing.assert_array_equal(phases(graph_of([*cycle[:3], (3, 3)])), np.eye(4))


def test_it_is_the_closed_loop(env):
    """The same states, costs and ends as a `Rollout` of the stage's task from the same starts, until the
    first end of an episode."""
    given = actions(env, 10, 3)
    seen = gone(env, given, seed=5)
    random, _ = gymnasium.utils.seeding.np_random(5)
    run = Run.load(NAME)
    task = ppo.STAGE.task(run.context(ppo.STAGE, ppo.PpoConfig(), learns=False), env.num_envs)
    streams = Streams([random], env.num_envs)
    start = run.learned(STAGES, "policy").starts.draw(streams, 0.05)
    ball = task.model.q_slice("ball").start
    start.joint_q[:, ball : ball + 3] += 0.01 / np.sqrt(3.0) * random.standard_normal((env.num_envs, 3))
    controller = Given(env._given.mean, 0.1)
    controller.action = given[0].astype(float)
    going = np.ones(env.num_envs, bool)
    for fragment in Rollout(task, controller, RandomWalk(streams), start).fragments(len(given)):
        row = fragment.row
        own = seen["obs"][row][going]
        np.testing.assert_array_equal(own[:, :-2], fragment.obs[going].astype(np.float32))
        np.testing.assert_array_equal(own[:, -2:], phases(env.graph)[fragment.k[going]].astype(np.float32))
        np.testing.assert_array_equal(seen["reward"][row][going], np.exp(-fragment.cost[going] / 2))
        np.testing.assert_array_equal(seen["terminated"][row][going], fragment.failed[going])
        going &= ~fragment.failed
        if row + 1 < len(given):
            controller.action = given[row + 1].astype(float)
    assert row == 9 and going.any()


def test_a_seed_is_an_episode_to_the_bit(wild):
    """Also in worlds that were used before, and through the resets on the way."""
    given = actions(wild, 12)
    one = gone(wild, given, seed=3)
    assert one["terminated"].any()
    assert equal(one, gone(wild, given, seed=3))
    assert equal(one, gone(DribbleEnv(NAME, 6, reach=2.0), given, seed=3))
    other = gone(wild, given, seed=4)
    assert not np.array_equal(one["obs"][0], other["obs"][0])
    assert not equal(other, gone(wild, given))  # without a seed the random numbers go on


@pytest.mark.parametrize(
    "check",
    [
        env_checker.check_reset_seed_determinism,
        env_checker.check_reset_options,
        env_checker.check_reset_return_type,
        env_checker.check_returned_data_not_reused,
    ],
)
def test_gymnasium_checks_it(check):
    """Those of its checks that an array of one number for each world passes, where that is one world."""
    env = DribbleEnv(NAME, 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(env)
        env_checker.check_space_limit(env.single_observation_space, "observation")
        env_checker.check_space_limit(env.single_action_space, "action")


def test_a_finished_world_begins_anew_in_the_next_step(wild):
    """At one of the states to start from, whatever the action, with no reward; the others go on."""
    given = actions(wild, 30)
    seen = gone(wild, given, seed=1, options=CALM)
    over = seen["terminated"] | seen["truncated"]
    assert over.any() and not over.all(axis=1).any()
    assert np.all(seen["reward"][seen["terminated"]] == 0.0)
    rows, worlds = np.nonzero(over[:-1])
    assert np.all(seen["reward"][rows + 1, worlds] == 0.0)
    assert not over[rows + 1, worlds].any()
    going = np.ones_like(over)
    going[rows + 1, worlds] = False
    assert np.all(seen["reward"][going & ~over] > 0.0)
    run = Run.load(NAME)
    starts = run.learned(STAGES, "policy").starts
    task = ppo.STAGE.task(run.context(ppo.STAGE, ppo.PpoConfig(), learns=False), 16)
    known = np.concatenate([observed(task, starts), phases(task.graph)[starts.k]], axis=1)
    began = seen["obs"][rows + 2, worlds]
    apart = np.abs(began[:, None] - known[None]).max(axis=2).min(axis=1)
    assert apart.max() < 1e-4 and len(began) > 5


def test_a_world_that_breaks_down_ends_and_comes_back(env):
    """By actions that are no numbers: what is said of it stays finite, and nobody else feels it."""
    given = 0.1 * actions(env, 6, 6)
    calm = gone(env, given, seed=2)
    given[1, 0] = np.nan
    seen = gone(env, given, seed=2)
    over = np.argmax(seen["terminated"][:, 0])
    assert seen["terminated"][1:3, 0].any() and seen["fell"][over, 0]
    assert np.isfinite(seen["obs"]).all() and np.isfinite(seen["reward"]).all()
    assert np.all(seen["reward"][over + 2 :, 0] > 0.0)
    assert not calm["terminated"].any()
    for name in ("obs", "reward", "terminated"):
        np.testing.assert_array_equal(seen[name][:, 1:], calm[name][:, 1:])


def test_episodes_are_truncated_in_time():
    env = DribbleEnv(NAME, 4, seconds=0.3)
    seen = gone(env, np.zeros((14, 4, 20)), seed=0, options=CALM)
    assert not seen["terminated"].any()
    np.testing.assert_array_equal(np.flatnonzero(seen["truncated"].all(axis=1)), [5, 12])  # 6 fragments
    assert seen["truncated"].sum() == 8
    np.testing.assert_array_equal(np.flatnonzero((seen["reward"] == 0.0).all(axis=1)), [6, 13])


def test_who_fell_and_who_lost_the_ball_is_said(env):
    """Players flung about fall, actions of some radians only lose the ball."""
    thrown = gone(env, np.zeros((30, 6, 20)), seed=0, options={"speed_noise": 3.0})
    assert thrown["fell"].any()
    for seen in (thrown, gone(env, actions(env, 30), seed=0)):
        np.testing.assert_array_equal(seen["fell"] | seen["lost"], seen["terminated"])
        assert not (seen["fell"] & seen["lost"]).any()
    assert seen["lost"].any() and not seen["fell"].any()


def test_actions_add_to_what_the_runs_policy_does_on_average(tmp_path):
    """Without any the ball is kept longer than by arms that follow the clip, as in a run without a policy."""
    shutil.copytree(Run.load(NAME).folder, tmp_path / "run")
    shutil.rmtree(tmp_path / "run" / "policy")
    lasted = {}
    for run in (NAME, tmp_path / "run"):
        env = DribbleEnv(run, 16)
        seen = gone(env, np.zeros((40, 16, 20)), seed=0)
        lasted[run] = (np.cumsum(seen["terminated"], axis=0) == 0).sum(axis=0).mean()
        assert env._given.mean.any() == (run == NAME)
    assert lasted[NAME] > 1.5 * lasted[tmp_path / "run"]


def test_it_is_made_by_its_name():
    env = gymnasium.make_vec("warpdribble.gym:warpdribble/Dribble-v0", num_envs=2, seconds=1.0)
    assert isinstance(env.unwrapped, DribbleEnv) and env.num_envs == 2
    env.close()


def test_what_is_wrong_is_said(env, tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        DribbleEnv(tmp_path / "none")
    for wrong in ({"num_envs": 0}, {"seconds": -1.0}, {"speed_noise": np.nan}, {"reach": np.inf}):
        with pytest.raises(InputError, match=f"{next(iter(wrong))} is .*, not a number from"):
            DribbleEnv(NAME, **wrong)
    with pytest.raises(InputError, match="no option 'noise'; there are speed_noise, place_noise"):
        env.reset(options={"noise": 1.0})
    with pytest.raises(InputError, match="place_noise is -1, not a number from 0 on"):
        env.reset(options={"place_noise": -1})
    with pytest.raises(InputError, match=r"actions are \(20,\), not \(6, 20\)"):
        env.reset()
        env.step(np.zeros(20))
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
        DribbleEnv(NAME, 1).step(np.zeros((1, 20)))


def test_without_gymnasium_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "warpdribble.gym")
    with pytest.raises(ImportError, match=r"pip install 'warpdribble\[gym\]'"):
        importlib.import_module("warpdribble.gym")
