"""Guided SAMCON: linear feedback policies from a reference motion, by expectation maximisation (Liu et al.
2016; P1 3.3). docs/locomotion.md derives it and says what differs from the paper.

E-step, `walk`: sequential Monte Carlo along a random walk through the control graph. Particles, one world
each, try actions drawn from the policy; after every fragment the worse part gives way to copies of the
better. An action is worth the number of descendants it has a little later.

M-step, `improve`: weighted ridge regression of the actions that had descendants on the states they were
taken in.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace

import numpy as np

from ..evaluate.trials import States, record_states, reference_states, run_trials
from ..policies.linear import LinearPolicy
from ..tasks.disturbance import Disturbance, Disturber
from ..tasks.locomotion import Locomotion

SAVE_EVERY = 5
"""Fragments between states to go back to, and between recorded ones."""
BACK, FARTHEST = 10, 50
"""Fragments to go back by when all particles have fallen: the first time, and at most."""
RETRIES = 4
"""Times that a walk goes back before it is given up."""
SETTLED = 20
"""Fragments after which the states of a walk are typical of the policy."""


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
    sigma: float = 0.2
    """[rad] exploration at first"""
    least_sigma: float = 0.08
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


@dataclass
class Walk:
    """What the E-step saw, a row per fragment."""

    S: list = field(default_factory=list)
    """states (particles, 18)"""
    A: list = field(default_factory=list)
    """actions (particles, 11) [rad]"""
    k: list = field(default_factory=list)
    """fragments (particles,)"""
    E: list = field(default_factory=list)
    """costs (particles,)"""
    parent: list = field(default_factory=list)
    """which particle's copy each one is, after the fragment"""
    states: list = field(default_factory=list)
    """(row, k, joint_q, joint_qd) of the best particle of each island, now and then"""
    falls: int = 0
    """islands that lost all particles"""
    retreats: int = 0
    """times that all did"""
    whole: bool = False
    """The walk came to its end."""

    def __len__(self) -> int:
        return len(self.S)

    def add(self, S, A, k, E, parent) -> None:
        for rows, values in zip((self.S, self.A, self.k, self.E, self.parent), (S, A, k, E, parent)):
            rows.append(values)

    def cut(self, row: int) -> None:
        """Forget everything from a row on."""
        for rows in (self.S, self.A, self.k, self.E, self.parent):
            del rows[row:]
        self.states = [state for state in self.states if state[0] < row]


