"""Proximal policy optimisation (Schulman et al. 2017) of a network that adds to what trajectory optimisation
found: a policy of arms and fingers that keeps the ball.

The state is felt, the action drawn from N(pi(s), diag(sigma^2)), and a fragment's reward is exp(-E / 2) of
its cost E, nothing for the one in which the ball is lost. An advantage is estimated over `steps` fragments
(GAE, Schulman et al. 2016) with a critic V of the same size, and the clipped objective

    mean min(r A, clip(r, 1 - eps, 1 + eps) A),   r = pi_new(a | s) / pi_old(a | s)

is climbed for some epochs. While a batch is learned from, the next is simulated, with the policy from before:
the lag is always one batch, so nothing depends on which of the two is faster.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Arrays, above, below
from ..ball.optimised import Optimised
from ..choose import RandomWalk
from ..evaluate.trials import about_trials, run_trials
from ..policies.batch import Batch, advantages
from ..policies.network import NetworkPolicy
from ..rollout import Controller, Rollout
from ..runs.stage import Context, Report, Stage, known
from ..starts import Starts, Streams
from ..tasks.arms import RESTITUTION, STATES, Arms, BallWeights, misplaced
from ..tasks.balls import Balls, widened
from ..tasks.disturbance import Disturbance, Disturber
from . import samcon
from .ball import STAGE as BALL
from .ball import felt
from .kept import Kept, passed
from .linear import begun


@dataclass(frozen=True)
class PpoConfig:
    """Parameters of the learner, and of what the policy has to stand."""

    iterations: int = 400
    """batches"""
    worlds: int = 1024
    steps: int = 16
    """fragments of each world in a batch"""
    epochs: int = 4
    minibatch: int = 2048
    gamma: float = 0.97
    """worth of a reward one fragment later"""
    smooth: float = 0.95
    """lambda of the advantages"""
    clip: float = 0.2
    """eps"""
    rate: float = 5e-4
    """of Adam at first; it follows `divergence`"""
    divergence: float = 0.03
    """mean of log pi_old - log pi_new that a batch should lead to"""
    width: int = 128
    """of hidden layers"""
    sigma: float = 0.04
    """[rad] exploration at first"""
    base: str = "linear"
    """what the network adds to: "linear", P1's regression; "offsets", the mean action of each fragment; or
    "nothing\""""
    state: str = "full"
    """what the policy feels, one of `tasks.arms.STATES`"""
    speed_noise: float = 0.15
    """[rad/s, m/s] standard deviation of what is added to all joint velocities at a start, the ball's too"""
    place_noise: float = 0.01
    """[m] of how far off the ball is"""
    restitution: float = 0.12
    """Each world has a ball of its own; that of ball and ground is drawn from so far around the model's"""
    mass: float = 0.3
    """and its mass from so large a share"""
    sensor_noise: float = 0.05
    """standard deviation of what is added to what is felt, in units of the state"""
    disturbance: Disturbance = field(default=Disturbance(push=150.0))
    """pushes grow with the noise of starts"""
    enough: float = 0.99
    """share of the trials to survive, from starts as disturbed as they shall be, after which it is done"""
    episode: int = 200
    """fragments after which a world starts anew"""
    check_every: int = 25
    """iterations between trials of the policy"""
    trials: int = 128
    """of a check"""
    check_seconds: float = 15.0
    """that each lasts"""
    drop: int = 20
    """cycles at the beginning of the trajectory that do not count"""
    first_ridge: float = 0.01
    """of the regression, per unit of state variance"""
    cost: BallWeights = field(default=BallWeights(change=0.6))


BASES = ("linear", "offsets", "nothing")
EASY, HARDER, FEW = 0.2, 1.03, 0.02
"""Starts are disturbed by so much at first, and by so much more each time that fewer fragments fail; so are
balls, each end of their ranges by the fragments that fail near it."""
POOL = 2048
"""States of the policy's own way that are kept to start from."""
KEPT = 64
"""of them from a batch"""


