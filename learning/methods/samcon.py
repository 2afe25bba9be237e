"""Guided SAMCON: linear feedback policies from a reference motion, by expectation maximisation (Liu et al.
2016; P1 3.3). docs/locomotion.md derives it and says what differs from the paper.

E-step, `explore`: sequential Monte Carlo along random walks through the control graph. Particles, one world
each, try actions drawn from the policy; after every fragment the worse part of an island gives way to
copies of the better. An action is worth the number of descendants it has a little later.

M-step, `improve`: weighted ridge regression of the actions that had descendants on the states they were
taken in.

Islands are walks that know nothing of each other, each with random numbers of its own: they are shared out
among workers, and whatever their number the result is the same."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from ...sims.errors import InputError
from ...sims.worlds.cores import usable_cores
from ..arrays import Arrays, above, below
from ..choose import RandomWalk
from ..evaluate.trials import Trials, about_trials, record_starts, run_trials
from ..policies.em import Moments, added, descendants, improve, select
from ..policies.linear import Explore, LinearPolicy
from ..rollout import Rollout
from ..runs.stage import Context, Report, Stage
from ..starts import Starts, Streams, reference_starts
from ..tasks.disturbance import Disturbance, Disturber
from ..tasks.locomotion import FELT, STEERED, WEIGHTS, CostWeights, Locomotion, legs_graph, locomotion_model
from ..workers import Workers, shares
from .kept import Kept

T = TypeVar("T")
RECORD_EVERY = 5
"""Fragments between recorded states."""
SETTLED = 20
"""Fragments after which the states of a walk are typical of the policy."""
TRIED = 2
"""Policies that a check tries: the mean and the present one."""


@dataclass(frozen=True)
class SamconConfig:
    """Parameters of Guided SAMCON."""

    iterations: int = 80
    """of expectation maximisation"""
    islands: int = 16
    """walks side by side, each with its own start and disturbances"""
    particles: int = 64
    """samples per fragment of each walk (N_s)"""
    keep: float = 0.65
    """share of the particles that have children (n_save / N_s)"""
    walk: int = 160
    """fragments of a walk"""
    lag: int = 12
    """fragments after which descendants are counted"""
    sigma: float = 0.12
    """[rad] exploration at first"""
    least_sigma: float = 0.06
    """[rad] and at least"""
    open_loop: int = 2
    """iterations at first that learn offsets a_hat only"""
    ridge: float = 0.02
    """pull of the feedback to what it was, per unit of state variance"""
    doubt: float = 20.0
    """pull to what it was, in samples"""
    average: float = 0.9
    """share of the old in the running mean of the policies"""
    speed_noise: float = 0.2
    """[rad/s, m/s] standard deviation of what is added to all joint velocities at a walk's start"""
    disturbance: Disturbance = field(default=Disturbance(push=400.0, arms=0.2, hands=18.0))
    check_every: int = 10
    """iterations between trials of the policy"""
    trials: int = 256
    """of a check"""
    check_cycles: float = 20.0
    """that each lasts"""
    weights: CostWeights = field(default=WEIGHTS)


# ----------------------------------------------------------------------------------------------- E-step


@dataclass
class Island:
    """What one walk saw."""

    moments: Moments
    starts: Starts | None
    """states that the policy came through and lived on from; None for none"""
    cost: float
    """sum over the particles that stood"""
    stood: int
    """of how many it is the sum"""
    falls: int
    """times that all particles fell, and the walk began anew"""


def explore(
    task: Locomotion,
    policy: LinearPolicy,
    config: SamconConfig,
    pool: Starts,
    seeds: Sequence[np.random.SeedSequence],
) -> list[Island]:
    """E-step: an island for each seed, side by side in the worlds of the task, each from a state of the
    pool."""
    streams = Streams([np.random.default_rng(seed) for seed in seeds], group=config.particles)
    starts = pool.draw(streams, config.speed_noise)
    disturber = Disturber(config.disturbance, streams)
    rollout = Rollout(task, Explore(policy, streams), RandomWalk(streams), starts, disturber)
    rows, islands, P = config.walk, streams.count, config.particles
    S, A = (np.empty((rows, islands, P, n)) for n in (task.obs, task.actions))
    k, E, parents = (
        np.empty((rows, islands), int),
        np.empty((rows, islands, P)),
        np.empty((rows, islands, P), int),
    )
    states: list[tuple[int, Starts]] = []
    home = np.arange(islands)[:, None] * P
    for fragment in rollout.fragments(rows):
        row, cost = fragment.row, fragment.cost.reshape(islands, P)
        parent, lost = select(cost, config.keep)
        S[row], A[row] = fragment.obs.reshape(S[row].shape), fragment.action.reshape(A[row].shape)
        k[row], E[row], parents[row] = fragment.k[::P], cost, np.where(lost[:, None], -1, parent)
        rollout.become((home + parent).ravel())
        if lost.any():
            rollout.restart(pool.draw(streams.only(lost), config.speed_noise), np.repeat(lost, P))
        if row % RECORD_EVERY == RECORD_EVERY - 1:
            best = home[:, 0] + np.argmin(np.take_along_axis(cost, parent, axis=1), axis=1)
            after = rollout.chooser.next(task.graph, fragment.k)[best]
            states.append((row, task.states(after, best)))
    return [
        _island(config, task.graph.count, S[:, i], A[:, i], k[:, i], E[:, i], parents[:, i], _own(states, i))
        for i in range(islands)
    ]


