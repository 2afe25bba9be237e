"""Trajectory optimisation by sequential Monte Carlo, one long walk that learns while it goes.

Particles, one world each, walk on through the cycle; after every fragment the worse part gives way to copies
of the better, and an action is worth the number of descendants it has a little later: that is the look-ahead
without which sampling cannot dribble (P1 5). After every cycle the policy that they draw from is regressed
anew on the actions with descendants, those of earlier cycles counting less and less, and the path that all
living particles share is what has been found. Being one walk it needs to know only the states that it comes
through itself: a few cycles do.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace

import numpy as np

from ..arrays import Arrays, above, below
from ..choose import Ahead
from ..policies.em import Moments, descendants, improve, select
from ..policies.linear import Explore, LinearPolicy
from ..rollout import Rollout
from ..runs.stage import Report
from ..starts import Starts, Streams
from ..tasks.arms import Arms, OutOfTime
from .optimised import Optimised

PATIENCE = 3
"""Times that a cycle is tried again before the walk begins anew, with what was learned."""


@dataclass(frozen=True)
class SmcConfig:
    """Parameters of the walk."""

    particles: int = 256
    """worlds"""
    keep: float = 0.5
    """share of them that have children"""
    lag: int = 16
    """fragments after which descendants are counted"""
    sigma: float = 0.15
    """[rad] exploration at first"""
    least_sigma: float = 0.03
    """[rad] and at least"""
    open_loop: int = 2
    """cycles at first that learn offsets only"""
    forget: float = 0.7
    """what the cycles before count, from cycle to cycle"""
    settled: int = 5
    """cycles after which fingers count in full; before, the ball's way counts more"""
    near: float = 0.01
    """[m] distance of the fingers beyond which they count less until then"""
    ridge: float = 0.02
    """pull of the feedback to what it was, per unit of state variance"""
    doubt: float = 20.0
    """pull to what it was, in samples"""


@dataclass
class Progress(Report):
    """One try of a cycle in numbers."""

    cost: float
    """mean over the particles that stand"""
    cycles: int
    """found so far"""
    fingers: float
    """[cm] mean distance from the ball in H, in the last cycle that was found; NaN before"""
    offsets: float
    """mean length of the offsets of an arm that acts on the ball, in that cycle"""
    sigma: float
    """[rad] mean exploration"""
    samples_per_second: float
    """fragments simulated per second of everything"""
    outside: float
    """share of the time that is not simulation"""


@dataclass
class Rows:
    """Fragments that all particles have gone through, and that are not decided yet."""

    obs: list[np.ndarray] = field(default_factory=list)
    """(particles, obs) each"""
    action: list[np.ndarray] = field(default_factory=list)
    """(particles, actions)"""
    k: list[int] = field(default_factory=list)
    parent: list[np.ndarray] = field(default_factory=list)
    """(particles,) whose copy each one became after it"""
    joint_q: list[np.ndarray] = field(default_factory=list)
    """(particles, nq) where it began"""
    joint_qd: list[np.ndarray] = field(default_factory=list)
    fingers: list[np.ndarray] = field(default_factory=list)
    """(particles,) [m]"""

    def __len__(self) -> int:
        return len(self.k)

    def first(self, count: int) -> Rows:
        return Rows(*(rows[:count] for rows in vars(self).values()))

    def after(self, count: int) -> Rows:
        return Rows(*(rows[count:] for rows in vars(self).values()))


