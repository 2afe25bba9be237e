"""Trajectory optimisation by damped Gauss-Newton steps on directed errors: each finger tip's way to the ball,
the ball's place and velocity off the reference. One batch of worlds gives all differences, another tries
steps.

Balls that robots juggle come under control by steps along a slope that is kept (Ploeger and Peters 2026,
arXiv 2606.16978). So it is here, from cycle to cycle, until steps no longer help. Where none does, P1's own
search (`paper`) finds the window. What fails a checkpoint, or has a bad contact, is never taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...sims.model import Model
from ..arrays import Arrays
from ..graph import STEPS, ControlGraph
from ..tasks.arms import Arms, active_hands
from ..tasks.fingers import FINGERS
from . import paper
from .cycles import Chosen, Cycles
from .hold import put_out
from .paper import PaperConfig
from .sweeps import SweepConfig, swept
from .windows import Tried, actions_of, attempt, holding, windows_of

LANES = 8
"""Batches are made of whole vectors of worlds."""
STARTS = 4
"""from which a window is begun, the best of which counts"""
POOR = 2
"""cycles in which a window that is not fair is found in other ways, too"""
TINY = 1e-6
"""[m]"""
WORST = 1.0e3
"""What an error counts as that is no number."""


@dataclass(frozen=True)
class NewtonConfig:
    """Parameters; the first are the deviations that count as one."""

    tip: float = 0.03
    """[m] of a finger tip from the ball, in H"""
    ball: float = 0.1
    """[m] of the ball from its reference, seen from the player"""
    speed: float = 0.6
    """[m/s] of its velocity"""
    last: float = 5.0
    """how much more ball and hands count where the window ends"""
    hand: float = 0.1
    """[m] of a hand from its reference, there"""
    room: float = 0.005
    """[m] of what is missing to `clear`"""
    clear: float = 0.003
    """[m] from a forearm to the ball"""
    offset: float = 1.0
    """[rad] of an offset"""
    change: float = 0.5
    """[rad] of an offset from that of the fragment before"""
    step: float = 0.01
    """[rad] of the differences"""
    damping: tuple[float, ...] = (1e-4, 1e-3, 1e-2, 0.1, 0.3, 1.0, 10.0, 100.0)
    """of the mean of the squared slopes, that are tried"""
    lengths: tuple[float, ...] = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0, 1.3)
    """of each step, that are tried"""
    gain: float = 0.02
    """share by which a step must lower the cost, to be one"""
    enough: float = 2.0
    """A window is done at this multiple of the least cost that it ever had."""
    good: float = 0.05
    """or at this cost"""
    loose: float = 1.0
    """A clip's window is done at this cost, as its ball may be inferred."""
    fair: float = 0.3
    """A first window that costs more is begun in other ways, too."""
    steps: int = 40
    """of a descent, at most"""
    part: int = 4
    """fragments at a time, where a whole window is too much at once"""
    beyond: int = 4
    """fragments behind a clip's window that are found along with it, and then anew, and as many more as it
    takes until a hand has the ball: a way that keeps the ball so far may lead nowhere"""
    sweeps: SweepConfig = field(default=SweepConfig())
    """where no step leads to a window that keeps the ball"""
    search: PaperConfig = field(default=PaperConfig())
    """where sweeps do not either"""


@dataclass(frozen=True)
class Point:
    """A candidate and what became of it."""

    x: np.ndarray
    """(n,)"""
    errors: np.ndarray
    """(m,)"""
    keeps: bool
    """the ball, through the whole window"""
    tried: Tried
    world: int

    @property
    def cost(self) -> float:
        return float(self.errors @ self.errors)

    @property
    def rank(self) -> tuple[bool, float]:
        return not self.keeps, self.cost


