"""Locomotion as a control problem: what a policy feels, what it changes, and what that costs (P1 3.3, with
the state and the cost of Liu et al. 2016)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...sims import planar
from ...sims.model import Model
from ...sims.planar import heading, wrapped
from ...sims.worlds import FALL, NONFINITE, Group, Probe, Signal, terms
from ..graph import STEPS, ControlGraph
from ..starts import Starts
from .follow import Follow
from .mirror import Mirror, observed, turned

STEERED, FELT = 17, 20
"""Numbers that a policy changes, and that it feels, on the player."""
FINGERS = ("*_mcp", "*_pip", "*_dip")
FALLEN = 0.3
"""[m] A root this far below, or above, the reference's is out of control."""
HEIGHT_UNIT = 1.6
"""[m] of the balance cost"""
UNITS = {"lean": 0.1, "height": 0.05, "com": 0.05, "com_velocity": 0.3, "momentum": 3.0}
FOOT_UNIT, TURN_UNIT, HEADING_UNIT = 0.05, 1.0, 0.2
"""Deviations that count as one in the state: of the parts above, of both feet, of the turning speed, of the
heading."""


@dataclass(frozen=True)
class CostWeights:
    """Weights of the cost's terms."""

    pose: float = 5.0
    """of the mean over the joints of angle [rad] + 0.1 rate [rad/s]"""
    root: float = 3.0
    """of the root's lean [-] + 0.1 angular velocity [rad/s]"""
    ends: float = 30.0
    """of the mean height of feet and head [m]"""
    balance: float = 10.0
    """of where the centre of mass is over feet and head [1.6 m]"""
    travel: float = 6.0
    """of its velocity [m/s]"""
    heading: float = 5.0
    """of the way it faces [rad]"""


WEIGHTS = CostWeights()


def locomotion_model() -> Model:
    """The player with stiff hands and without the ball: 45 + 6 degrees of freedom (P1 3.3)."""
    return Model.load("player", rigid=FINGERS, without=("ball",))


def legs_graph(graph: ControlGraph) -> ControlGraph:
    """A graph of the player for `locomotion_model`; one that is for it already stays as it is."""
    player, model = Model.load("player"), locomotion_model()
    return graph.on(model, player) if graph.start_q.shape[1] == player.nq else graph


