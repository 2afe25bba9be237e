"""The ball in the hand as a control problem: what moves arms and fingers, what they feel, what it costs
(P1 5).

The legs follow a locomotion policy that is learned already; a policy here offsets both arms, ten numbers
each: shoulder 3, elbow, wrist 3, and three signals that close the fingers (Eq. 5).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ...sims.model import Model
from ...sims.worlds import BAD_CONTACT, NONFINITE, Watch, terms
from ...sims.worlds.places import middle, rounded_tip
from ...sims.worlds.watch import Folded, first, gap, height_of, last, least, total, trouble
from ..graph import STEPS, ControlGraph
from ..rollout import Controller
from ..starts import Starts
from .fingers import FINGERS, READY, SHARES, SIGNALS, finger_joints, finger_signals
from .locomotion import WEIGHTS, CostWeights, Locomotion
from .mirror import Mirror, observed, turned

ARM = 10
"""Numbers of an arm (Eq. 5): shoulder, elbow, wrist, fingers."""
WRIST = 2.0
"""Offsets of wrists are doubled (P1 7.1)."""
HELD = 0.05
"""[m] At a checkpoint the fingers are nearer than this to the ball, on average (P1 5.1)."""
UNITS = {"POINT": 0.05, "VELOCITY": 0.3, "BETWEEN": 0.05, "BALLISTIC": 0.05, "COM": 0.05, "COM_VELOCITY": 0.3,
         "ANGULAR_MOMENTUM": 3.0}  # fmt: skip
"""[m, m/s, s, kg m^2/s] Deviations that count as one in the state, by kind of observation."""
JOINT_SPEED, MOVE = 3.0, 0.1
"""[rad/s], [rad] that count as one: of the arms' joints, of the offsets of the fragment before."""
STATES = ("reduced", "ballistic", "full", "paper", "tips")
"""What a policy may feel: ball, hands and what the legs feel; with the ball's flight, too; with the arms'
joint speeds and the last action as well; the 165 numbers of Eq. 9; the way from the ball to thumbs, index and
little fingers, 18 numbers (P1 7.1, skill A)."""


@dataclass(frozen=True)
class BallWeights:
    """Weights of the cost of a fragment."""

    fingers: float = 100.0
    """of the mean distance of the fingers from the ball while they should have it (Eq. 7) [m]"""
    ball: float = 10.0
    """of the ball's distance from where the reference has it [m]"""
    speed: float = 1.0
    """of the difference of its velocity [m/s]"""
    hands: float = 3.0
    """of both hands' distance from where the reference has them [m]"""
    action: float = 0.2
    """of the offsets' length [rad]"""
    change: float = 0.2
    """of how much they differ from the fragment before [rad]"""
    lost: float = 0.4
    """[m] A ball that far from its reference is lost."""
    legs: CostWeights = field(default=WEIGHTS)


USUAL = BallWeights()


class OutOfTime(Exception):
    """The time of a search is up."""