def _own(states: list[tuple[int, Starts]], i: int) -> list[tuple[int, Starts]]:
    """Those of one island."""
    own = slice(i, i + 1)
    return [(row, Starts(s.k[own], s.joint_q[own], s.joint_qd[own])) for row, s in states]


def _island(
    config: SamconConfig, fragments: int, S: np.ndarray, A: np.ndarray, k: np.ndarray, E: np.ndarray,
    parents: np.ndarray, states: list[tuple[int, Starts]],
) -> Island:  # fmt: skip
    """What one island saw, in arrays with a row per fragment."""
    W, each = descendants(parents, config.lag), np.repeat(k, config.particles)
    moments = Moments.of(S.reshape(len(each), -1), A.reshape(len(each), -1), each, W.ravel(), fragments)
    rows, lost = np.arange(len(k)), parents[:, 0] < 0
    age = rows - np.maximum.accumulate(np.where(lost, rows, -1))
    lives = np.array([not lost[row + 1 :][: config.lag].any() for row in rows]) & (
        rows < len(rows) - config.lag
    )
    typical = [s for row, s in states if age[row] >= SETTLED and lives[row]]
    starts, stood = Starts.joined(typical) if typical else None, np.isfinite(E)
    return Island(moments, starts, float(E[stood].sum()), int(stood.sum()), int(lost.sum()))


# ---------------------------------------------------------------------------------------------- learning


@dataclass
class Progress(Report):
    """One iteration in numbers."""

    cost: float
    """mean over the particles that stand"""
    falls: int
    """times that an island lost all particles"""
    sigma: float
    """[rad] mean exploration"""
    score: float
    """of the best policy so far; see `Samcon.check`"""
    survived: float
    """share of the trials that the present policy lasted; NaN where it was not tried"""
    samples_per_second: float
    """fragments simulated per second of everything"""
    outside: float
    """share of the workers' time that is not simulation"""


class Samcon:
    """Learns a policy; everything that its future depends on is in `state`. tasks: where the islands walk,
    shared out evenly, one for each worker, and where policies are tried at once."""

    def __init__(
        self,
        tasks: Sequence[Locomotion],
        trial_tasks: Sequence[Locomotion],
        config: SamconConfig,
        seed: int = 0,
    ):
        if sum(task.worlds for task in tasks) != config.islands * config.particles:
            raise ValueError(
                f"the tasks need {config.islands * config.particles} worlds, a world per particle"
            )
        if len(trial_tasks) < min(len(tasks), TRIED):
            raise ValueError(f"{len(tasks)} workers need {TRIED} tasks for trials, which run at once")
        self.tasks, self.trial_tasks, self.config, self.seed = list(tasks), list(trial_tasks), config, seed
        self.workers = Workers(len(self.tasks))
        graph = self.tasks[0].graph
        self.policy = LinearPolicy.zero(graph.count, self.tasks[0].actions, self.tasks[0].obs, config.sigma)
        self.mean = self.policy.copy()
        self.iteration = 0
        self.starts = reference_starts(graph)
        self.best = Kept(self.policy.copy(), self.starts)

    @property
    def done(self) -> bool:
        return self.iteration >= self.config.iterations

    def iterate(self) -> Progress:
        """One E-step and M-step; the policies are tried now and then."""
        began, before = time.perf_counter(), self._spent
        c = self.config
        islands = self._explore()
        feedback = self.iteration >= c.open_loop
        self.policy = improve(self.policy, added([i.moments for i in islands]), c, feedback)
        self.mean = self.policy.moved(self.mean, c.average if feedback else 0.0)
        if found := [island.starts for island in islands if island.starts is not None]:
            self.starts = Starts.joined(found)
        return self.tried(islands, began, before)

    def tried(
        self,
        islands: Sequence[Island] = (),
        began: float | None = None,
        before: tuple[float, float] | None = None,
    ) -> Progress:
        """The end of an iteration: try the policies, if it is time, and say how it went. began [s], before:
        when, and with what spent."""
        began = time.perf_counter() if began is None else began
        before = self._spent if before is None else before
        first = self.iteration == 0 and not islands
        self.iteration += 1
        survived = np.nan
        if first or self.iteration % self.config.check_every == 0 or self.done:
            survived = self.check()
        seconds = time.perf_counter() - began
        samples, simulating = np.subtract(self._spent, before) / seconds
        stood = sum(island.stood for island in islands)
        return Progress(
            iteration=self.iteration,
            fresh=bool(np.isfinite(survived)),
            cost=sum(island.cost for island in islands) / stood if stood else np.nan,
            falls=sum(island.falls for island in islands),
            sigma=float(self.policy.sigma.mean()),
            score=self.best.score,
            survived=survived,
            samples_per_second=float(samples),
            outside=float(1.0 - simulating / len(self.tasks)),
        )

    def _explore(self) -> list[Island]:
        """All islands, in their order."""
        seeds = np.random.SeedSequence((self.seed, self.iteration)).spawn(self.config.islands)
        shares, first = [], 0
        for task in self.tasks:
            count = task.worlds // self.config.particles
            shares.append((task, self.policy, self.config, self.starts, seeds[first : first + count]))
            first += count
        return [island for share in self.workers.each(explore, shares) for island in share]

    @property
    def _spent(self) -> tuple[float, float]:
        """Fragments simulated so far, and the seconds that the workers' simulations took."""
        tasks = {id(task): task for task in (*self.tasks, *self.trial_tasks)}.values()
        return sum(task.samples for task in tasks), sum(task.simulating for task in tasks)

    def check(self) -> float:
        """Try the policy and its running mean under disturbances, and keep the best so far; the share of
        trials that the policy lasted. The score is the share of the trials' time that was survived, less a
        hundredth of the cost."""
        survived, tried = 0.0, [self.mean, self.policy]
        jobs = [
            (
                self.trial_tasks[i % len(self.trial_tasks)],
                policy,
                self.starts,
                self.config,
                self.seed,
                self.best.score,
            )
            for i, policy in enumerate(tried)
        ]
        for policy, (trials, score, starts) in zip(tried, self.workers.each(_try, jobs)):
            survived = float(trials.survived.mean())
            if starts is not None and score > self.best.score:
                self.best = Kept(policy.copy(), starts, score)
        return survived

    @property
    def result(self) -> Arrays | None:
        return self.best.result

    @property
    def state(self) -> Arrays:
        """Arrays by name, from which `restore` goes on exactly as this object would."""
        own = above(policy=self.policy.arrays, mean=self.mean.arrays, starts=vars(self.starts))
        return self.best.state | own | {"iteration": np.array(self.iteration)}

    def restore(self, state: Arrays) -> None:
        """Go on from what `state` was."""
        shape = state["policy.M"].shape
        if shape != self.policy.M.shape:
            raise ValueError(f"policy.M has the shape {shape}")
        self.policy, self.mean = (LinearPolicy.of(below(name, state)) for name in ("policy", "mean"))
        self.best.restore(state, LinearPolicy.of)
        self.starts, self.iteration = Starts(**below("starts", state)), int(state["iteration"])


