"""Closed-loop trials: how long a policy lasts, how well it tracks, and what it stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...sims.worlds.character import ANGLE, ENDS
from ..graph import ControlGraph
from ..policies.linear import LinearPolicy
from ..tasks.disturbance import CALM, Disturbance, Disturber
from ..tasks.locomotion import Locomotion


@dataclass
class States:
    """States from which trials and walks start."""

    k: np.ndarray
    """(n,) fragment that begins"""
    joint_q: np.ndarray
    """(n, nq) [m, rad, -]"""
    joint_qd: np.ndarray
    """(n, nv) [m/s, rad/s]"""

    def __len__(self) -> int:
        return len(self.k)

    def draw(self, count: int, random, speed_noise: float = 0.0) -> States:
        """Random ones, with noise on all joint velocities [rad/s, m/s]."""
        pick = random.integers(len(self), size=count)
        joint_qd = self.joint_qd[pick] + speed_noise * random.standard_normal((count, self.joint_qd.shape[1]))
        return States(self.k[pick], self.joint_q[pick], joint_qd)


def reference_states(graph: ControlGraph) -> States:
    """The reference's own states."""
    return States(np.arange(graph.count), graph.start_q, graph.start_qd)


def record_states(
    task: Locomotion,
    policy: LinearPolicy,
    states: States,
    seed: int = 0,
    disturbance: Disturbance = CALM,
    every: int = 7,
    settled: int = 60,
    ahead: int = 40,
) -> States:
    """States that a policy comes through and lives on from: those of all worlds of the task, at every
    `every`th fragment, `settled` fragments after a random start and with `ahead` fragments still to
    stand. The given states where there are none."""
    random = np.random.default_rng(seed)
    graph, n = task.graph, task.sim.world_count
    start = states.draw(n, random)
    k = start.k
    felt = task.reset(k, start.joint_q, start.joint_qd)
    disturber = Disturber(disturbance, task, random)
    stands, rows, seen = np.ones(n, bool), settled + graph.count, []
    for row in range(rows + ahead):
        if settled <= row < rows and row % every == 0:
            seen.append((k, task.sim.joint_q, task.sim.joint_qd))
        disturber.apply()
        felt = task.advance(k, policy.act(task.state(felt, k), k))
        stands &= ~task.fallen(felt, k)
        k = graph.follow(k, random)
    task.calm()
    if not stands.any():
        return states
    return States(*(np.concatenate([part[stands] for part in parts]) for parts in zip(*seen)))


@dataclass
class Trials:
    """What became of each trial."""

    survived: np.ndarray
    """(trials,) bool"""
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


def run_trials(
    task: Locomotion,
    policy: LinearPolicy,
    states: States,
    cycles: float,
    seed: int = 0,
    speed_noise: float = 0.0,
    disturbance: Disturbance = CALM,
    progress=None,
) -> Trials:
    """One trial per world of the task, each from a random state, for a number of cycles (as many fragments as
    the graph has). progress: called with the fragments done."""
    random = np.random.default_rng(seed)
    graph, n = task.graph, task.sim.world_count
    start = states.draw(n, random, speed_noise)
    k, fragments = start.k, max(1, round(cycles * graph.count))
    felt = task.reset(k, start.joint_q, start.joint_qd)
    disturber = Disturber(disturbance, task, random)
    stands, life, cost = np.ones(n, bool), np.zeros(n), 0.0
    errors = Errors(task, start)
    for done in range(fragments):
        disturber.apply()
        felt = task.advance(k, policy.act(task.state(felt, k), k))
        E = task.cost(felt, k)
        stands &= np.isfinite(E)
        if not stands.any():
            break
        life += stands
        cost += E[stands].sum()
        errors.add(felt, k, stands)
        k = graph.follow(k, random)
        if progress:
            progress(done + 1)
    task.calm()
    return Trials(
        stands, life / fragments, float(cost / life.sum()) if life.any() else np.nan, *errors.means()
    )


class Errors:
    """Errors of those who stand, summed up over fragments."""

    def __init__(self, task: Locomotion, start: States):
        self.task, self.row = task, 0
        self.sums = np.zeros(4)
        self.counts = np.zeros(4)
        graph = task.graph
        self.ways = relative(planar(graph.start_q), planar(graph.goal_q))
        self.begun = planar(start.joint_q)
        self.way = np.zeros((len(start), 3))

    def add(self, felt: np.ndarray, k: np.ndarray, stands: np.ndarray) -> None:
        """Those of the fragments k that have just ended."""
        off = felt[:, ENDS:] - self.task.goal[k, ENDS:]
        ends = np.linalg.norm(off.reshape(len(off), -1, 3), axis=-1).mean(axis=1)
        self._sum(0, felt[stands, ANGLE])
        self._sum(1, ends[stands])
        self.row += 1
        self.way = composed(self.way, self.ways[k])
        if self.row % self.task.graph.count == 0:
            now = planar(self.task.sim.joint_q)
            gone = relative(self.begun, now)[stands]
            self._sum(2, np.linalg.norm(gone[:, :2] - self.way[stands, :2], axis=1))
            self._sum(3, np.abs(wrapped(gone[:, 2] - self.way[stands, 2])))
            self.begun, self.way = now, np.zeros_like(self.way)

    def _sum(self, which: int, values: np.ndarray) -> None:
        self.sums[which] += values.sum()
        self.counts[which] += len(values)

    def means(self) -> tuple[float, ...]:
        """Of the angle [rad], the ends [m], the drift [m] and the turn [rad]; NaN for none."""
        return tuple(float(s / c) if c else np.nan for s, c in zip(self.sums, self.counts))


def planar(joint_q: np.ndarray) -> np.ndarray:
    """Place and heading (n, 3) [m, m, rad] of roots over the ground; not finite where they are not."""
    x, y, z, w = joint_q[:, 3:7].T
    heading = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    return np.stack([joint_q[:, 0], joint_q[:, 1], heading], axis=1)


def relative(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Planar poses b as seen from a, all (n, 3)."""
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    x, y = (b - a)[:, :2].T
    return np.stack([c * x + s * y, c * y - s * x, wrapped(b[:, 2] - a[:, 2])], axis=1)


def composed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Planar poses reached by going a and from there b, all (n, 3)."""
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    x, y = a[:, 0] + c * b[:, 0] - s * b[:, 1], a[:, 1] + s * b[:, 0] + c * b[:, 1]
    return np.stack([x, y, a[:, 2] + b[:, 2]], axis=1)


def wrapped(angle: np.ndarray) -> np.ndarray:
    """The same angle within half a turn [rad]."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
