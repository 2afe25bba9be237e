"""Closed-loop trials: how long a policy lasts, and how well it tracks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...sims.planar import composed, planar, relative, wrapped
from ..choose import RandomWalk
from ..rollout import Controller, Rollout
from ..starts import Starts, Streams
from ..tasks.disturbance import CALM, Disturbance, Disturber
from ..tasks.locomotion import Locomotion

PLACE = 0.2
"""[m] A cycle that leads no farther has no pace."""


@dataclass
class Trials:
    """What became of each trial."""

    survived: np.ndarray
    """(trials,) bool"""
    fell: np.ndarray
    """(trials,) bool: ended as the player fell; who neither survived nor fell has lost the ball"""
    lived: np.ndarray
    """(trials,) share of the time before its fall"""
    cost: float
    """mean while standing"""
    angle_error: float
    """[rad] mean over the joints of legs and trunk, while standing"""
    end_error: float
    """[m] mean of feet and head in the facing frame, while standing"""
    drift: float
    """[m] mean distance per cycle between the root's way over the ground and the reference's; NaN where no
    cycle was completed"""
    turn: float
    """[rad] mean difference per cycle of its turn"""
    pace: float
    """mean share of the reference's way over the ground that a cycle covers, along it; NaN where the
    reference stays within PLACE in a cycle"""
    astray: float
    """[rad] 95th percentile, over the trials that survive, of how far each faces away from the reference's
    heading at worst; NaN for none"""


def about_trials(count: int, length: str, speed_noise: float, disturbance: Disturbance) -> str:
    """A line for a person: what trials as `run_trials` makes them have to stand. length: as "20 cycles"."""
    stands = disturbance.about
    parts = [*([stands] if stands else []), *([f"starts {speed_noise:g} rad/s off"] if speed_noise else [])]
    how = "harder than usual: " if stands else ""
    return f"{count} trials of {length} ({how}{', '.join(parts) or 'undisturbed'})"


def run_trials(
    task: Locomotion,
    controller: Controller,
    starts: Starts,
    cycles: float,
    seed: int = 0,
    speed_noise: float = 0.0,
    disturbance: Disturbance = CALM,
    progress: Callable[[int], object] | None = None,
) -> Trials:
    """One trial per world of the task, each from a random state, for a number of cycles of its graph.
    progress: called with the fragments done."""
    streams = Streams([np.random.default_rng(seed)], task.worlds)
    start = starts.draw(streams, speed_noise)
    rollout = Rollout(task, controller, RandomWalk(streams), start, Disturber(disturbance, streams))
    fragments = max(1, round(cycles * task.graph.cycle))
    stands, life, cost = np.ones(task.worlds, bool), np.zeros(task.worlds), 0.0
    fell = np.zeros(task.worlds, bool)
    errors = Errors(task, start)
    for fragment in rollout.fragments(fragments):
        fell |= stands & fragment.failed & task.fallen
        stands &= ~fragment.failed
        if not stands.any():
            break
        life += stands
        cost += float(fragment.cost[stands].sum())
        errors.add(fragment.k, stands)
        if progress:
            progress(fragment.row + 1)
    task.calm()
    mean = float(cost / life.sum()) if life.any() else np.nan
    return Trials(stands, fell, life / fragments, mean, *errors.means(), errors.astray(stands))


def record_starts(
    task: Locomotion,
    controller: Controller,
    starts: Starts,
    seed: int = 0,
    disturbance: Disturbance = CALM,
    every: int = 7,
    settled: int = 60,
    ahead: int = 40,
) -> Starts:
    """States that a policy comes through and lives on from: those of all worlds of the task, at every
    `every`th fragment, `settled` fragments after a random start and with `ahead` fragments still to
    stand. The given ones where there are none."""
    streams = Streams([np.random.default_rng(seed)], task.worlds)
    start = starts.draw(streams)
    rollout = Rollout(task, controller, RandomWalk(streams), start, Disturber(disturbance, streams))
    stands, rows = np.ones(task.worlds, bool), settled + task.graph.cycle
    seen: list[Starts] = []
    for fragment in rollout.fragments(rows + ahead):
        stands &= ~fragment.failed
        if settled <= fragment.row + 1 < rows and (fragment.row + 1) % every == 0:
            k = rollout.chooser.next(task.graph, fragment.k)
            seen.append(task.states(k))
    if not stands.any():
        return starts
    return Starts.joined([Starts(s.k[stands], s.joint_q[stands], s.joint_qd[stands]) for s in seen])


class Errors:
    """Errors of those who stand, summed up over fragments."""

    def __init__(self, task: Locomotion, start: Starts):
        self.task, self.row = task, 0
        self.sums = np.zeros(5)
        self.counts = np.zeros(5)
        self.worst = np.zeros(task.worlds)
        graph = task.graph
        self.ways = relative(planar(graph.start_q), planar(graph.goal_q))
        self.begun = planar(start.joint_q)
        self.way = np.zeros((len(start), 3))

    def add(self, k: np.ndarray, stands: np.ndarray) -> None:
        """Those of the fragments k that have just ended."""
        task, columns = self.task, self.task.columns
        off = [task.felt[:, columns[end]] - task.goal[k, columns[end]] for end in task.ends]
        ends = np.linalg.norm(off, axis=-1).mean(axis=0)
        self._sum(0, task.felt[stands, columns["miss"].start])
        self._sum(1, ends[stands])
        self.worst = np.maximum(self.worst, np.abs(task.astray))
        self.row += 1
        self.way = composed(self.way, self.ways[k])
        if self.row % task.graph.cycle == 0:
            now = planar(task.sim.joint_q)
            gone = relative(self.begun, now)[stands]
            self._sum(2, np.linalg.norm(gone[:, :2] - self.way[stands, :2], axis=1))
            self._sum(3, np.abs(wrapped(gone[:, 2] - self.way[stands, 2])))
            way = self.way[stands, :2]
            far = np.linalg.norm(way, axis=1) > PLACE
            self._sum(4, np.sum(gone[far, :2] * way[far], axis=1) / np.sum(way[far] ** 2, axis=1))
            self.begun, self.way = now, np.zeros_like(self.way)

    def _sum(self, which: int, values: np.ndarray) -> None:
        self.sums[which] += values.sum()
        self.counts[which] += len(values)

    def means(self) -> tuple[float, float, float, float, float]:
        """Of the angle [rad], the ends [m], the drift [m], the turn [rad] and the pace; NaN for none."""
        angle, ends, drift, turn, pace = (
            float(s / c) if c else np.nan for s, c in zip(self.sums, self.counts)
        )
        return angle, ends, drift, turn, pace

    def astray(self, stands: np.ndarray) -> float:
        """[rad] 95th percentile over those of a mask (worlds,) of how far each went astray at worst; NaN for
        none."""
        return float(np.quantile(self.worst[stands], 0.95)) if stands.any() else np.nan
