"""Trajectory optimisation by CMA-ES, as P1 5.1 has it (pycma; Hansen 2006); a generation is a batch.

Where the text leaves a choice, this is what is done:

- A ball that is missed at a checkpoint is missed at the later ones, too (N_check), its height counts at the
  checkpoint where it was missed, and what it does later does not count.
- Offsets chi of fingers are from the pose of a hand that waits for the ball, alpha = (0.2, 0.2, 0.2).
- A fall is a bad contact.
- A search has stalled where the least cost has not improved by more than `gain` for so many generations.
- What is kept is the best candidate that keeps the ball in the first window. Where there is none, the window
  is searched anew, from zero and as widely as in the first cycle.
- A generation has pycma's usual size, rounded up so that no lane and no core idles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...sims.errors import InputError
from ...sims.model import Model
from ..graph import STEPS, ControlGraph
from ..tasks.arms import Arms, active_hands
from .cycles import Chosen, Cycles
from .windows import Moment, Tried, actions_of, attempt, windows_of

FAR = 10.0
"""[m] What counts as a distance that is no number."""


@dataclass(frozen=True)
class PaperConfig:
    """Parameters of P1 5.1 and 7.1."""

    offsets: float = 0.1
    """w_chi, weight of the offsets' length [1/rad]"""
    helper: float = 10.0
    """w_E, weight of the helper cost"""
    first_sigma: float = 0.03
    """[rad] at first, in the first cycle"""
    sigma: float = 0.01
    """[rad] and in later ones"""
    generations: int = 1000
    """at most"""
    stalled: int = 200
    """generations without a better candidate, after which a search ends"""
    gain: float = 1e-4
    """what is better, in units of the cost (m of distance)"""
    near: float = 0.01
    """[m] mean distance of the fingers from the ball that is good enough; 0.02 for running"""
    population: int = 0
    """candidates of a generation; 0: pycma's 4 + 3 ln n, rounded up to `multiple`"""
    multiple: int = 16
    searches: int = 3
    """of a window, before it is given up"""


# ----------------------------------------------------------------------------------------------- cost


@dataclass(frozen=True)
class Cost:
    """Eq. 6 of candidates (worlds,)."""

    distance: np.ndarray
    """[m] its first term"""
    length: np.ndarray
    """[rad] mean length of the offsets"""
    helper: np.ndarray
    """Eq. 8"""

    def total(self, c: PaperConfig) -> np.ndarray:
        return np.asarray(self.distance + c.offsets * self.length + c.helper * self.helper)


def cost(tried: Tried, held: np.ndarray, h_ref: np.ndarray, active: np.ndarray) -> Cost:
    """Eq. 6-8. held (fragments,): frames of H, as `Arms` has it; h_ref (fragments,) [m]: what the ball must
    reach at the checkpoint of each, NaN where there is none; active (fragments, 20): X."""
    n, worlds = tried.fingers.shape
    total = len(tried.k)
    stop = np.where(tried.missed.any(axis=0), tried.missed.argmax(axis=0), total)
    frames = (np.arange(n)[:, None] <= stop) * held[tried.k[:n]][:, None]
    D = np.nan_to_num(tried.fingers, nan=FAR, posinf=FAR)
    distance = np.sum(D * frames, axis=0) / np.maximum(frames.sum(axis=0), 1)
    arms = active[tried.k].reshape(total, 2, -1)[:, :, 0]
    chi = np.linalg.norm(tried.action.reshape(total, worlds, 2, -1), axis=3)
    length = np.einsum("nwh,nh->w", chi, arms / max(arms.sum(), 1))
    return Cost(distance, length, _helper(tried, h_ref, stop))


def _helper(tried: Tried, h_ref: np.ndarray, stop: np.ndarray) -> np.ndarray:
    """Eq. 8: 2 N_check + max(h_ref - h_ball, 0) + (T_0 - T_cont) / T_0. stop (worlds,): fragments before the
    one at whose checkpoint the ball is missed."""
    n, worlds = tried.missed.shape
    checks = np.flatnonzero(np.isfinite(h_ref[tried.k]))
    N_check = (checks[:, None] >= stop).sum(axis=0)
    short = np.zeros(worlds)
    if len(checks):  # the last windows of a clip may have none
        at = checks[np.minimum(np.searchsorted(checks, stop), len(checks) - 1)]
        h_ball = np.nan_to_num(tried.height[at, np.arange(worlds)], nan=-FAR)
        short = np.maximum(h_ref[tried.k[at]] - h_ball, 0.0)
    row = np.arange(n)[:, None]
    T_0 = STEPS * len(tried.k)
    T_cont = np.where((tried.trouble >= 0) & (row <= stop), STEPS * row + tried.trouble, T_0).min(axis=0)
    return np.asarray(2.0 * N_check + short + (T_0 - T_cont) / T_0)