class Trail:
    """States of a walk to go back to."""

    def __init__(self, task: Locomotion):
        self._task, self._saved, self._back, self._failed = task, [], BACK, 0

    def mark(self, row: int, k: np.ndarray, felt: np.ndarray) -> None:
        """A fragment begins."""
        if row > self._failed:
            self._back = BACK
        if row % SAVE_EVERY == 0:
            oldest = -(FARTHEST // SAVE_EVERY)
            self._saved = [*self._saved[oldest:], (row, self._task.sim.snapshot(), k, felt)]

    def retreat(self, row: int) -> tuple[int, np.ndarray, np.ndarray]:
        """Go back from a row, farther each time until it has been passed; row, k and what is felt there."""
        self._failed = max(self._failed, row)
        while len(self._saved) > 1 and self._saved[-1][0] > row - self._back:
            self._saved.pop()
        self._back = min(2 * self._back, FARTHEST)
        row, snapshot, k, felt = self._saved.pop()
        self._task.sim.restore(snapshot)
        return row, k, felt


def walk(task: Locomotion, policy: LinearPolicy, config: SamconConfig, starts: States, random) -> Walk:
    """E-step: particles along a random walk, as many islands as have starts."""
    islands, particles = len(starts), config.particles
    k = np.repeat(starts.k, particles)
    felt = task.reset(k, *(np.repeat(x, particles, axis=0) for x in (starts.joint_q, starts.joint_qd)))
    disturber = Disturber(config.disturbance, task, random, group=particles)
    seen, trail = Walk(), Trail(task)
    while len(seen) < config.walk:
        row = len(seen)
        trail.mark(row, k, felt)
        disturber.apply()
        s = task.state(felt, k)
        a = policy.sample(s, k, random)
        felt = task.advance(k, a)
        E = task.cost(felt, k)
        parent, fallen = select(E.reshape(islands, -1), config.keep, random)
        seen.falls += fallen
        if fallen == islands:
            seen.retreats += 1
            if seen.retreats > RETRIES:
                break
            row, k, felt = trail.retreat(row)
            seen.cut(row)
            continue
        seen.add(s, a, k, E, parent)
        task.sim.copy_worlds(parent)
        felt = felt[parent]
        k = np.repeat(task.graph.follow(k[parent][::particles], random), particles)
        if row % SAVE_EVERY == SAVE_EVERY - 1:
            best = np.arange(islands) * particles + np.argmin(E[parent].reshape(islands, -1), axis=1)
            seen.states.append((row, k[best], task.sim.joint_q[best], task.sim.joint_qd[best]))
    task.calm()
    seen.whole = len(seen) == config.walk
    return seen


def select(E: np.ndarray, keep: float, random) -> tuple[np.ndarray, int]:
    """The particle (n,) whose copy each one becomes, and how many islands have none left; E: costs (islands,
    particles). The best `keep` of an island stay; the others become copies of them, of the best first; an
    island without survivors becomes like another one."""
    islands, particles = E.shape
    order = np.argsort(E, axis=1, kind="stable")
    alive = np.minimum(np.isfinite(E).sum(axis=1), max(1, round(keep * particles)))
    lost = np.flatnonzero(alive == 0)
    home = np.arange(islands)
    if len(lost) < islands:
        home[lost] = random.choice(np.flatnonzero(alive), len(lost))
    child = np.arange(particles) % np.maximum(alive[home], 1)[:, None]
    parent = np.empty((islands, particles), int)
    parent[np.arange(islands)[:, None], order] = home[:, None] * particles + order[home[:, None], child]
    return parent.ravel(), len(lost)


def descendants(parent: list, lag: int, end: int) -> list[np.ndarray]:
    """For each of the first `end` rows, how many particles `lag` rows later descend from each one."""
    counts = []
    for row in range(end):
        line = np.arange(len(parent[0]))
        for later in reversed(parent[row : row + lag + 1]):
            line = later[line]
        counts.append(np.bincount(line, minlength=len(line)))
    return counts


def improve(policy: LinearPolicy, seen: Walk, config: SamconConfig, feedback: bool) -> LinearPolicy:
    """M-step: the policy that makes the actions with descendants likely, near the old one.

    With weights w that sum to one, means s_, a_ and residuals about them, M solves
    min sum w |a - M s|^2 + (ridge + doubt / n) |M - M_old|^2, n = 1 / sum w^2; then
    a_hat = a_ - M s_ and sigma^2 is the mean of the old one and the residuals'. Without feedback only
    a_hat moves.
    """
    new = policy.copy()
    end = len(seen) if seen.whole else max(len(seen) - config.lag, 0)
    if end == 0:
        return new
    W = np.concatenate(descendants(seen.parent, config.lag, end))
    used = W > 0
    S, A, ks = (np.concatenate(rows[:end])[used] for rows in (seen.S, seen.A, seen.k))
    W = W[used].astype(float)
    for k in np.unique(ks):
        s, a, w = (x[ks == k] for x in (S, A, W))
        w = w / w.sum()
        n = 1.0 / np.sum(w**2)
        mean_s, mean_a = w @ s, w @ a
        if not feedback:
            new.a_hat[k] += n / (n + 5.0) * (mean_a - policy.a_hat[k])
            continue
        s, a = s - mean_s, a - mean_a
        pull = (config.ridge + config.doubt / n) * np.eye(s.shape[1])
        new.M[k] += np.linalg.solve((s.T * w) @ s + pull, (s.T * w) @ (a - s @ policy.M[k].T)).T
        new.a_hat[k] = mean_a - new.M[k] @ mean_s
        spread = w @ (a - s @ new.M[k].T) ** 2
        new.sigma[k] = np.sqrt(np.maximum(0.5 * policy.sigma[k] ** 2 + 0.5 * spread, config.least_sigma**2))
    return new


@dataclass
class Progress:
    """One iteration in numbers."""

    iteration: int
    cost: float
    """mean over the particles that stand"""
    length: int
    """fragments of the walk"""
    falls: int
    """islands that lost all particles"""
    sigma: float
    """[rad] mean exploration"""
    score: float
    """of the best policy so far; see `Samcon.check`"""
    survived: float
    """share of the trials that the present policy lasted; NaN where it was not tried"""
    samples_per_second: float
    """fragments simulated per second of everything"""
    outside: float
    """share of the time that is not simulation"""


class Samcon:
    """Learns a policy for a task; everything that its future depends on is in `saved`."""

    def __init__(self, task: Locomotion, trial_task: Locomotion, config: SamconConfig, seed: int = 0):
        if task.sim.world_count != config.islands * config.particles:
            raise ValueError(
                f"the task needs {config.islands * config.particles} worlds, a world per particle"
            )
        self.task, self.trial_task, self.config, self.seed = task, trial_task, config, seed
        self.random = np.random.default_rng(seed)
        self.policy = task.open_loop(config.sigma)
        self.mean = self.policy.copy()
        self.best = self.policy.copy()
        self.best_score = -np.inf
        self.iteration = 0
        self.states = reference_states(task.graph)
        self.best_states = self.states

    def iterate(self) -> Progress:
        """One E-step and M-step; the policies are tried now and then."""
        began, before = time.perf_counter(), self._spent
        c = self.config
        starts = self.states.draw(c.islands, self.random, c.speed_noise)
        seen = walk(self.task, self.policy, c, starts, self.random)
        feedback = self.iteration >= c.open_loop
        self.policy = improve(self.policy, seen, c, feedback)
        self.mean = self.policy.moved(self.mean, c.average if feedback else 0.0)
        if seen.whole:
            self._record(seen)
        self.iteration += 1
        survived = np.nan
        if self.iteration % c.check_every == 0 or self.iteration == c.iterations:
            survived = self.check()
        E = np.concatenate(seen.E) if len(seen) else np.zeros(0)
        seconds = time.perf_counter() - began
        samples, simulating = np.subtract(self._spent, before) / seconds
        return Progress(
            iteration=self.iteration,
            cost=float(E[np.isfinite(E)].mean()) if np.isfinite(E).any() else np.nan,
            length=len(seen),
            falls=seen.falls,
            sigma=float(self.policy.sigma.mean()),
            score=float(self.best_score),
            survived=survived,
            samples_per_second=float(samples),
            outside=float(1.0 - simulating),
        )

    @property
    def _spent(self) -> tuple[float, float]:
        """Fragments simulated so far, and the seconds that the simulation took."""
        tasks = self.task, self.trial_task
        return sum(task.samples for task in tasks), sum(task.simulating for task in tasks)

    def _record(self, seen: Walk) -> None:
        """Take states that the policy comes through as the starts of the next walks."""
        rows = [s for s in seen.states if SETTLED <= s[0] < len(seen) - self.config.lag]
        if rows:
            self.states = States(*(np.concatenate(part) for part in list(zip(*rows))[1:]))

    def check(self) -> float:
        """Try the policy and its running mean under disturbances, and keep the best so far; the share of
        trials that the policy lasted. The score is the share of the trials' time that was survived, less a
        hundredth of the cost."""
        survived = 0.0
        for policy in (self.mean, self.policy):
            trials = run_trials(
                self.trial_task,
                policy,
                self.states,
                cycles=20,
                seed=self.seed,
                speed_noise=self.config.speed_noise,
                disturbance=self.config.disturbance,
            )
            score = trials.lived.mean() - 0.01 * trials.cost if trials.lived.any() else -1.0
            survived = float(trials.survived.mean())
            if score > self.best_score:
                self.best, self.best_score = policy.copy(), score
                unpushed = replace(self.config.disturbance, push=0.0)
                self.best_states = record_states(self.trial_task, policy, self.states, self.seed, unpushed)
        return survived

    def learn(self, progress: Callable[[Progress], None] | None = None) -> LinearPolicy:
        """Iterate to the end; the best policy."""
        while self.iteration < self.config.iterations:
            report = self.iterate()
            if progress:
                progress(report)
        return self.best

    @property
    def saved(self) -> dict[str, np.ndarray]:
        """Arrays by name, from which `resume` goes on exactly as this object would."""
        policies = {"policy": self.policy, "mean": self.mean, "best": self.best}
        arrays = {f"{name}.{x}": v for name, p in policies.items() for x, v in vars(p).items()}
        states = {"states": self.states, "best_states": self.best_states}
        arrays |= {f"{name}.{x}": v for name, s in states.items() for x, v in vars(s).items()}
        random = json.dumps(self.random.bit_generator.state)
        return arrays | {
            "iteration": np.array(self.iteration),
            "best_score": np.array(self.best_score),
            "random": np.array(random),
        }

    def resume(self, state: dict[str, np.ndarray]) -> None:
        """Go on from what was `saved`."""
        for name in ("policy", "mean", "best"):
            setattr(self, name, LinearPolicy(*(state[f"{name}.{f.name}"] for f in fields(LinearPolicy))))
        for name in ("states", "best_states"):
            setattr(self, name, States(*(state[f"{name}.{f.name}"] for f in fields(States))))
        self.iteration, self.best_score = int(state["iteration"]), float(state["best_score"])
        self.random.bit_generator.state = json.loads(str(state["random"]))