class Newton(Cycles):
    """Windows one by one. few, steps, slopes: tasks of as many worlds as starts, steps and differences are
    tried at once, seen closely. searches: where no step leads to the ball, `paper` may."""

    def __init__(
        self,
        few: Arms,
        steps: Arms,
        slopes: Arms,
        config: NewtonConfig,
        cycles: int = 100,
        tries: int = 300,
        seed: int = 0,
        searches: bool = True,
    ):
        super().__init__([few, steps, slopes], cycles, tries, seed)
        self.config, self.searches = config, searches
        self.goal = few.goal.copy()
        """(fragments, p) what the task feels where the reference ends each, with the ball in hand where a
        window does; in a clip, whose holds are long and whose ball may be inferred, out of the body, too"""
        graph = few.graph
        assert graph.touch is not None
        if graph.ends:
            held = np.array([holding(graph, k).any() for k in range(1, graph.count)] + [False])
            held &= np.isin(np.arange(graph.count), np.concatenate(self.windows))
            hands = graph.touch.reshape(graph.count, STEPS, 2)[held, -1]
            self.goal[held] = few.feels(put_out(few.model, graph.goal_q[held], hands), graph.goal_qd[held])
            ball = few.columns["ball"]
            for task in self.tasks:
                task.goal[held, ball] = self.goal[held, ball]
        for k in self.windows:
            after = int(graph.follow(k[-1:])[0])
            if after != k[-1] and (holding(graph, after).any() or not graph.ends):
                self.goal[k[-1]] = self.in_hand(after).felt
        self.last = np.zeros_like(self.mean)
        """(fragments, 20) what was found last"""
        self.slopes: dict[int, np.ndarray] = {}
        """of each window (errors, n)"""
        self.least = np.full(len(self.windows), np.inf)
        """of each window: the least cost so far"""

    def optimise(self) -> Chosen | None:
        number = self.iteration % len(self.windows)
        for k in with_beyond(self.tasks[0].graph, self.window(), self.config):
            at, slope = self._found(k)
            if at.keeps:
                break
        chosen = None
        if at.keeps:
            chosen = self._chosen(at)
        elif self.searches:
            chosen = paper.optimised(self, self.tasks[1], self.config.search)
        if chosen is not None:
            least, self.last = self.least.copy(), self.last.copy()
            if at.keeps:
                least[number] = min(least[number], at.cost)
                if not self.tasks[0].graph.ends:  # a clip's windows do not come again
                    slope = self._slope(k, at) if slope is None else slope
                    self.slopes = self.slopes | {number: slope}
                self.last[k] = at.tried.action[:, at.world]
            self.least, self.last[chosen.found.k] = least, chosen.found.action
            chosen = replace(chosen, ahead=self.last[self.window(1)])
        return chosen

    def _found(self, k: np.ndarray) -> tuple[Point, np.ndarray | None]:
        """The best way through fragments k, which begin with the next window, and the slope there, where it
        is known."""
        self.room = self.config.room
        number, first = self.iteration % len(self.windows), self.iteration < len(self.windows)
        if self.tasks[0].graph.ends and (action := self._swept(k)) is not None:
            at = self._best(self.tasks[0], k, action[self.active[k]][None])
            at, slope = self._descend(k, at, None, self.config.loose)
            if at.keeps:
                return at, slope
        ahead, mean = self.last[k], self.mean[k]
        starts = np.stack([ahead, mean, self.known(k), 0.5 * (ahead + mean)])
        at = self._best(self.tasks[0], k, starts[:, self.active[k]])
        enough = self.config.good if first else max(self.config.good, self.config.enough * self.least[number])
        at, slope = self._descend(k, at, self.slopes.get(number), enough)
        if at.keeps and at.cost > self.config.fair and self.iteration < POOR * len(self.windows):
            other = self._by_parts(k, np.zeros_like(starts[0]))
            at, slope = min((at, slope), other, key=lambda one: one[0].rank)
        for room in (self.config.room, np.inf):  # what keeps clear may also keep from getting there
            if not at.keeps:
                self.room = room
                at, slope = self._by_parts(k, starts[0])
        self.room = self.config.room
        if not at.keeps and (action := self._swept(k)) is not None:
            at = self._best(self.tasks[0], k, action[self.active[k]][None])
            at, slope = self._descend(k, at, None, enough)
        return at, slope

    def _descend(
        self, k: np.ndarray, at: Point, slope: np.ndarray | None, enough: float
    ) -> tuple[Point, np.ndarray | None]:
        """From a candidate for fragments k down to where the ball is kept and the cost `enough`, or no step
        helps any more; and the slope there, or thereabouts, where it is known. slope: one to try before a new
        one is taken."""
        c, fresh = self.config, False
        for _ in range(c.steps):
            if slope is None:
                slope, fresh = self._slope(k, at), True
            elif at.keeps and at.cost <= enough:
                break
            to = self._best(self.tasks[1], k, at.x + steps_down(slope, at.errors, c.damping, c.lengths))
            if to.rank < at.rank and (to.keeps > at.keeps or to.cost < (1.0 - c.gain) * at.cost):
                slope = corrected(slope, to.x - at.x, to.errors - at.errors)
                at, fresh = to, False
            elif fresh:
                break
            else:
                slope = None
        return at, slope

    def _by_parts(self, k: np.ndarray, action: np.ndarray) -> tuple[Point, np.ndarray | None]:
        """The same for the first fragments of a window, then for more and more of them: what happens late
        says little while the ball is lost early."""
        x = np.zeros(0)
        ends = [*range(self.config.part, len(k), self.config.part), len(k)]
        for begin, end in zip([0, *ends], ends):
            x = np.concatenate([x, action[begin:end][self.active[k[begin:end]]]])
            at = self._best(self.tasks[0], k[:end], x[None])
            at, slope = self._descend(k[:end], at, None, self.config.good)
            x = at.x
            if not at.keeps:
                break
        return replace(at, keeps=at.keeps and end == len(k)), slope

    def _swept(self, k: np.ndarray) -> np.ndarray | None:
        """A way that sweeps of particles find."""
        random = np.random.default_rng((self.seed, self.iteration, 1))
        task = self.tasks[2]
        start = self.last[k] if task.graph.ends else np.zeros_like(self.known(k))
        return swept(task, self.begin, k, start, self.config.sweeps, random)

    def _chosen(self, at: Point) -> Chosen:
        count = len(self.window())
        after = at.tried.moment(at.world, count, int(self.window(1)[0]))
        return Chosen(at.tried.found(at.world, count), after, at.tried.action[:count, at.world])

    def _try(self, task: Arms, k: np.ndarray, candidates: np.ndarray) -> tuple[Tried, np.ndarray]:
        """Candidates (m, n) for fragments k, and the errors (worlds, e) of each; the last of them again in
        what worlds are left."""
        rows = np.minimum(np.arange(task.worlds), len(candidates) - 1)
        self.rounds += 1
        count = min(len(k), len(self.window()))
        tried = attempt(task, self.begin, k, actions_of(candidates[rows], self.active[k]), count)
        return tried, self._errors(tried, candidates[rows])

    def _best(self, task: Arms, k: np.ndarray, candidates: np.ndarray) -> Point:
        """The best of candidates (m, n): of those that keep the ball, if any does, the one of least cost."""
        tried, errors = self._try(task, k, candidates)
        keeps = np.all(~tried.failed, axis=0)
        world = int(np.lexsort((np.sum(errors**2, axis=1), ~keeps))[0])
        x = candidates[min(world, len(candidates) - 1)]
        return Point(x, errors[world], bool(keeps[world]), tried, world)

    def _errors(self, tried: Tried, x: np.ndarray) -> np.ndarray:
        """(worlds, e) what is wrong with candidates x (worlds, n), in deviations that count as one."""
        c, task, k = self.config, self.tasks[0], tried.k
        assert task.graph.touch is not None
        columns, n = task.columns, len(k)
        reached = np.minimum(np.arange(n), len(tried.felt) - 1)
        felt = tried.felt[reached]
        off = felt - self.goal[k][:, None]
        last = c.last if task.graph.touch[(k[-1] + 1) * STEPS - 1].any() or not task.graph.ends else 1.0
        weight = np.where(np.arange(n) == n - 1, last, 1.0)[:, None, None] / np.sqrt(n)
        parts = [
            weight * off[..., columns["ball"]] / c.ball,
            weight * off[..., columns["ball velocity"]] / c.speed,
        ]
        hands = [off[-1:, :, columns[f"hand {hand}"]] for hand in task.model.roles.both("hands")]
        parts += [weight[-1] * hand / c.hand for hand in hands]
        touch = task.graph.touch[(k + 1) * STEPS - 1]
        share = 1.0 / np.sqrt(len(FINGERS) * max(touch.sum(), 1))
        for hand, side in enumerate("lr"):
            rows = touch[:, hand]
            for finger in FINGERS:
                way = felt[rows][..., columns[f"to {side}_{finger}_tip"]]
                length = np.linalg.norm(way, axis=-1, keepdims=True)
                parts.append(share * way * (1.0 - task.model.ball_radius / np.maximum(length, TINY)) / c.tip)
        parts.append(np.maximum(c.clear - tried.room[reached], 0.0) / self.room)
        flat = [part.transpose(1, 0, 2).reshape(len(x), -1) for part in parts]
        before = np.broadcast_to(self.last[k[0] - 1], (1, len(x), tried.action.shape[-1]))
        changes = np.diff(tried.action, axis=0, prepend=before).transpose(1, 0, 2).reshape(len(x), -1)
        size = np.sqrt(x.shape[1])
        errors = np.concatenate([*flat, x / (c.offset * size), changes / (c.change * size)], axis=1)
        return np.clip(np.nan_to_num(errors, nan=WORST), -WORST, WORST)

    def _slope(self, k: np.ndarray, at: Point) -> np.ndarray:
        """(e, n) by differences."""
        step = self.config.step
        rows = np.concatenate([at.x[None], at.x + step * np.eye(len(at.x))])
        _, errors = self._try(self.tasks[2], k, rows)
        return np.asarray((errors[1 : len(rows)] - errors[0]).T / step)

    @property
    def state(self) -> Arrays:
        slopes = {f"slope.{number}": slope for number, slope in self.slopes.items()}
        return super().state | {"last": self.last, "least": self.least, **slopes}

    def restore(self, state: Arrays) -> None:
        super().restore(state)
        self.last, self.least = state["last"], state["least"]
        numbers = range(len(self.windows))
        self.slopes = {n: state[f"slope.{n}"] for n in numbers if f"slope.{n}" in state}