class Locomotion(Follow):
    """A player that keeps its balance along a control graph.

    A policy offsets the lower back, hips, knees and ankles, 17 numbers; shoulders, elbows and wrists are
    another's, here a disturbance's. It feels the 20 numbers of `observe`.

    Where it is on the ground is not felt, but which way it faces is: each world keeps the heading that the
    reference would have, had it gone the same fragments. A state to start from is seen from where the
    reference begins the fragment, so its heading says how far it is off.
    """

    # signals, more: what is steered and observed beyond that, for a task that is made of this one

    def __init__(
        self,
        model: Model,
        graph: ControlGraph,
        worlds: int,
        device: str = "cpu",
        threads: int | None = None,
        weights: CostWeights = WEIGHTS,
        signals: Sequence[Signal] = (),
        more: Mapping[str, terms.Term] | None = None,
    ):
        roles = model.roles
        hips, knees, ankles, toes = (roles.both(part) for part in ("hips", "knees", "ankles", "toes"))
        self.steered = steered = (roles.spine[0], *hips, *knees, *ankles)
        arms = (*roles.both("shoulders"), *roles.both("elbows"), *roles.both("wrists"))
        pushed = (roles.one("trunk"), *roles.both("hands"))
        super().__init__(model, graph, worlds, device, threads, (*steered, *arms, *signals), pushed)
        self.actions = sum(_count(model.dof_slice(name)) for name in steered)
        self.judged = (*roles.spine, *(n for leg in zip(hips, knees, ankles, toes) for n in leg))
        """joints in the pose cost; the arms are another's"""
        self.ends = (*roles.both("feet"), roles.one("head"))
        self.terms = {**_terms(self.ends, self.judged), **(more or {})}
        self.probe = Probe(
            self.sim,
            self.terms,
            (graph.goal_q, graph.goal_qd),
            _groups(self.ends, weights),
        )
        self.columns = self.probe.columns
        units = UNITS | dict.fromkeys(roles.feet, FOOT_UNIT)
        self.scale = np.concatenate(
            [np.full(_count(self.columns[name]), unit) for name, unit in units.items()]
        )
        spin = self.columns["spin"]
        self._felt = [*range(len(self.scale)), spin.stop - 1]
        self.scale = np.append(self.scale, TURN_UNIT)
        self.obs = len(self.scale) + 1
        self._heading = weights.heading
        self.begins = heading(graph.start_q[:, 3:7])
        self.turns = wrapped(heading(graph.goal_q[:, 3:7]) - self.begins)
        self.loose = [(j.q.start, j.dof.start) for j in model.joints[1:] if j.kind == "free"]
        self.heading = np.zeros(worlds)
        """(worlds,) [rad] that each world should face"""
        self.start = self.feels(graph.start_q, graph.start_qd)
        self.goal = self.feels(graph.goal_q, graph.goal_qd)
        self.goal[:, self.columns["miss"]] = 0.0
        self.probe.want(self.goal)
        self.felt = np.zeros((worlds, self.probe.size), np.float32)
        """(worlds, n) what `probe` said last"""
        self.fallen = np.zeros(worlds, bool)
        """(worlds,) who failed in the last fragment by falling"""
        self._cost = np.zeros(worlds, np.float32)

    def feels(self, joint_q: np.ndarray, joint_qd: np.ndarray) -> np.ndarray:
        """(n, p) what the probe says in given states, into which the worlds are put for it."""
        felt = []
        for first in range(0, len(joint_q), self.worlds):
            rows = np.minimum(np.arange(first, first + self.worlds), len(joint_q) - 1)
            super().reset(Starts(rows, joint_q[rows], joint_qd[rows]))
            felt.append(self.probe.read())
        return np.concatenate(felt)[: len(joint_q)]

    def reset(self, starts: Starts, which: np.ndarray | None = None) -> None:
        super().reset(starts, which)
        which = np.ones(self.worlds, bool) if which is None else which
        self.heading = np.array(self.heading)
        self.heading[which] = self.begins[starts.k]
        self._feel(0)

    def observe(self, k: np.ndarray) -> np.ndarray:
        """State s (worlds, 20): the deviation from the reference at the start of fragments k."""
        off = (self.felt[:, self._felt] - self.start[k][:, self._felt]) / self.scale
        return np.concatenate([off, self.astray[:, None] / HEADING_UNIT], axis=1)

    def mirrored(self) -> tuple[Mirror, Mirror]:
        """What a mirror does to the state, and to the actions."""
        alone = Mirror(np.zeros(1, int), np.full(1, -1.0))  # the turning speed; how far it faces away
        state = [observed(self.terms, [*UNITS, *self.model.roles.feet]), alone, alone]
        return Mirror.joined(state), turned(self.model, self.steered)

    @property
    def astray(self) -> np.ndarray:
        """(worlds,) [rad] to the left of where each world should face"""
        cos, sin = self.felt[:, self.columns["facing"]].T
        return np.asarray(wrapped(np.arctan2(sin, cos) - self.heading))

    def advance(self, k: np.ndarray, action: np.ndarray, first: int = 0, count: int = STEPS) -> None:
        super().advance(k, action, first, count)
        if first + count == STEPS:
            self.heading = wrapped(self.heading + self.turns[k])
            self._feel(k)

    def judge(self, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """E (worlds,) of the fragments k that have just ended, infinite for who has failed: who (worlds,)
        lies on the ground or is about to, or has left it, flung by something absurd."""
        off = self.felt[:, self.columns["height"]][:, 0] - self.goal[k, self.columns["height"]][:, 0]
        down = self.felt[:, self.columns["status"]][:, 0].astype(int) & (FALL | NONFINITE) != 0
        failed = self.fallen = down | ~(np.abs(off) < FALLEN)
        cost = self._cost + self._heading * np.abs(self.astray)
        return np.where(failed, np.inf, cost), failed

    def states(self, k: np.ndarray, worlds: np.ndarray | slice = slice(None)) -> Starts:
        """States of worlds (n,) that go on with fragments k (n,), to start from: where the reference begins
        them, and as far off its heading as they are now."""
        joint_q, joint_qd = self.sim.joint_q[worlds], self.sim.joint_qd[worlds]
        by = self.begins[k] - self.heading[worlds]
        return Starts(k, *planar.turned(joint_q, joint_qd, by, self.graph.start_q[k, :2], self.loose))

    def become(self, sources: np.ndarray) -> None:
        super().become(sources)
        self.felt, self.heading = self.felt[sources], self.heading[sources]

    def snapshot(self) -> dict[str, np.ndarray]:
        return super().snapshot() | {"felt": np.array(self.felt), "heading": np.array(self.heading)}

    def recall(self, snapshot: Mapping[str, np.ndarray]) -> None:
        super().recall(snapshot)
        self.felt, self.heading = np.array(snapshot["felt"]), np.array(snapshot["heading"])

    def _feel(self, k: np.ndarray | int) -> None:
        self.felt, self._cost = self.probe.judge(k)


def _count(part: slice) -> int:
    return int(part.stop - part.start)


def _terms(ends: tuple[str, ...], judged: tuple[str, ...]) -> Mapping[str, terms.Term]:
    """What is felt, the reduced state first."""
    over = {f"com over {end}": terms.from_com(end) for end in ends}
    return {
        "lean": terms.lean(),
        "height": terms.height(),
        "com": terms.com(),
        "com_velocity": terms.com_velocity(),
        "momentum": terms.momentum(),
        **{end: terms.point(end) for end in ends},
        "spin": terms.spin(),
        "facing": terms.facing(),
        "miss": terms.miss(judged),
        **over,
        "status": terms.status(),
    }


def _groups(ends: tuple[str, ...], w: CostWeights) -> list[Group]:
    """The cost: weighted distances from the reference."""
    share = 1.0 / len(ends)
    return [
        Group("miss", w.pose, (0, 1)),
        Group("miss", 0.1 * w.pose, (1, 2)),
        Group("lean", w.root),
        Group("spin", 0.1 * w.root),
        *(Group(end, share * w.ends, (2, 3)) for end in ends),
        *(Group(f"com over {end}", share * w.balance / HEIGHT_UNIT, (0, 2)) for end in ends),
        Group("com_velocity", w.travel),
    ]