@dataclass
class Progress(Report):
    """One iteration in numbers."""

    reward: float
    """mean of a fragment"""
    lost: float
    """times that a ball was lost, or a player fell, in a thousand fragments"""
    hardness: float
    """share of the disturbances that starts had"""
    least_restitution: float
    """of the balls"""
    sigma: float
    """[rad] mean exploration"""
    rate: float
    """of Adam"""
    score: float
    """of the best policy so far"""
    survived: float
    """share of the trials that the present policy lasted; NaN where it was not tried"""
    samples_per_second: float
    """fragments simulated per second of everything"""
    learning: float
    """share of the time that learning took, beside the simulation"""


class Drawn:
    """The policy's actions with exploration, as they were drawn last."""

    def __init__(
        self, policy: NetworkPolicy, log_sigma: np.ndarray, random: np.random.Generator, sensors: float
    ):
        self.policy, self.log_sigma, self.random, self.sensors = policy, log_sigma, random, sensors
        self.sigma = np.exp(log_sigma)

    def felt(self, s: np.ndarray) -> np.ndarray:
        """States as they are felt."""
        return s + self.sensors * self.random.standard_normal(s.shape, np.float32)

    def act(self, s: np.ndarray, k: np.ndarray) -> np.ndarray:
        s = self.felt(s)
        self.x = self.policy.felt(s)
        self.mean = self.policy.network(self.x, k)
        self.noise = self.random.standard_normal(self.mean.shape, np.float32)
        return self.policy.base(s, k) + self.policy.reach * (self.mean + self.sigma * self.noise)


