"""The main job: a clip becomes a reference, a simulated player follows it, and what happened is
measured."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from .clips.read import ClipError, read_part
from .sims.model import gaps, pose
from .sims.reference.feedforward import leading_targets
from .sims.reference.reference import Reference, difference, root_joint
from .sims.retarget.mapping import MappingError, find_mapping, read_mapping
from .sims.retarget.retarget import retarget
from .sims.worlds.simulation import NONFINITE

ROOT_DRIVE = (30e3, 3e3, 6e3, 600.0)
"""Virtual gains of a tracked root: [N/m], [N s/m], [N m/rad], [N m s/rad]. The rates are a tenth
of the stiffnesses, as with the player's joints, so that one lead in time makes up for all their
damping."""
FALLEN = 0.6
"""A player has fallen when its root is lower than this share of the reference's height."""
LIGHT = 0.1
"""[kg] Bodies below this (fingers) do not count in the tracking error."""
TOUCH = 0.006
"""[m] A gap below this counts as contact in pictures and summaries."""
TRIES = 16
"""Starts of the ball that are simulated side by side; a vector unit steps as many worlds in the
time of one."""


@dataclass(frozen=True)
class BallStart:
    """The ball at the first row of a reference."""

    position: np.ndarray
    """(3,) [m]."""
    velocity: np.ndarray
    """(3,) [m/s]."""


@dataclass(frozen=True)
class Run:
    """One simulated world beside its reference, a row per time step."""

    reference: Reference
    body_q: np.ndarray
    """(frames, nbody, 7) [m, -]."""
    angle_error: np.ndarray
    """(frames,) [rad], mean over the joints of bodies that are not light."""
    position_error: np.ndarray
    """(frames,) [m], mean over the same bodies, in the world."""
    fallen: np.ndarray
    """(frames,) bool."""
    contacts: dict[str, np.ndarray]
    """(frames,) bool by name, judged from the bodies' places alone."""
    wall_time: float
    """[s] spent in stepping all worlds."""

    @property
    def falls(self) -> int:
        """How often the player went down."""
        return int(np.sum(self.fallen[1:] & ~self.fallen[:-1]))

    def root_paths(self, model) -> tuple[np.ndarray, np.ndarray]:
        """Where the root was, and where the reference has it: two times (frames, 3) [m]."""
        root = pose.joint_body(model, root_joint(model))
        return self.body_q[:, root, :3], pose.forward(model, self.reference.joint_q)[:, root, :3]

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per second."""
        return self.reference.duration / max(self.wall_time, 1e-9)


def load_clip(
    model, path: str | Path, frames=(0, -1), repairs: str = "", mapping: str = "", **reading
) -> tuple[Reference, list[str]]:
    """A recorded clip on the model, and notes. frames, repairs, reading: as in `clips.read_part`; mapping:
    shipped name or file, empty for the shipped one that fits. Raises ClipError."""
    motion, notes = read_part(path, frames, repairs, **reading)
    if motion.duration < 2 * model.timestep:
        raise ClipError(path, f"its frames last only {motion.duration:.3f} s")
    try:
        wanted = read_mapping(mapping) if mapping else find_mapping(motion)
        return retarget(model, motion, wanted), notes
    except MappingError as error:
        raise ClipError(path, str(error)) from None


def dribbling_hand(model, reference: Reference) -> str:
    """ "r_hand" or "l_hand", whichever moves more up and down."""
    heights = pose.forward(model, reference.joint_q)[:, :, 2]
    hands = {name: np.ptp(heights[:, model.body(name)]) for name in ("r_hand", "l_hand")}
    return max(hands, key=hands.get)


def ball_from_hand(model, reference: Reference, hand: str) -> BallStart:
    """A ball that touches the palm from below at the first row.

    With the hand in the upper half of its stroke the ball moves with it, and is the hand's to push;
    below, it has left the hand, going along with the player, downward and at least fast enough to
    come back to this height.
    """
    body, ball = model.body(hand), model.body("ball")
    body_q = pose.forward(model, reference.joint_q)
    radius = _shape(model, ball).size[0]
    palm = _shape(model, body)
    turn = Rotation.from_quat(body_q[:, body, 3:])
    reach = np.asarray(palm.pos) - [0.0, 0.0, palm.size[2] + radius + 0.002]
    places = body_q[:, body, :3] + turn.apply(reach)
    velocity = (places[1] - places[0]) / reference.timestep
    heights = places[:, 2]
    if heights[0] < 0.5 * (heights.min() + heights.max()):
        bounce = _shape(model, ball).restitution
        fall = max(heights[0] - radius, 0.0)
        comes_back = np.sqrt(2.0 * 9.81 * fall * (1.0 / bounce**2 - 1.0))
        along = reference.velocity(model)[0, model.dof_slice(root_joint(model))][:2]
        velocity = np.array([*along, -max(-velocity[2], comes_back + 0.5)])
    return BallStart(places[0], velocity)


def ball_in_reference(model, reference: Reference) -> BallStart:
    """The ball as the reference's own coordinates have it."""
    place = model.q_slice("ball")
    path = reference.joint_q[:2, place.start : place.start + 3]
    return BallStart(path[0], (path[1] - path[0]) / reference.timestep)