def steps_down(
    slope: np.ndarray, errors: np.ndarray, dampings: Sequence[float], lengths: Sequence[float]
) -> np.ndarray:
    """(dampings * lengths, n) damped steps, each by several lengths, that lower errors (e,) whose slope is
    (e, n) (Levenberg 1944); dampings: of the mean of the squared slopes."""
    square, downhill = slope.T @ slope, -slope.T @ errors
    mean, one = np.trace(square) / len(square), np.eye(len(square))
    steps = [np.linalg.solve(square + damping * mean * one, downhill) for damping in dampings]
    return np.concatenate([np.outer(lengths, step) for step in steps])


def corrected(slope: np.ndarray, step: np.ndarray, change: np.ndarray) -> np.ndarray:
    """A slope (e, n) that has the change (e,) along a step (n,) right (Broyden 1965)."""
    return np.asarray(slope + np.outer(change - slope @ step, step) / (step @ step))


def with_beyond(graph: ControlGraph, window: np.ndarray, c: NewtonConfig) -> list[np.ndarray]:
    """What is found at a time: a window and what comes behind it in a clip, or where that does not go, it
    alone."""
    end = int(window[-1]) + 1
    last = end + c.beyond
    while graph.ends and last < graph.count and not holding(graph, last).any():
        last += 1
    more = np.arange(end, min(last, graph.count)) if graph.ends else window[:0]
    return [np.concatenate([window, more]), window] if len(more) else [window]


def sizes(model: Model, graph: ControlGraph, c: NewtonConfig) -> tuple[int, int, int]:
    """Worlds for starts, steps and differences."""
    active = active_hands(model, graph)
    numbers = max(int(active[with_beyond(graph, k, c)[0]].sum()) for k in windows_of(graph))
    starts, steps, slopes = (
        -(-size // LANES) * LANES for size in (STARTS, len(c.damping) * len(c.lengths), numbers + 1)
    )
    return starts, steps, slopes
