"""Deep deterministic policy gradient as Liu and Hodgins 2018 (5.3, Algorithm 1) learn their arm policies.

A replay buffer begins with what the linear policy does; then the actor acts, and for every transition there
is one learning step on a minibatch of the buffer. The parameters' defaults are the paper's. Where it is
silent, this is the reading:

* `worlds` go on side by side instead of one, each transition still pays for one step;
* what they do next is simulated while it is learned from what they have done, with the policy from before:
  the newest transition that is learned from is always `worlds` old, so nothing depends on which is faster;
* `phase`: how the fragment's number enters the networks; states are in units of those that the buffer
  begins with;
* a state is terminal where the ball is lost (`tasks.arms.Arms.judge`) or the player has fallen;
* the arm that has nothing to do with the ball in a fragment does nothing, and its action counts nowhere.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Arrays, above, below
from ..ball.averages import averaged
from ..ball.optimised import Optimised
from ..choose import RandomWalk
from ..evaluate.trials import run_trials
from ..policies.bounded import PHASES, BoundedPolicy, phase_table
from ..policies.linear import LinearPolicy
from ..policies.noisy import Noisy
from ..policies.replay import Replay
from ..rollout import Controller, Fragment, Rollout
from ..runs.stage import Context, Report, Stage, known
from ..starts import Starts, Streams
from ..tasks.arms import STATES, BallWeights
from . import samcon
from .ball import STAGE as BALL
from .ball import felt
from .kept import Kept, passed
from .linear import begun


@dataclass(frozen=True)
class Reward:
    """Weights of Eq. 17."""

    always: float = 1.0
    """R_0"""
    action: float = 1.0
    """w_a of the length of the action [rad]"""
    fingers: float = 10.0
    """w_D of the fingers' mean distance from the ball in H [m]"""
    ball: float = 1.0
    """w_ball of the ball's distance from where it is on average, beyond its radius [m]"""


@dataclass(frozen=True)
class DdpgConfig:
    """Parameters of the learner; the defaults are the paper's."""

    iterations: int = 500
    """of `steps` fragments of all worlds: 10 000 transitions, after which terminal states are counted"""
    worlds: int = 50
    steps: int = 200
    begin: str = "linear"
    """what fills the buffer at first, one of BEGINNINGS: the linear policy, or nothing but exploration"""
    begin_count: int = 200_000
    """N_init, transitions"""
    memory: int = 1_000_000
    """N_D, transitions that are drawn from"""
    minibatch: int = 32
    """N_batch"""
    gamma: float = 0.99
    noise: float = 0.05
    """[rad] sigma_eps, exploration"""
    average: float = 0.001
    """eta, by which targets follow"""
    decay: float = 0.001
    """w_theta_Q of Eq. 12"""
    critic_rate: float = 1e-4
    critic_slows: float = -0.04
    """alpha: the critic learns at critic_rate 10^(alpha Q), Q its mean value"""
    rate_every: int = 100
    """learning steps over which Q is the mean"""
    actor_rate: float = 1e-4
    rectified: int = 50_000
    """learning steps at first with the gradient of Eq. 20"""
    actor: int = 500
    """units of its hidden layer"""
    critic: tuple[int, int] = (400, 600)
    slope: float = 0.001
    """of leaky units (Eq. 18)"""
    bound: float = 1.0
    """[rad] b of Eq. 19"""
    last: float = 0.003
    """Weights of last layers are drawn within this (Lillicrap et al. 2015), others in 1 / sqrt(inputs)."""
    phase: str = "one-hot"
    """how a fragment's number enters the networks, one of policies.bounded.PHASES"""
    state: str = "paper"
    """what the policy feels, one of tasks.arms.STATES: the 165 numbers of Eq. 9"""
    reward: Reward = field(default=Reward())
    drop: int = 20
    """cycles at the beginning of the trajectory that do not count"""
    first_ridge: float = 0.01
    """of the linear policy, per unit of state variance"""
    few: int = 5
    """terminal states of an iteration, or fewer, after which the policy is tried for `cycles`"""
    cycles: int = 1000
    """that it shall last"""
    trials: int = 16
    """which all have to"""
    check_every: int = 10
    """iterations between trials of `check_seconds`, which choose the policy that is kept until then"""
    check_seconds: float = 15.0
    cost: BallWeights = field(default=BallWeights())


BEGINNINGS = ("linear", "nothing")
REPLAY = "replay.npy"