def simulate(
    sim,
    reference: Reference,
    root: Literal["free", "tracked"] = "free",
    ball: BallStart | None = None,
    progress: Callable[[int], None] | None = None,
    step: Callable[[], None] | None = None,
) -> Run:
    """Track a reference in every world of `sim`; the run of the world whose ball stays in play
    longest.

    World 0 starts with the ball as given, the others with small, fixed variations of it. progress:
    called with the number of steps done. step: advances all worlds by a time step, in place of
    drives that just follow the reference. Raises FloatingPointError when the state becomes
    non-finite.
    """
    model = sim.model
    worlds = sim.world_count
    joint_q = np.tile(reference.joint_q[0], (worlds, 1))
    joint_qd = np.tile(reference.velocity(model)[0], (worlds, 1))
    if ball is not None:
        _put_ball(model, joint_q, joint_qd, ball)
    sim.reset(joint_q=joint_q, joint_qd=joint_qd)
    sim.set_root_drive(*(ROOT_DRIVE if root == "tracked" else (0.0,) * 4))
    feet = [b for b in ("l_foot", "r_foot") if b in model.body_names]
    targets = leading_targets(model, reference, feet, ROOT_DRIVE[1] / ROOT_DRIVE[0])

    body_q = np.empty((reference.frame_count, worlds, model.nbody, 7), np.float32)
    states = np.empty((reference.frame_count, worlds, model.nq), np.float32)
    body_q[0], states[0] = sim.body_q, sim.joint_q
    wall_time = 0.0
    for row in range(1, reference.frame_count):
        began = time.perf_counter()
        if step:
            step()
        else:
            sim.set_targets(targets[row])
            sim.step(1)
        states[row] = sim.joint_q
        wall_time += time.perf_counter() - began
        body_q[row] = sim.body_q
        if progress and row % 20 == 0:
            progress(row)
    sound = sim.status & NONFINITE == 0
    if not sound.any():
        raise FloatingPointError(
            "the simulation broke down (non-finite state); try --root tracked, or another clip"
        )
    time_in_play = _time_in_play(model, body_q) if ball is not None else np.zeros(worlds)
    best = int(np.argmax(np.where(sound, time_in_play, -1.0)))
    return measure(model, reference, body_q[:, best], states[:, best], wall_time)


def _put_ball(model, joint_q, joint_qd, ball: BallStart) -> None:
    """Set the ball of every world, in place; all but the first with a small variation."""
    q, dof = model.q_slice("ball"), model.dof_slice("ball")
    vary = np.random.default_rng(0).uniform(-1.0, 1.0, (len(joint_q), 6))
    vary[0] = 0.0
    joint_q[:, q.start : q.start + 3] = ball.position + vary[:, :3] * [0.015, 0.015, 0.0]
    joint_q[:, q.start + 3 : q.stop] = [0.0, 0.0, 0.0, 1.0]
    joint_qd[:, dof.start : dof.start + 3] = ball.velocity + vary[:, 3:] * [0.1, 0.1, 0.2]
    joint_qd[:, dof.start + 3 : dof.stop] = 0.0