def reference_heights(graph: ControlGraph) -> np.ndarray:
    """(fragments,) [m] h_ref at the last checkpoint of each, NaN where there is none."""
    assert graph.checkpoints is not None and graph.heights is not None
    h_ref = np.full(graph.count, np.nan)
    h_ref[np.asarray(graph.checkpoints) // STEPS] = graph.heights
    return h_ref


# --------------------------------------------------------------------------------------------- search


class Candidates(Protocol):
    """What is searched: candidates (m, n) have costs (m,); `good` once the best of them is good enough."""

    good: bool

    def __call__(self, candidates: np.ndarray) -> np.ndarray: ...


def search(
    candidates: Candidates,
    start: np.ndarray,
    sigma: float,
    c: PaperConfig,
    size: int,
    random: np.random.Generator,
) -> int:
    """CMA-ES from N(start, sigma^2), `size` candidates a generation, until the rules of P1 7.1 end it; the
    generations that it took. Raises InputError without pycma."""
    try:
        from cma import CMAEvolutionStrategy
    except ImportError:
        raise InputError("needs the package 'cma': pip install 'warpdribble[learn]'", "", "") from None

    def normal(*shape: int) -> np.ndarray:
        return random.standard_normal(shape)

    quiet = {"verbose": -9, "verb_log": 0, "verb_disp": 0, "seed": np.nan, "randn": normal}
    strategy = CMAEvolutionStrategy(start, sigma, {"popsize": size, **quiet})
    least, better = np.inf, 0
    for generation in range(1, c.generations + 1):
        asked = strategy.ask()
        costs = candidates(np.stack(asked))
        if costs.min() < least - c.gain:
            better = generation
        least = min(least, float(costs.min()))
        if candidates.good or generation - better >= c.stalled:
            break
        strategy.tell(asked, costs.tolist())
    return generation


class Pair:
    """Candidates for windows that are optimised together, and the best of them. k (total,): their fragments,
    of which `count` are the first window's."""

    def __init__(self, task: Arms, begin: Moment, k: np.ndarray, count: int, c: PaperConfig):
        self.task, self.begin, self.k, self.count, self.c = task, begin, k, count, c
        self.h_ref = reference_heights(task.graph)
        self.free = task.active[k]
        """(total, 20) bool: what a candidate says, in this order"""
        self.good = False
        self._best: tuple[Tried, int] | None = None
        self._rank = (True, np.inf)

    def __call__(self, candidates: np.ndarray) -> np.ndarray:
        task = self.task
        tried = attempt(task, self.begin, self.k, actions_of(candidates, self.free), self.count)
        each = cost(tried, task.held, self.h_ref, task.active)
        total = each.total(self.c)
        failed = np.any(tried.failed[: self.count], axis=0)
        world = int(np.lexsort((total, failed))[0])
        rank = bool(failed[world]), float(total[world])
        if rank < self._rank:
            self._rank, self._best = rank, (tried, world)
            self.good = not rank[0] and each.helper[world] == 0.0 and each.distance[world] < self.c.near
        return total

    def chosen(self, later: int) -> Chosen | None:
        """The best candidate that keeps the ball in the first window. later: fragments of the next."""
        if self._best is None or self._rank[0]:
            return None
        (tried, world), count = self._best, self.count
        after = tried.moment(world, count, int(self.k[count]))
        return Chosen(tried.found(world, count), after, tried.action[count : count + later, world].copy())


def optimised(cycles: Cycles, task: Arms, c: PaperConfig) -> Chosen | None:
    """The next window of some cycles, together with the one behind it."""
    parts = [cycles.window(), cycles.window(1)]
    start = np.concatenate([cycles.ahead, cycles.known(parts[1])])
    for again in range(c.searches):
        pair = Pair(task, cycles.begin, np.concatenate(parts), len(parts[0]), c)
        widely = again > 0 or cycles.iteration < len(cycles.windows)
        random = np.random.default_rng((cycles.seed, cycles.iteration, again))
        mean, sigma = start[pair.free] * (again == 0), c.first_sigma if widely else c.sigma
        cycles.rounds += search(pair, mean, sigma, c, task.worlds, random)
        if (chosen := pair.chosen(len(parts[1]))) is not None:
            return chosen
    return None


class Paper(Cycles):
    """Windows two by two, by CMA-ES. task: a world for each candidate, seen closely."""

    def __init__(self, task: Arms, config: PaperConfig, cycles: int = 100, tries: int = 300, seed: int = 0):
        super().__init__([task], cycles, tries, seed)
        self.config = config

    def optimise(self) -> Chosen | None:
        return optimised(self, self.tasks[0], self.config)


def population(model: Model, graph: ControlGraph, c: PaperConfig) -> int:
    """Candidates of a generation."""
    if c.population:
        return c.population
    active, windows = active_hands(model, graph), windows_of(graph)
    most = max(active[a].sum() + active[b].sum() for a, b in zip(windows, [*windows[1:], windows[0]]))
    return -(-(4 + int(3.0 * np.log(most))) // c.multiple) * c.multiple