@dataclass
class Progress(Report):
    """One iteration in numbers."""

    transitions: int
    """so far, those included that the buffer began with"""
    terminal: int
    """terminal states in this iteration"""
    reward: float
    """mean of a transition"""
    q: float
    """mean value of what was learned from"""
    critic_rate: float
    score: float
    """of the best policy so far"""
    survived: float
    """share of the trials that the present policy lasted; NaN where it was not tried"""
    samples_per_second: float
    """transitions per second of everything"""
    learning: float
    """share of the time that learning took, beside the simulation"""

    @property
    def lost(self) -> float:
        """Terminal states in a thousand transitions."""
        return 1e3 * self.terminal / max(1, self.count)

    count: int = 10_000
    """transitions of this iteration"""


class Ddpg:
    """Learns a policy; everything that its future depends on is in `state` and in the buffer's file."""

    def __init__(self, context: Context):
        c: DdpgConfig = context.config
        self.config, self.seed = c, context.seed
        found = Optimised.of(context.needs[BALL.name])
        self.task, self.trial_task = felt(context, c.worlds), felt(context, c.trials)
        self.ball, touch = averaged(felt(context, 1), found)
        """(fragments, 3) [m] where the ball is on average when each fragment ends, p~ of Eq. 17"""
        self.radius = float(self.task.model.ball_radius)
        policy, self.found = begun(self.task, found, c.drop, c.first_ridge, c.noise)
        self.linear: LinearPolicy | None = policy if c.begin == "linear" else None
        self.task = felt(replace(context, graph=replace(context.graph, touch=touch)), c.worlds)
        self.task.active = self.trial_task.active
        from ..policies.actor_q import ActorQ  # torch, which only learning needs

        obs, actions, phase = self.task.obs, self.task.actions, phase_table(c.phase, context.graph.count)
        self.nets = ActorQ(
            obs + phase.shape[1], actions, c.actor, c.critic, c.slope, c.bound, c.decay,
            (c.actor_rate, c.critic_rate), c.last, self.seed,
        )  # fmt: skip
        own = {"active": self.task.active.astype(np.float32), "phase": phase}
        own |= {"bound": np.array(c.bound), "slope": np.array(c.slope)}
        self.policy = BoundedPolicy(mean=np.zeros(obs), scale=np.ones(obs), **own, **self.nets.weights())
        self.best = Kept(self.policy, self.found)
        path = None if context.folder is None else context.folder / REPLAY
        self.replay = Replay(path, c.worlds, obs, actions, c.memory, 2 * c.steps)
        self.iteration, self._enough = 0, False
        random = np.random.default_rng((self.seed, 0, 0))
        self.rollout = Rollout(
            self.task, self._acting(random), self._walk(random), self._starts(random, c.worlds)
        )
        self._beside = ThreadPoolExecutor(1)

    @property
    def done(self) -> bool:
        return self.iteration >= self.config.iterations or self._enough

    @property
    def fills(self) -> bool:
        """Whether the buffer is still being filled with what it begins with."""
        return self.replay.rows * self.config.worlds < self.config.begin_count

    def _acting(self, random: np.random.Generator) -> Noisy:
        who = self.linear if self.fills else self.policy
        return Noisy(who, self.config.noise, self.task.active, random)

    def _walk(self, random: np.random.Generator) -> RandomWalk:
        return RandomWalk(Streams([random], self.task.worlds))

    def _starts(self, random: np.random.Generator, count: int) -> Starts:
        """Random states of the trajectory."""
        return self.found.draw(Streams([random], count))

    # ------------------------------------------------------------------------------------------ learning

    def iterate(self) -> Progress:
        """Some thousand transitions; now and then the policy is tried."""
        began, c, spent = time.perf_counter(), self.config, 0.0
        acts, learns = (np.random.default_rng((self.seed, which, self.iteration)) for which in (1, 2))
        self.rollout.chooser = self._walk(acts)
        fragments, terminal, reward = self.rollout.fragments(c.steps), 0, 0.0
        for _ in range(c.steps):
            self.rollout.controller = self._acting(acts)
            coming = self._beside.submit(self._simulate, fragments, acts)
            if not self.fills:
                start = time.perf_counter()
                self._learn(learns)
                spent += time.perf_counter() - start
            row = coming.result()
            filled = self.fills
            self.replay.add(*row)
            terminal, reward = terminal + int(row[-1].sum()), reward + float(row[-2].mean())
            if filled and not self.fills:
                self._normalise()
            elif not filled:
                self.policy = replace(self.policy, **self.nets.weights())
        next(fragments, None)
        self.iteration += 1
        survived, few = np.nan, not self.fills and terminal <= c.few
        if few or self.iteration % c.check_every == 0 or self.done:
            survived = self.check(few)
        seconds = time.perf_counter() - began
        return Progress(
            iteration=self.iteration,
            fresh=bool(np.isfinite(survived)),
            transitions=self.replay.rows * c.worlds,
            terminal=terminal,
            reward=reward / c.steps,
            q=self.nets.q,
            critic_rate=self.nets.rate,
            score=self.best.score,
            survived=survived,
            samples_per_second=c.steps * c.worlds / seconds,
            learning=spent / seconds,
            count=c.steps * c.worlds,
        )

    def _simulate(
        self, fragments: Iterator[Fragment], random: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """All worlds go through a fragment, a row of the buffer. Runs beside `_learn`: it must not look at
        the networks."""
        fragment = next(fragments)
        reward = self.rewards(fragment)
        if fragment.failed.any():
            self.rollout.restart(self._starts(random, int(fragment.failed.sum())), fragment.failed)
        return fragment.obs, fragment.k, fragment.action, reward, fragment.failed

    def rewards(self, fragment: Fragment) -> np.ndarray:
        """r (worlds,) of Eq. 17."""
        w, task = self.config.reward, self.task
        off = np.linalg.norm(task.felt[:, task.columns["ball"]] - self.ball[fragment.k], axis=1)
        return np.asarray(
            w.always
            - w.action * np.linalg.norm(fragment.action, axis=1)
            - w.fingers * np.nan_to_num(task.fingers)
            - w.ball * np.maximum(0.0, off - self.radius)
        )

    def _normalise(self) -> None:
        mean, scale = self.replay.states()
        self.policy = replace(self.policy, mean=mean, scale=np.maximum(scale, 0.05))

    def _learn(self, random: np.random.Generator) -> None:
        """A learning step for each transition of a row."""
        from ..policies.actor_q import Mini

        c, policy = self.config, self.policy
        some = self.replay.draw(random, c.worlds * c.minibatch)
        parts = (
            policy.felt(some.x, some.k),
            some.action,
            some.reward,
            policy.felt(some.after, some.k_after),
            (~some.over).astype(np.float32),
            policy.active[some.k],
            policy.active[some.k_after],
        )
        split = (np.ascontiguousarray(part).reshape(c.worlds, c.minibatch, *part.shape[1:]) for part in parts)
        self.nets.learn(Mini(*split), c)

    # -------------------------------------------------------------------------------------------- trials

    def check(self, long: bool) -> float:
        """Try the policy, and keep the best so far; the share of the trials that it lasted. long: for as many
        cycles as it shall last in the end."""
        c, graph = self.config, self.task.graph
        cycles = c.cycles if long else c.check_seconds / (graph.period * graph.cycle)
        trials = run_trials(self.trial_task, self.policy, self.found, cycles, self.seed)
        survived = float(trials.survived.mean())
        self._enough = long and survived == 1.0
        score = (10.0 if long else 1.0) * float(trials.lived.mean())
        if score > self.best.score:
            self.best = Kept(self.policy, passed(self.trial_task, self.policy, self.found, self.seed), score)
        return survived

    @property
    def result(self) -> Arrays | None:
        return self.best.result

    @property
    def state(self) -> Arrays:
        """Arrays by name, from which `restore` goes on exactly as this object would."""
        arrays = self.best.state | above(nets=self.nets.state, worlds=self.task.snapshot())
        own = {
            "iteration": self.iteration,
            "enough": self._enough,
            "rows": self.replay.rows,
            "k": self.rollout.k,
            "mean": self.policy.mean,
            "scale": self.policy.scale,
        }
        return arrays | {name: np.array(part) for name, part in own.items()}

    def restore(self, state: Arrays) -> None:
        """Go on from what `state` was. Raises ValueError for one of other networks."""
        self.nets.restore(below("nets", state))
        self.best.restore(state, BoundedPolicy.of)
        self.task.recall(below("worlds", state))
        self.replay.rows, self.rollout.k = int(state["rows"]), np.array(state["k"])
        self.policy = replace(self.policy, mean=state["mean"], scale=state["scale"], **self.nets.weights())
        self.iteration, self._enough = int(state["iteration"]), bool(state["enough"])


# ------------------------------------------------------------------------------------------------- stage


def make(context: Context) -> Ddpg:
    """The learner of a graph."""
    known(context.config, state=STATES, begin=BEGINNINGS, phase=PHASES)
    return Ddpg(context)


def learned(context: Context, arrays: Arrays) -> Controller:
    """The policy in a result."""
    return BoundedPolicy.of(arrays)


STAGE = Stage(
    name="ddpg",
    about="the paper's network that keeps the ball, as it was published",
    config=DdpgConfig,
    make=make,
    controller=learned,
    task=felt,
    ball=True,
    needs=(samcon.STAGE.name, BALL.name),
    uses=(samcon.STAGE.name,),
    packages=("torch",),
    save_iterations=1,
)