def _time_in_play(model, body_q) -> np.ndarray:
    """Frames (worlds,) until the ball is more than a stride from the player's root or has stopped
    bouncing.

    body_q: (frames, worlds, nbody, 7).
    """
    ball = body_q[:, :, model.body("ball"), :3]
    root = body_q[:, :, pose.joint_body(model, root_joint(model)), :3]
    lost = np.linalg.norm((ball - root)[..., :2], axis=-1) > 0.9
    window = int(0.6 / model.timestep)
    low = ball[..., 2] < 0.3
    settled = np.cumsum(low, axis=0)
    settled[window:] -= settled[:-window].copy()
    lost |= settled >= window
    return np.where(lost.any(axis=0), lost.argmax(axis=0), len(lost))


def measure(model, reference: Reference, body_q, states, wall_time: float) -> Run:
    """A run, from what was recorded of it: body_q (frames, nbody, 7), states (frames, nq)."""
    wanted = pose.forward(model, reference.joint_q)
    root = pose.joint_body(model, root_joint(model))
    counted = [b for b in gaps.descendants(model, root) if model.body_mass[b] > LIGHT]
    off = np.linalg.norm(body_q[:, counted, :3] - wanted[:, counted, :3], axis=-1)
    joints = [n for n in model.joint_names if pose.joint_body(model, n) in counted]
    apart = difference(model, reference.joint_q, states.astype(float))
    angles = [
        np.linalg.norm(apart[:, model.dof_slice(n)], axis=-1) for n in joints if model.joint_type(n) != "free"
    ]
    return Run(
        reference=reference,
        body_q=body_q.astype(float),
        angle_error=np.mean(angles, axis=0) if angles else np.zeros(len(body_q)),
        position_error=off.mean(axis=1),
        fallen=body_q[:, root, 2] < FALLEN * wanted[:, root, 2],
        contacts=_contacts(model, body_q.astype(float)),
        wall_time=wall_time,
    )


def _contacts(model, body_q) -> dict[str, np.ndarray]:
    contacts = {}
    if "ball" in model.body_names:
        ball = model.body("ball")
        centre, radius = body_q[:, ball, :3], _shape(model, ball).size[0]
        contacts["ball on ground"] = _touches(centre[:, 2] - radius)
        for name, body in _named(model, {"right hand": "r_hand", "left hand": "l_hand"}):
            hand = gaps.descendants(model, body)
            gap = gaps.gap_to_bodies(model, body_q, hand, centre) - radius
            contacts[f"ball on {name}"] = _touches(gap)
    for name, body in _named(model, {"right foot": "r_foot", "left foot": "l_foot"}):
        foot = gaps.descendants(model, body)
        contacts[f"{name} down"] = gaps.lowest_point(model, body_q, foot) < TOUCH
    return contacts


def _touches(gap: np.ndarray) -> np.ndarray:
    """Where a gap (frames,) [m] is closed, also between two frames."""
    turns = np.zeros(len(gap), bool)
    turns[1:-1] = (gap[1:-1] <= gap[:-2]) & (gap[1:-1] <= gap[2:])
    reach = np.maximum(np.abs(np.diff(gap, prepend=gap[:1])), np.abs(np.diff(gap, append=gap[-1:])))
    return (gap < TOUCH) | (turns & (gap < TOUCH + reach))


def _named(model, names: dict[str, str]) -> list[tuple[str, int]]:
    """The names whose body the model has, with that body."""
    return [(n, model.body(b)) for n, b in names.items() if b in model.body_names]


def _shape(model, body: int):
    """The first shape of a body. Raises ValueError when it has none."""
    for shape in model.shapes:
        if shape.body == body:
            return shape
    raise ValueError(f"body '{model.body_names[body]}' of the model has no shape")
