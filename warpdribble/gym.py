"""The task of the stage `policy` as a Gymnasium vector environment, for other learners.

    env = DribbleEnv("dribble-right-authored", num_envs=64)
    obs, _ = env.reset(seed=0)
    obs, reward, terminated, truncated, infos = env.step(env.action_space.sample())

All worlds go through a control fragment of 0.05 s in one call. With this module imported,
`gymnasium.make_vec("warpdribble/Dribble-v0", num_envs=64)` is the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .learning import ControlGraph, RandomWalk, Rollout, Run, Starts, Streams
from .learning.methods import STAGES, ppo
from .learning.methods.ball import ball_in_hand
from .learning.tasks.arms import misplaced
from .sims import Model
from .sims.errors import InputError

try:
    from gymnasium import register, spaces
    from gymnasium.error import ResetNeeded
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ModuleNotFoundError as error:
    raise ImportError("warpdribble.gym needs gymnasium: pip install 'warpdribble[gym]'") from error

__all__ = ["DribbleEnv"]

LIMIT = 30.0
"""Numbers of the state, in which a usual deviation is about one, are cut off here."""
WORLDS, CYCLES = 32, 4
"""In which what a policy does on average is found."""


class Given:
    """The controller that does, on top of the mean action of each fragment, what it was given last."""

    def __init__(self, mean: np.ndarray, reach: float):
        self.mean, self.reach = mean, reach
        self.action = np.zeros(mean.shape[1])

    def act(self, obs: np.ndarray, k: np.ndarray) -> np.ndarray:
        return np.asarray(self.mean[k] + self.reach * self.action)


class DribbleEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Players that keep a ball in play, their legs moved by what `locomotion` has learned.

    run: a folder that `warpdribble learn` wrote, or a controller that ships. seconds: after which an episode
    is truncated. speed_noise [rad/s, m/s]: standard deviation of what is added to all joint velocities at a
    start; place_noise [m]: how far off the ball is there. reach [rad]: what an action of one is worth.

    An observation is the state "full" of `Arms`, cut off at LIMIT, and where in its cycle the fragment is: as
    cosine and sine, or one-hot in a graph that is more than one cycle. An action, 20 numbers from -1 to 1, is
    added to the mean of what the run's own policy of the arms does in the fragment; to nothing where it has
    none. The reward is exp(-E / 2) of the fragment's cost E, 0 for the one in which the player falls or
    the ball is lost, which ends the episode. `infos` has `fell` and `lost` (num_envs,) bool.

    The step after an episode's end resets the world, whatever its action, and gives no reward.

    Raises InputError for what is no run, for one without locomotion or a ball, and for numbers out of range.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        run: str | Path = "dribble-right-authored",
        num_envs: int = 64,
        *,
        seconds: float = 10.0,
        speed_noise: float = 0.05,
        place_noise: float = 0.01,
        reach: float = 0.1,
        device: str = "cpu",
    ):
        _check("num_envs", num_envs, 1)
        _check("seconds", seconds)
        _check("reach", reach)
        folder = Run.load(run)
        context = folder.context(ppo.STAGE, ppo.PpoConfig(state="full"), device, learns=False)
        self._task = ppo.STAGE.task(context, num_envs)
        graph = context.graph
        self._starts, mean = _learned(folder, self._task.actions)
        self._given, self._phase = Given(mean, reach), phases(graph)
        self._rollout: Rollout | None = None
        self._usual = {"speed_noise": speed_noise, "place_noise": place_noise}
        self._noise = self._noises({})
        self._last = max(1, round(seconds / graph.period))
        self._age = np.zeros(num_envs, int)
        self._over = np.zeros(num_envs, bool)
        self.num_envs = num_envs
        shape = (self._task.obs + self._phase.shape[1],)
        self.single_observation_space = spaces.Box(-LIMIT, LIMIT, shape, np.float32)
        self.single_action_space = spaces.Box(-1.0, 1.0, (self._task.actions,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    @property
    def graph(self) -> ControlGraph:
        """The control graph that is followed."""
        return self._task.graph

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode in every world. The same seed gives the same episodes to the bit. options:
        `speed_noise`, `place_noise` until the next reset; others raise InputError."""
        self._noise = self._noises(options or {})
        super().reset(seed=seed)
        walk = RandomWalk(Streams([self.np_random], self.num_envs))
        self._rollout = Rollout(self._task, self._given, walk, self._begin(self.num_envs))
        self._age[:] = 0
        self._over[:] = False
        return self._felt(self._rollout.k), {}

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Go through a fragment: actions (num_envs, 20) to observations (num_envs, n), rewards, terminated,
        truncated (num_envs,), infos. Raises ResetNeeded before the first reset, InputError for another
        shape."""
        if self._rollout is None:
            raise ResetNeeded("call reset before the first step")
        if np.shape(actions) != self.action_space.shape:
            raise InputError(f"actions are {np.shape(actions)}, not {self.action_space.shape}")
        self._given.action = np.clip(np.asarray(actions, float), -1.0, 1.0)
        anew = self._over
        for fragment in self._rollout.fragments(1):
            reward = np.where(anew, 0.0, np.exp(-0.5 * fragment.cost))
            terminated = fragment.failed & ~anew
            if anew.any():
                self._rollout.restart(self._begin(int(anew.sum())), anew)
        self._age = np.where(anew, 0, self._age + 1)
        truncated = (self._age >= self._last) & ~terminated
        self._over = terminated | truncated
        ends = {"fell": terminated & self._task.fallen, "lost": terminated & ~self._task.fallen}
        infos = ends | {f"_{name}": np.ones(self.num_envs, bool) for name in ends}
        return self._felt(self._rollout.k), reward, terminated, truncated, infos

    def _noises(self, options: Mapping[str, Any]) -> dict[str, float]:
        """What is usual, but for what the options say."""
        if unknown := sorted(set(options) - set(self._usual)):
            known = ", ".join(self._usual)
            raise InputError(f"there is no option '{unknown[0]}'; there are {known}", hint="options")
        noises = self._usual | dict(options)
        for name, value in noises.items():
            _check(name, value)
        return noises

    def _begin(self, count: int) -> Starts:
        """Random states, disturbed."""
        start = self._starts.draw(Streams([self.np_random], count), self._noise["speed_noise"])
        misplaced(self._task.model, start, self._noise["place_noise"], self.np_random)
        return start

    def _felt(self, k: np.ndarray) -> np.ndarray:
        """(num_envs, n) at the start of fragments k; of a broken world, which has failed, what is finite."""
        s = np.nan_to_num(self._task.observe(k), nan=0.0, posinf=LIMIT, neginf=-LIMIT)
        return np.concatenate([np.clip(s, -LIMIT, LIMIT), self._phase[k]], axis=1, dtype=np.float32)


def _check(name: str, value: float, least: float = 0.0) -> None:
    if not least <= value < np.inf:
        raise InputError(f"{name} is {value}, not a number from {least:g} on", hint=name)


def _learned(run: Run, actions: int) -> tuple[Starts, np.ndarray]:
    """States to start from, and what (fragments, actions) the policy of a run's arms does on average where
    it leads; a fragment to which it does not come has nothing."""
    mean = np.zeros((run.graph.count, actions))
    there = [name for name in ("policy", "linear", "ball") if run.stage(STAGES[name]).learned]
    if not there:
        return ball_in_hand(Model.load("player"), run.graph), mean
    one = run.learned(STAGES, there[0])
    if there[0] == "ball":
        return one.starts, mean
    streams = Streams([np.random.default_rng(0)], WORLDS)
    rollout = Rollout(one.task(WORLDS), one.controller, RandomWalk(streams), one.starts.draw(streams))
    count, stands = np.zeros(len(mean)), np.ones(WORLDS, bool)
    for fragment in rollout.fragments(CYCLES * run.graph.cycle):
        stands &= ~fragment.failed
        np.add.at(mean, fragment.k[stands], fragment.action[stands])
        np.add.at(count, fragment.k[stands], 1.0)
    return one.starts, mean / np.maximum(count, 1.0)[:, None]


def phases(graph: ControlGraph) -> np.ndarray:
    """(fragments, 2) cosine and sine of where each is in the cycle; where there is more than one cycle, or
    none, (fragments, fragments) one-hot."""
    if len(graph.spans) > 1 or graph.branches or graph.ends:
        return np.eye(graph.count)
    angle = 2.0 * np.pi * np.arange(graph.count) / graph.count
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


register("warpdribble/Dribble-v0", vector_entry_point=f"{__name__}:DribbleEnv")