class Smc:
    """Learns a trajectory of so many cycles; everything that its future depends on is in `state`. start: a
    state of the reference in which a hand has the ball."""

    def __init__(self, task: Arms, config: SmcConfig, cycles: int, tries: int, start: Starts, seed: int = 0):
        if task.worlds != config.particles:
            raise ValueError(f"the task needs {config.particles} worlds, one for each particle")
        self.task, self.config, self.seed, self.start = task, config, seed, start
        self.cycles, self.tries = cycles, tries
        self.policy = LinearPolicy.zero(task.graph.count, task.actions, task.obs, config.sigma)
        none = np.zeros(0)
        n, m = task.obs, task.actions
        self.moments = Moments.of(
            np.zeros((0, n)), np.zeros((0, m)), none.astype(int), none, task.graph.count
        )
        self.iteration, self.learned, self.lost, self.late = 0, 0, 0, False
        self._begin()

    def until(self, late: Callable[[], bool]) -> None:
        """Walk only until `late` says true, which is asked all the time: a cycle that is not found by then is
        given up (`late`)."""
        self.late = False
        self.task.late = late

    @property
    def done(self) -> bool:
        return self.late or self.found_cycles >= self.cycles or self.iteration >= self.tries

    @property
    def found_cycles(self) -> int:
        return len(self.found) // self.task.graph.cycle

    def _begin(self) -> None:
        """The walk begins at the start, all particles alike."""
        each = Starts(*(np.repeat(x[:1], self.task.worlds, axis=0) for x in vars(self.start).values()))
        self.rollout = Rollout(self.task, _Nobody(), Ahead(), each)
        self.rows, self.found = Rows(), _nothing(self.task)
        self._keep()

    def _keep(self) -> None:
        """Where to go back to."""
        self.kept = self.task.snapshot() | {"k": np.array(self.rollout.k)}

    def _back(self) -> None:
        """To there; to the start where that has not helped."""
        self.lost += 1
        if self.lost > PATIENCE:
            self.lost = 0
            self._begin()
        else:
            self._recall()

    def _recall(self) -> None:
        self.task.recall(self.kept)
        self.rollout.k = np.array(self.kept["k"])

    def iterate(self) -> Progress:
        """Try a cycle further."""
        task, c, began = self.task, self.config, time.perf_counter()
        samples, simulating = task.samples, task.simulating
        task.near = np.inf if self.found_cycles >= c.settled else c.near
        streams = Streams([np.random.default_rng((self.seed, self.iteration))], group=c.particles)
        self.rollout.controller = Explore(self.policy, streams)
        costs: list[float] = []
        try:
            rows, costs = self._walk()
            self._further(rows)
        except OutOfTime:
            self.late = True
            self._recall()
        seconds = time.perf_counter() - began
        whole = self.found_cycles
        fingers, offsets = np.nan, np.nan
        if whole:
            last = Optimised(*(x[-task.graph.cycle :] for x in vars(self.found).values()))
            fingers = 100.0 * float(np.nanmean(last.fingers))
            offsets = float(last.offsets(task.active[last.k]).mean())
        return Progress(
            iteration=self.iteration,
            fresh=self.done or self.iteration % 20 == 0,
            cost=float(np.mean(costs)) if costs else np.nan,
            cycles=whole,
            fingers=fingers,
            offsets=offsets,
            sigma=float(self.policy.sigma.mean()),
            samples_per_second=(task.samples - samples) / seconds,
            outside=1.0 - (task.simulating - simulating) / seconds,
        )

    def _further(self, rows: Rows) -> None:
        """After a try of a cycle."""
        self.iteration += 1
        if len(rows) < self.task.graph.cycle:
            self._learn(rows)
            self._back()
            return
        self.lost = 0
        self.rows = Rows(*(a + b for a, b in zip(vars(self.rows).values(), vars(rows).values())))
        self._decide(max(0, len(self.rows) - self.config.lag))
        self._keep()

    def _walk(self) -> tuple[Rows, list[float]]:
        """A cycle's fragments, or those until all particles are lost, and the mean cost of each."""
        task, rows, costs = self.task, Rows(), []
        home = task.sim.joint_q, task.sim.joint_qd
        for fragment in self.rollout.fragments(task.graph.cycle):
            parent, lost = select(fragment.cost[None], self.config.keep)
            if lost[0]:
                break
            seen = (fragment.obs, fragment.action, int(fragment.k[0]), parent[0], *home, task.fingers)
            for row, value in zip(vars(rows).values(), seen):
                row.append(value)
            costs.append(float(np.mean(fragment.cost[~fragment.failed])))
            self.rollout.become(parent[0])
            home = task.sim.joint_q, task.sim.joint_qd
        return rows, costs

    def _learn(self, rows: Rows, count: int | None = None) -> None:
        """M-step, with the first `count` of rows; of a lost walk those whose descendants lived on for half of
        the lag, or of the walk, where that is shorter."""
        c, task = self.config, self.task
        lost = count is None
        lag = min(c.lag, len(rows)) // 2 if lost else c.lag
        count = max(0, len(rows) - lag) if count is None else count
        if not count:
            return
        W = descendants(np.stack(rows.parent), lag)[:count]
        S, A = (np.concatenate(x[:count]) for x in (rows.obs, rows.action))
        each = np.repeat(rows.k[:count], task.worlds)
        seen = Moments.of(S, A, each, W.ravel(), task.graph.count)
        self.moments = self.moments.scaled(c.forget) + seen
        sigma = self.policy.sigma
        self.policy = improve(self.policy, self.moments, c, self.learned >= c.open_loop)
        if lost:
            self.policy.sigma = sigma  # few ancestors are left of it: that they agree says nothing
        else:
            self.learned += 1

    def _decide(self, count: int) -> None:
        """The first `count` rows are decided: learn from them, and keep the ancestor that most particles
        descend from; the others become copies of those that do."""
        if not count:
            return
        rows = self.rows
        self._learn(rows, count)
        line = np.arange(self.task.worlds)
        for parent in rows.parent[: count - 1 : -1]:
            line = parent[line]
        # line: each particle's ancestor after the first `count` rows
        chosen = int(np.argmax(np.bincount(line)))
        own = np.flatnonzero(line == chosen)
        sources = np.where(line == chosen, np.arange(len(line)), own[np.arange(len(line)) % len(own)])
        self.rollout.become(sources)
        rows.parent[-1] = rows.parent[-1][sources]
        path = []
        for parent in rows.parent[count - 1 :: -1] if count else []:
            chosen = int(parent[chosen])
            path.append(chosen)
        p, r = np.array(path[::-1]), range(count)
        new = Optimised(
            k=np.array(rows.k[:count]),
            action=np.array([rows.action[i][p[i]] for i in r]),
            joint_q=np.array([rows.joint_q[i][p[i]] for i in r]),
            joint_qd=np.array([rows.joint_qd[i][p[i]] for i in r]),
            fingers=np.array([rows.fingers[i][p[i]] for i in r]),
        )
        new = replace(new, action=np.where(self.task.active[new.k], new.action, 0.0))
        self.found = Optimised.joined([self.found, new])
        self.rows = rows.after(count)

    @property
    def result(self) -> Arrays | None:
        """The trajectory; None before the first whole cycle."""
        return self.found.result if self.found_cycles else None

    @property
    def state(self) -> Arrays:
        """Arrays by name, from which `restore` goes on exactly as this object would."""
        arrays = above(
            policy=self.policy.arrays,
            moments=vars(self.moments),
            found=self.found.arrays,
            kept=self.kept,
            rows={name: np.array(values) for name, values in vars(self.rows).items()},
        )
        return arrays | {name: np.array(getattr(self, name)) for name in COUNTS}

    def restore(self, state: Arrays) -> None:
        """Go on from what `state` was."""
        self.policy = LinearPolicy.of(below("policy", state))
        self.moments = Moments(**below("moments", state))
        self.found = Optimised(**below("found", state))
        if self.policy.M.shape[1:] != (self.task.actions, self.task.obs):
            raise ValueError(f"policy.M has the shape {self.policy.M.shape}")
        self.rows = Rows(**{name: list(values) for name, values in below("rows", state).items()})
        self.rows.k = [int(k) for k in self.rows.k]
        for name in COUNTS:
            setattr(self, name, int(state[name]))
        self.kept = below("kept", state)
        self._recall()


COUNTS = ("iteration", "learned", "lost")


class _Nobody:
    """Before the first cycle nobody acts."""

    def act(self, obs: np.ndarray, k: np.ndarray) -> np.ndarray:
        raise AssertionError("the walk has no policy yet")


def _nothing(task: Arms) -> Optimised:
    model = task.model
    widths = {"action": (task.actions,), "joint_q": (model.nq,), "joint_qd": (model.nv,)}
    shapes = {f.name: (0, *widths.get(f.name, ())) for f in fields(Optimised)}
    return Optimised(
        **{name: np.zeros(shape, int if name == "k" else float) for name, shape in shapes.items()}
    )