class Ppo:
    """Learns a policy; everything that its future depends on is in `state`."""

    def __init__(self, task: Arms, trial_task: Arms, config: PpoConfig, found: Optimised, seed: int = 0):
        self.task, self.trial_task, self.config, self.seed = task, trial_task, config, seed
        c, graph = config, task.graph
        from ..policies.actor_critic import ActorCritic  # torch, which only learning needs

        base, self.found = begun(task, found, c.drop, c.first_ridge, c.sigma)
        if c.base != "linear":
            base.M, base.a_hat = base.M[:, :, :0], np.zeros_like(base.a_hat)
        if c.base == "offsets":
            base.a_hat = np.stack([found.action[found.k == k].mean(axis=0) for k in range(graph.count)])
        self.own = self.found[:0]
        self.nets = ActorCritic(task.obs, task.actions, graph.count, c.width, c.rate, seed)
        self.policy = NetworkPolicy(
            base.M, base.a_hat, np.zeros(task.obs), np.ones(task.obs), np.array(c.sigma), self.nets.network()
        )
        self.best = Kept(self.policy, self.found)
        self.hardness = EASY
        """share of the disturbances of starts, which grows as they are stood"""
        self.iteration, self._enough = 0, False
        self.batch: Batch | None = None
        random = np.random.default_rng((seed, 0, 0))
        self.age = random.integers(0, c.episode, task.worlds)
        self.disturber = Disturber(c.disturbance, Streams([random], task.worlds))
        start = self._starts(random, task.worlds)
        self.rollout = Rollout(task, self._drawn(random), self._walk(random), start, self.disturber)
        self.ranges = np.full((2, 2), EASY)
        """share of what balls may differ by at each end, which grows where they are kept"""
        self.spread = random.uniform(-1.0, 1.0, (task.worlds, 2))
        """(worlds, 2) where in its range what each world's ball has is"""
        self.balls = Balls(c.restitution, c.mass)
        self.balls.put(trial_task, 1.0, random.uniform(-1.0, 1.0, (trial_task.worlds, 2)))
        self._beside = ThreadPoolExecutor(1)

    @property
    def done(self) -> bool:
        return self.iteration >= self.config.iterations or self._enough

    def _drawn(self, random: np.random.Generator) -> Drawn:
        return Drawn(self.policy, self.nets.log_sigma(), random, self.config.sensor_noise)

    def _walk(self, random: np.random.Generator) -> RandomWalk:
        return RandomWalk(Streams([random], self.task.worlds))

    def _starts(self, random: np.random.Generator, count: int) -> Starts:
        """Random states: half of them from the trajectory, half from the policy's own way, disturbed."""
        c, streams = self.config, Streams([random], count)
        start = self.found.draw(streams, c.speed_noise * self.hardness)
        if len(self.own):
            other, mine = self.own.draw(streams, c.speed_noise * self.hardness), random.random(count) < 0.5
            for name, part in vars(start).items():
                part[mine] = vars(other)[name][mine]
        misplaced(self.task.model, start, self.hardness * c.place_noise, random)
        return start

    # ------------------------------------------------------------------------------------------ learning

    def iterate(self) -> Progress:
        """Simulate a batch, and meanwhile learn from the one before; now and then try the policy."""
        began = time.perf_counter()
        random = np.random.default_rng((self.seed, 1, self.iteration))
        next_batch = self._beside.submit(self._simulate, random, self._drawn(random))
        spent = 0.0
        if self.batch is not None:
            self._learn(self.batch)
            spent = time.perf_counter() - began
        batch = self.batch = next_batch.result()
        if self.iteration == 0:  # what the state is scaled by; nothing is learned from it
            self._normalise(batch)
            self.batch = None
        network = self.nets.network()
        self.policy = replace(self.policy, network=network)
        if batch.failed.mean() < FEW:
            self.hardness = min(1.0, HARDER * self.hardness)
        self.ranges = widened(self.ranges, self.spread, batch.failed.mean(axis=0), FEW, HARDER)
        self.iteration += 1
        survived = np.nan
        if self.iteration % self.config.check_every == 0 or self.done:
            survived = self.check()
        seconds = time.perf_counter() - began
        return Progress(
            iteration=self.iteration,
            fresh=bool(np.isfinite(survived)),
            reward=float(batch.reward.mean()),
            lost=1e3 * float(batch.failed.mean()),
            hardness=self.hardness,
            least_restitution=RESTITUTION - self.ranges[0, 0] * self.config.restitution,
            sigma=self.config.sigma * float(np.exp(batch.log_sigma).mean()),
            rate=self.nets.rate,
            score=self.best.score,
            survived=survived,
            samples_per_second=batch.reward.size / seconds,
            learning=spent / seconds,
        )

    def _simulate(self, random: np.random.Generator, drawn: Drawn) -> Batch:
        """Go on in all worlds for a batch. Runs beside `_learn`: it must not look at the networks."""
        c, task, graph = self.config, self.task, self.task.graph
        self.rollout.controller, self.rollout.chooser = drawn, self._walk(random)
        self.disturber.streams = Streams([random], task.worlds)
        self.disturber.what = replace(c.disturbance, push=self.hardness * c.disturbance.push)
        self.balls.put(task, self.ranges, self.spread)
        shape = (c.steps, task.worlds)
        x = np.empty((c.steps + 1, task.worlds, task.obs), np.float32)
        k = np.empty((c.steps + 1, task.worlds), int)
        mean, noise = (np.empty((*shape, task.actions), np.float32) for _ in range(2))
        reward, lost = np.empty(shape, np.float32), np.empty(shape, bool)
        for fragment in self.rollout.fragments(c.steps):
            t, failed = fragment.row % c.steps, fragment.failed
            x[t], k[t], mean[t], noise[t] = drawn.x, fragment.k, drawn.mean, drawn.noise
            reward[t], lost[t] = np.exp(-0.5 * fragment.cost), failed
            self.age += 1
            over = failed.copy()
            if t == c.steps - 1:
                k[-1] = self.rollout.chooser.next(graph, fragment.k)
                x[-1] = self.policy.felt(drawn.felt(task.observe(k[-1])))
                self._keep(random, k[-1], failed)
                over |= self.age >= c.episode
            if over.any():
                self.rollout.restart(self._starts(random, int(over.sum())), over)
                self.age[over] = 0
        return Batch(x, k, noise, mean, drawn.log_sigma, reward, lost)

    def _keep(self, random: np.random.Generator, k: np.ndarray, failed: np.ndarray) -> None:
        """Keep some states of worlds that have gone on for a while."""
        settled = np.flatnonzero(~failed & (self.age >= 3 * self.task.graph.cycle))
        if len(settled):
            which = random.permutation(settled)[:KEPT]
            own = Starts.joined([self.own, self.task.states(k[which], which)])
            self.own = own[-POOL:]

    def _normalise(self, batch: Batch) -> None:
        """The state is in units of the first batch."""
        x = batch.x.reshape(-1, batch.x.shape[-1])
        mean, scale = x.mean(axis=0), np.maximum(x.std(axis=0), 0.05)
        self.policy = replace(self.policy, mean=mean, scale=scale)

    def _learn(self, batch: Batch) -> None:
        c = self.config
        value = self.nets.value(batch.x, batch.k)
        advantage = advantages(batch.reward, batch.failed, value, c.gamma, c.smooth)
        target = advantage + value[:-1]
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-6)
        random = np.random.default_rng((self.seed, 2, self.iteration))
        self.nets.learn(batch, advantage, target, self.task.active, c, random)

    # -------------------------------------------------------------------------------------------- trials

    def check(self) -> float:
        """Try the policy from disturbed states, and keep the best so far; the share of the trials that it
        lasted. The score is the share of the trials' time that was survived, less a hundredth of the cost."""
        c = self.config
        start = Starts.joined([self.found, self.own]) if len(self.own) else self.found
        graph = self.task.graph
        cycles = c.check_seconds / (graph.period * graph.cycle)
        trials = run_trials(
            self.trial_task, self.policy, start, cycles, self.seed, c.speed_noise, c.disturbance
        )
        score = float(trials.lived.mean()) - 0.01 * trials.cost if trials.lived.any() else -1.0
        if score > self.best.score:
            self.best = Kept(self.policy, passed(self.trial_task, self.policy, start, self.seed), score)
        survived = float(trials.survived.mean())
        self._enough = survived >= c.enough and self.hardness == 1.0
        return survived

    @property
    def result(self) -> Arrays | None:
        return self.best.result

    @property
    def state(self) -> Arrays:
        """Arrays by name, from which `restore` goes on exactly as this object would."""
        batch = {} if self.batch is None else vars(self.batch)
        arrays = self.best.state | above(
            nets=self.nets.state,
            own=vars(self.own),
            worlds=self.task.snapshot(),
            disturber=self.disturber.state,
            batch=batch,
        )
        numbers = {"iteration": self.iteration, "enough": self._enough, "hardness": self.hardness}
        own = {"age": self.age, "k": self.rollout.k, "mean": self.policy.mean, "scale": self.policy.scale}
        own["ranges"] = self.ranges
        return arrays | {name: np.array(part) for name, part in (numbers | own).items()}

    def restore(self, state: Arrays) -> None:
        """Go on from what `state` was. Raises ValueError for one of another network."""
        self.nets.restore(below("nets", state))
        self.best.restore(state, NetworkPolicy.of)
        self.own = Starts(**below("own", state))
        self.task.recall(below("worlds", state))
        self.disturber.restore(below("disturber", state))
        self.batch = Batch(**batch) if (batch := below("batch", state)) else None
        self.age, self.rollout.k = np.array(state["age"]), np.array(state["k"])
        self.policy = replace(
            self.policy, mean=state["mean"], scale=state["scale"], network=self.nets.network()
        )
        self.iteration, self._enough = int(state["iteration"]), bool(state["enough"])
        self.hardness, self.ranges = float(state["hardness"]), np.array(state["ranges"])


# ------------------------------------------------------------------------------------------------- stage


def make(context: Context) -> Ppo:
    """The learner of a graph."""
    c: PpoConfig = context.config
    known(c, state=STATES, base=BASES)
    found = Optimised.of(context.needs[BALL.name])
    return Ppo(felt(context, c.worlds), felt(context, c.trials), c, found, context.seed)


def learned(context: Context, arrays: Arrays) -> Controller:
    """The policy in a result."""
    return NetworkPolicy.of(arrays)


def about_check(c: PpoConfig) -> str:
    """What `Ppo.check` lets policies stand, for a person."""
    return about_trials(c.trials, f"{c.check_seconds:g} s", c.speed_noise, c.disturbance)


STAGE = Stage(
    name="policy",
    about="a network that keeps the ball, whatever disturbs it",
    config=PpoConfig,
    make=make,
    controller=learned,
    task=felt,
    ball=True,
    needs=(samcon.STAGE.name, BALL.name),
    uses=(samcon.STAGE.name,),
    packages=("torch",),
    check=about_check,
    save_iterations=1000,
)