def _try(
    task: Locomotion, policy: LinearPolicy, starts: Starts, c: SamconConfig, seed: int, least: float
) -> tuple[Trials, float, Starts | None]:
    """Trials of a policy, its score, and where it can be started from if that is above `least`."""
    trials = run_trials(task, policy, starts, c.check_cycles, seed, c.speed_noise, c.disturbance)
    score = float(trials.lived.mean()) - 0.01 * trials.cost if trials.lived.any() else -1.0
    if score <= least:
        return trials, score, None
    return trials, score, record_starts(task, policy, starts, seed, replace(c.disturbance, push=0.0))


# ------------------------------------------------------------------------------------------------- stage


def about_check(c: SamconConfig) -> str:
    """What `Samcon.check` lets policies stand, for a person."""
    return about_trials(c.trials, f"{c.check_cycles:g} cycles", c.speed_noise, c.disturbance)


def make(context: Context) -> Samcon:
    """The learner of a graph, in worlds shared out among the workers."""
    c: SamconConfig = context.config
    model, graph = locomotion_model(), legs_graph(context.graph)
    tasks, trial_tasks = shared(
        context, lambda worlds, threads: Locomotion(model, graph, worlds, context.device, threads, c.weights)
    )
    return Samcon(tasks, trial_tasks, c, context.seed)


def shared(context: Context, build: Callable[[int, int | None], T]) -> tuple[list[T], list[T]]:
    """The tasks of islands, one for each worker, and those of trials. build: makes one of so many worlds, and
    threads."""
    c: SamconConfig = context.config
    count = max(1, min(context.workers, c.islands))
    threads = None if count == 1 else max(1, usable_cores() // count)
    tasks = [build(c.particles * islands, threads) for islands in shares(c.islands, count)]
    return tasks, [build(c.trials, threads) for _ in range(min(count, TRIED))]


def locomotion_task(context: Context, worlds: int) -> Locomotion:
    graph = legs_graph(context.graph)
    return Locomotion(locomotion_model(), graph, worlds, context.device, weights=context.config.weights)


def learned(context: Context, arrays: dict[str, np.ndarray]) -> LinearPolicy:
    """The policy in a result. Raises InputError for one of a task that steers or feels something else."""
    policy = LinearPolicy.of(arrays)
    if policy.M.shape[1:] != (STEERED, FELT):
        reason = (
            f"an older version learned it: it feels {policy.M.shape[2]} numbers, not {FELT}; learn it anew"
        )
        raise InputError(reason, "", "out")
    return policy


STAGE = Stage(
    name="locomotion",
    about="to stay up and follow the motion, without the ball",
    config=SamconConfig,
    make=make,
    controller=learned,
    task=locomotion_task,
    check=about_check,
)