class Arms(Locomotion):
    """A player whose hands play with the ball along a control graph. legs: the policy of the legs.

    state: what a policy feels, one of STATES. closely: what happens to the ball inside a fragment is seen,
    too (`trouble`, `height`), which costs some time. An action has ten numbers for each arm [rad; fingers:
    share of the way from flat to fist]. The cost has the distance of the fingers from the ball over the time
    steps of H, and how far ball and hands are from the reference; the ball is lost where it touches the
    player elsewhere than on a hand, is too far from its reference, or out of reach at a checkpoint.
    """

    def __init__(
        self,
        model: Model,
        graph: ControlGraph,
        worlds: int,
        legs: Controller,
        device: str = "cpu",
        threads: int | None = None,
        weights: BallWeights = USUAL,
        state: str = "reduced",
        closely: bool = False,
    ):
        if state not in STATES:
            raise ValueError(f"there is no state '{state}'; there are {', '.join(STATES)}")
        if graph.touch is None or not graph.touch.any():
            raise ValueError("the graph knows no ball that anybody plays with")
        self.legs, self._weights = legs, weights
        ball, radius = model.roles.one("ball"), model.ball_radius
        tips = [f"{side}_{finger}_tip" for side in "lr" for finger in FINGERS]
        hands = [f"hand {hand}" for hand in model.roles.both("hands")]
        meet = float(np.mean(graph.heights if graph.heights is not None else []))
        more = {
            "ball": terms.point(ball),
            "ball velocity": terms.velocity(ball),
            **{f"hand {hand}": terms.point(hand) for hand in model.roles.both("hands")},
            **{f"hand {hand} velocity": terms.velocity(hand) for hand in model.roles.both("hands")},
            "flight": terms.ballistic(ball, radius, meet, RESTITUTION),
            **{f"to {tip}": terms.between(ball, tip) for tip in tips},
        }
        felt = ["ball", "ball velocity", *hands, *(f"{hand} velocity" for hand in hands)]
        if state in ("ballistic", "full"):
            felt.append("flight")
        elif state == "tips":
            felt = [f"to {tip}" for tip in tips if tip.split("_")[1] in SIGNALS]
        elif state == "paper":
            fingers = {model.joint_body(name) for side in finger_joints(model) for name in side}
            own = model.descendants(model.joint_body(model.root))
            bodies = {
                name: middle(model, name) for name in (model.body_names[b] for b in own if b not in fingers)
            }
            more |= {f"body {name}": terms.point(place) for name, place in bodies.items()}
            more |= {f"body {name} velocity": terms.velocity(place) for name, place in bodies.items()}
            felt = ["ball", "ball velocity", *(n for n in more if n.startswith("body "))]
            felt += [*(f"to {tip}" for tip in tips), "com", "com_velocity", "momentum"]
        super().__init__(model, graph, worlds, device, threads, weights.legs, finger_signals(model), more)
        self.legs_obs, self._legs_actions = self.obs, self.actions
        self.actions = 2 * ARM
        self._spread = _spread()
        self.active = active_hands(model, graph)
        """(fragments, 20) bool: what acts on the ball, X of P1 5.1"""
        kinds = self.terms
        self._arms = np.concatenate([np.arange(self.probe.size)[self.columns[n]] for n in felt])
        self._felt_arms = felt
        self._units = np.concatenate([np.full(kinds[n].count, UNITS[kinds[n].kind]) for n in felt])
        self._legs_too = state in ("reduced", "ballistic", "full")
        self._speeds = _arm_dofs(model) if state == "full" else None
        self.obs = len(self._units) + self.legs_obs * self._legs_too
        if self._speeds is not None:
            self.obs += len(self._speeds) + self.actions
        touch = graph.touch.astype(float)
        mark = np.zeros_like(touch)
        mark[graph.checkpoints] = touch[graph.checkpoints]
        self.held = touch.reshape(graph.count, STEPS, 2).sum(axis=(1, 2))
        """(fragments,) time steps, of both hands, in which the fingers should have the ball"""
        self.marked = mark.reshape(graph.count, STEPS, 2).sum(axis=1) > 0
        """(fragments, 2) hands that must have the ball at a checkpoint in it"""
        share = 1.0 / len(FINGERS)
        sides = np.repeat([0, 1], len(FINGERS))
        soft = {tip: total(gap(tip, ball, radius), share * touch[:, h]) for tip, h in zip(tips, sides)}
        hard = {f"at {tip}": last(gap(tip, ball, radius), mark[:, h]) for tip, h in zip(tips, sides)}
        close: dict[str, Folded] = {}
        if closely:
            wrists = [rounded_tip(model, arm) for arm in _forearms(model)]
            close = {f"room {i}": least(gap(end, ball, radius + r)) for i, (end, r) in enumerate(wrists)}
            close |= {"trouble": first(trouble()), "height": last(height_of(ball), mark.any(axis=1))}
        self.watch = Watch(self.sim, soft | hard | close, len(touch))
        self._tips = len(tips)
        self._moves = np.zeros((worlds, self.actions))
        self._before = np.zeros((worlds, self.actions))
        self.late: Callable[[], bool] = _never
        """Asked before each fragment; once it is true, `advance` raises OutOfTime."""
        self.near = np.inf
        """[m] Distances of the fingers beyond this count less and less."""
        self.fingers = np.zeros(worlds)
        """(worlds,) [m] mean distance of the fingers from the ball in H of the last fragment (Eq. 7), NaN
        where it has none"""
        self.missed = np.zeros(worlds, bool)
        """(worlds,) a hand did not have the ball at a checkpoint of the last fragment"""
        self.trouble = np.full(worlds, -1)
        """(worlds,) step of the last fragment after which the world was first in trouble (fallen, or the ball
        where it should not be), -1 where it was not; only where it is looked at closely"""
        self.room = np.zeros((worlds, 2))
        """(worlds, 2) [m] least room in the last fragment between the ball and the left, the right forearm
        where the hand begins, which is the bad contact that comes first; likewise"""
        self.height = np.zeros(worlds)
        """(worlds,) [m] of the ball at the last checkpoint of the last fragment; likewise"""

    def reset(self, starts: Starts, which: np.ndarray | None = None) -> None:
        super().reset(starts, which)
        if hasattr(self, "_before"):
            self._before[slice(None) if which is None else which] = 0.0

    def observe(self, k: np.ndarray) -> np.ndarray:
        """State s (worlds, obs): how far what is felt is off the reference at the start of fragments k."""
        off = (self.felt[:, self._arms] - self.start[k][:, self._arms]) / self._units
        if not self._legs_too:
            return off
        parts = [off, super().observe(k)]
        if self._speeds is not None:
            speed = self.sim.joint_qd[:, self._speeds] - self.graph.start_qd[k][:, self._speeds]
            parts += [speed / JOINT_SPEED, self._before / MOVE]
        return np.concatenate(parts, axis=1)

    def mirrored(self) -> tuple[Mirror, Mirror]:
        """What a mirror does to the state, and to the actions."""
        roles, by_side = self.model.roles, ("shoulders", "elbows", "wrists")
        sides = [[roles.both(part)[side] for part in by_side] for side in range(2)]
        arms = turned(self.model, [*sides[0], *sides[1]])
        place = np.concatenate([ARM * side + np.arange(ARM - len(SIGNALS)) for side in range(2)])
        source, sign = (np.arange(2 * ARM) + ARM) % (2 * ARM), np.ones(2 * ARM)
        source[place], sign[place] = place[arms.source], arms.sign
        action = Mirror(source, sign)
        state = [observed(self.terms, self._felt_arms)]
        if self._legs_too:
            state.append(super().mirrored()[0])
        if self._speeds is not None:
            state += [turned(self.model, _arm_joints(self.model)), action]
        return Mirror.joined(state), action

    def advance(self, k: np.ndarray, action: np.ndarray, first: int = 0, count: int = STEPS) -> None:
        if first == 0:
            if self.late():
                raise OutOfTime
            legs = self.legs.act(super().observe(k), k)
            self._moves = np.where(self.active[k], action, 0.0)
            self._all = np.concatenate([legs, self._moves @ self._spread], axis=1)
            closed = self._all[:, self._legs_actions + ARMS :]
            np.clip(closed, -READY, 1.0 - READY, out=closed)
        super().advance(k, self._all, first, count)

    @property
    def others(self) -> np.ndarray:
        return self.course.offset[:, :0]

    def judge(self, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """E (worlds,) of the fragments k that have just ended, infinite where the ball is lost or the player
        has fallen, and where that is so (worlds,)."""
        w, columns = self._weights, self.columns
        _, failed = super().judge(k)
        if self.graph.tracked:  # nobody falls who is held
            failed = self.fallen = self.felt[:, columns["status"]][:, 0].astype(int) & NONFINITE != 0
        assert self.watch is not None
        seen = self.watch.read()
        held = self.held[k]
        self.fingers = np.where(held > 0, seen[:, : self._tips].sum(axis=1) / np.maximum(held, 1.0), np.nan)
        at = seen[:, self._tips : 2 * self._tips].reshape(-1, 2, len(FINGERS)).mean(axis=2)
        self.missed = np.any(self.marked[k] & (at > HELD), axis=1)
        if seen.shape[1] > 2 * self._tips:
            self.room, self.trouble, self.height = seen[:, -4:-2], seen[:, -2].astype(int), seen[:, -1]
        off = self.felt - self.goal[k]
        ball, speed = (np.linalg.norm(off[:, columns[n]], axis=1) for n in ("ball", "ball velocity"))
        hands = sum(
            np.linalg.norm(off[:, columns[f"hand {h}"]], axis=1) for h in self.model.roles.both("hands")
        )
        bad = self.felt[:, columns["status"]][:, 0].astype(int) & BAD_CONTACT != 0
        failed = failed | bad | self.missed | ~(ball < w.lost)
        cost = (
            w.fingers * np.nan_to_num(self.fingers / (1.0 + np.maximum(self.fingers, 0.0) / self.near))
            + w.ball * ball
            + w.speed * speed
            + w.hands * hands
            + w.action * np.linalg.norm(self._moves, axis=1)
            + w.change * np.linalg.norm(self._moves - self._before, axis=1)
        )
        self._before = self._moves
        return np.where(failed, np.inf, cost), failed

    def become(self, sources: np.ndarray) -> None:
        super().become(sources)
        for name in ("_before", "fingers", "missed", "room", "trouble", "height"):
            setattr(self, name, getattr(self, name)[sources])

    def snapshot(self) -> dict[str, np.ndarray]:
        return super().snapshot() | {"before": np.array(self._before)}

    def recall(self, snapshot: Mapping[str, np.ndarray]) -> None:
        super().recall(snapshot)
        self._before = np.array(snapshot["before"])


ARMS = 14
"""Columns of both arms: shoulders, elbows, wrists; the fingers' follow."""
RESTITUTION = 0.8
"""of the ball on the ground"""


def _never() -> bool:
    return False


def misplaced(model: Model, starts: Starts, off: float, random: np.random.Generator) -> None:
    """Put the ball of each state off its place, by `off` [m] (root mean square) in any direction."""
    ball = model.q_slice(model.roles.one("ball_joint")).start
    starts.joint_q[:, ball : ball + 3] += off / np.sqrt(3.0) * random.standard_normal((len(starts), 3))


def _forearms(model: Model) -> list[str]:
    return [model.body_names[model.joint_body(elbow)] for elbow in model.roles.both("elbows")]


def _arm_joints(model: Model) -> list[str]:
    """Both arms', in the order of their columns of offsets."""
    roles = model.roles
    return [*roles.both("shoulders"), *roles.both("elbows"), *roles.both("wrists")]


def _arm_dofs(model: Model) -> np.ndarray:
    return np.concatenate([np.arange(model.nv)[model.dof_slice(joint)] for joint in _arm_joints(model)])


def _spread() -> np.ndarray:
    """(20, columns) from actions to offsets: shoulders, elbows, wrists, fingers, left before right."""
    out = np.zeros((2 * ARM, ARMS + 2 * len(FINGERS)))
    for side in range(2):
        of = ARM * side
        out[of : of + 3, 3 * side : 3 * side + 3] = np.eye(3)
        out[of + 3, 6 + side] = 1.0
        out[of + 4 : of + 7, 8 + 3 * side : 11 + 3 * side] = WRIST * np.eye(3)
        fingers = ARMS + len(FINGERS) * side
        out[of + 7 : of + ARM, fingers : fingers + len(FINGERS)] = SHARES.T
    return out


def active_hands(model: Model, graph: ControlGraph) -> np.ndarray:
    """(fragments, 20) bool: the arms that act on the ball in each fragment, X of P1 5.1: those that should
    have it, and between two contacts the first arm until the ball is lowest, the second from there on."""
    assert graph.touch is not None and graph.motion is not None
    touch = np.asarray(graph.touch, bool)
    low = graph.motion[:, model.q_slice(model.roles.one("ball_joint")).start + 2]
    does, rows = np.zeros_like(touch), len(touch)
    for span in graph.spans:
        own = np.arange(STEPS * span.first, STEPS * (span.first + span.count))
        held = np.flatnonzero(touch[own].any(axis=1))
        if not len(held):
            continue
        for a, b in zip(held, np.roll(held, -1)):
            gap = (b - a - 1) % len(own)
            does[own[a]] = touch[own[a]]
            free = own[(a + 1 + np.arange(gap)) % len(own)]
            if gap:
                turn = int(np.argmin(low[free]))
                does[free[:turn]], does[free[turn:]] = touch[own[a]], touch[own[b]]
    each = does.reshape(rows // STEPS, STEPS, 2).any(axis=1)
    return np.repeat(each, ARM, axis=1)
