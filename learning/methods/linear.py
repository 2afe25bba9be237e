"""Linear arm policies (P1 5.2): what trajectory optimisation found, regressed on the states that it came
through; and, as that is the weak point of the published way, more of it in closed loop.

The first iteration is the paper's: a ridge regression for each fragment, the first cycles dropped. Every
later one is an iteration of expectation maximisation (`em`, as for locomotion): islands of particles that the
policy leads, from the states of the trajectory, disturbed a little, and then from those that it comes through
itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Arrays
from ..ball.optimised import Optimised, observed, states_of
from ..policies.linear import LinearPolicy
from ..runs.stage import Context, Stage, known
from ..starts import Starts
from ..tasks.arms import STATES, Arms, BallWeights
from ..tasks.disturbance import CALM, Disturbance
from . import samcon
from .ball import STAGE as BALL
from .ball import felt
from .kept import Kept
from .samcon import Samcon, SamconConfig, shared


@dataclass(frozen=True)
class LinearConfig(SamconConfig):
    """Parameters of the regression, and of what follows it."""

    iterations: int = 30
    """the first is the paper's regression"""
    islands: int = 8
    particles: int = 128
    keep: float = 0.5
    walk: int = 112
    lag: int = 16
    sigma: float = 0.05
    least_sigma: float = 0.02
    open_loop: int = 0
    speed_noise: float = 0.1
    disturbance: Disturbance = CALM
    check_every: int = 5
    check_cycles: int = 50
    trials: int = 64
    state: str = "reduced"
    """what the policy feels, one of `tasks.arms.STATES`"""
    drop: int = 20
    """cycles at the beginning that do not count (P1 7.1)"""
    first_ridge: float = 1e-4
    """of the regression, per unit of state variance"""
    cost: BallWeights = field(default=BallWeights())


def regressed(
    found: Optimised, obs: np.ndarray, fragments: int, drop: int, ridge: float, sigma: float
) -> LinearPolicy:
    """The policy (P1 5.2) that does in the states obs (n, S) what was found there. drop: fragments at the
    beginning that do not count; all count where there are not twice as many. ridge: per unit of variance."""
    policy = LinearPolicy.zero(fragments, found.action.shape[1], obs.shape[1], sigma)
    first = drop if len(found) >= 2 * drop else 0
    for k in range(fragments):
        rows = first + np.flatnonzero(found.k[first:] == k)
        if not len(rows):
            continue
        s, a = obs[rows], found.action[rows]
        mean_s, mean_a = s.mean(axis=0), a.mean(axis=0)
        s, a = s - mean_s, a - mean_a
        policy.M[k] = np.linalg.solve(s.T @ s / len(s) + ridge * np.eye(s.shape[1]), s.T @ a / len(s)).T
        policy.a_hat[k] = mean_a - policy.M[k] @ mean_s
    return policy


def begun(
    task: Arms, found: Optimised, cycles: int, ridge: float, sigma: float
) -> tuple[LinearPolicy, Starts]:
    """What learners of arm policies begin with: the regression of a trajectory on what the task feels in its
    states, and these states, without those of the first `cycles`, unless there are not twice as many."""
    states, drop = states_of(task, found), cycles * task.graph.cycle
    policy = regressed(found, observed(task, states), task.graph.count, drop, ridge, sigma)
    first = drop if len(found) >= 2 * drop else 0
    return policy, states[first:]


class Linear(Samcon):
    """Learns a linear arm policy from a trajectory."""

    def __init__(
        self,
        tasks: Sequence[Arms],
        trial_tasks: Sequence[Arms],
        config: LinearConfig,
        found: Optimised,
        seed: int = 0,
    ):
        super().__init__(tasks, trial_tasks, config, seed)
        self.found, task, c = found, tasks[0], config
        self.policy, states = begun(task, found, c.drop, c.first_ridge, c.sigma)
        self.mean, self.starts = self.policy.copy(), states
        self.best = Kept(self.policy.copy(), states)

    def iterate(self) -> samcon.Progress:
        """The first: try what the regression gave. Later ones: see `Samcon`."""
        if self.iteration:
            return super().iterate()
        return self.tried()


def make(context: Context) -> Linear:
    """The learner of a graph, in worlds shared out among the workers."""
    c: LinearConfig = context.config
    known(c, state=STATES)
    found = Optimised.of(context.needs[BALL.name])
    tasks, trial_tasks = shared(context, lambda worlds, threads: felt(context, worlds, threads))
    return Linear(tasks, trial_tasks, c, found, context.seed)


def learned(context: Context, arrays: Arrays) -> LinearPolicy:
    """The policy in a result."""
    return LinearPolicy.of(arrays)


STAGE = Stage(
    name="linear",
    about="a linear policy of arms and fingers that keeps the ball",
    config=LinearConfig,
    make=make,
    controller=learned,
    task=felt,
    ball=True,
    needs=(samcon.STAGE.name, BALL.name),
    uses=(samcon.STAGE.name,),
    check=samcon.about_check,
)
