"""Reference motion of a model: its joint coordinates over time, and how one cycle becomes many."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model
from ..planar import heading, over_ground, planar, rotation, wrapped
from ..signals import interpolate_lines, interpolate_rotations, smoothstep

ALONG = 0.05
"""[m] What is loose goes along with a cycle that it ends this near to where the next begins."""
BLEND = 0.4
"""[s] at the end of a clip in which it is bent back to its beginning."""


@dataclass(frozen=True)
class Reference:
    """What the model should do, one row per time step."""

    joint_q: np.ndarray
    """(frames, nq) [m, rad, -], as `Simulation.joint_q`."""
    timestep: float
    """[s] between rows."""

    @property
    def frame_count(self) -> int:
        return len(self.joint_q)

    @property
    def duration(self) -> float:
        """[s] from the first to the last row."""
        return (self.frame_count - 1) * self.timestep

    def velocity(self, model: Model) -> np.ndarray:
        """joint_qd (frames, nv) [m/s, rad/s] by differences to the next row (the last row keeps
        its own)."""
        if self.frame_count < 2:
            return np.zeros((self.frame_count, model.nv))
        steps = difference(model, self.joint_q[:-1], self.joint_q[1:]) / self.timestep
        return np.concatenate([steps, steps[-1:]])


@dataclass(frozen=True)
class Cycle:
    """A reference whose last row is the first one again, moved over the ground."""

    reference: Reference
    """The closed cycle; its last row begins the next."""
    turn: float = 0.0
    """[rad] about the vertical per cycle."""
    travel: tuple[float, float] = (0.0, 0.0)
    """(2,) [m] of the root over the ground per cycle, seen from the cycle's first root position."""
    gap: float = 0.0
    """[rad] root mean square over the model's joints of what had to be closed."""

    @property
    def way(self) -> tuple[float, float]:
        """(2,) [m] of the root per cycle, ahead and to the left, as the player faces in the mean of a cycle;
        where it turns, as it faces at the cycle's begin."""
        faces = np.unwrap(planar(self.reference.joint_q)[:, 2])
        begin = float(np.mean(faces - self.turn * np.linspace(0.0, 1.0, len(faces))))
        ahead, left = rotation(-begin) @ np.asarray(self.travel)
        return float(ahead), float(left)

    @classmethod
    def of(cls, model: Model, reference: Reference) -> Cycle:
        """The cycle of a reference that is one: its last row is the first, moved straight over the ground or
        not at all."""
        place = reference.joint_q[:, model.q_slice(model.root)][:, :2]
        return cls(reference, travel=tuple((place[-1] - place[0]).tolist()))

    def repeat(self, model: Model, count: int) -> Reference:
        """`count` cycles in a row, `count` x (frames - 1) + 1 rows. Raises ValueError when count
        < 1."""
        if count < 1:
            raise ValueError(f"a cycle is repeated at least once, not {count} times")
        body = self.reference.joint_q[:-1]
        pieces, start = [], self.reference.joint_q[:1]
        free = [model.q_slice(model.root), *self._carried(model)]
        for number in range(count):
            pieces.append(self._moved(body, free, number))
        pieces.append(self._moved(start, free, count))
        return replace(self.reference, joint_q=np.concatenate(pieces))

    def ahead(self, model: Model, poses: np.ndarray) -> np.ndarray:
        """Where poses (n, 7) [m, -] or points (n, 3) [m] of a cycle are in the next one."""
        anchor = self.reference.joint_q[0, model.q_slice(model.root)][:2]
        return over_ground(poses, anchor, anchor + np.asarray(self.travel), self.turn)

    def behind(self, model: Model, poses: np.ndarray) -> np.ndarray:
        """Where poses (n, 7) [m, -] or points (n, 3) [m] of a cycle were in the one before."""
        anchor = self.reference.joint_q[0, model.q_slice(model.root)][:2]
        return over_ground(poses, anchor + np.asarray(self.travel), anchor, -self.turn)

    def _carried(self, model: Model) -> list[slice]:
        """Where what is loose and goes along, as a dribbled ball, is in joint_q."""
        loose = [joint.q for joint in model.joints[1:] if joint.kind == "free"]
        first, last = self.reference.joint_q[:1], self.reference.joint_q[-1]
        goals = [self.ahead(model, first[:, part])[0] for part in loose]
        return [part for part, goal in zip(loose, goals) if np.linalg.norm(goal[:3] - last[part][:3]) < ALONG]

    def _moved(self, joint_q: np.ndarray, free: list[slice], number: int) -> np.ndarray:
        """Rows joint_q (n, nq) in the cycle of that number: the root and all that is loose, as the ball, are
        further on."""
        anchor = self.reference.joint_q[0, free[0]][:2]
        place = np.zeros(2)
        for i in range(number):
            place = place + rotation(i * self.turn) @ np.asarray(self.travel)
        joint_q = joint_q.copy()
        for part in free:
            joint_q[:, part] = over_ground(joint_q[:, part], anchor, anchor + place, number * self.turn)
        return joint_q


def close_cycle(
    model: Model, reference: Reference, travel_above: float = 0.25, turn_above: float = 0.35
) -> Cycle:
    """Make the end of a reference lead back to its first row (P1 7.1).

    What is missing is blended in over the last BLEND seconds, at most half the clip. The way over
    the ground is kept as the cycle's travel and turn when the root ends more than `travel_above`
    [m] or `turn_above` [rad] from where it began; a smaller one is drift of somebody who stays in
    place, and is closed too.
    """
    root = model.q_slice(model.root)
    first, last = reference.joint_q[0], reference.joint_q[-1]
    turn = float(wrapped(heading(last[root][3:]) - heading(first[root][3:])))
    travel = last[root][:2] - first[root][:2]
    if np.linalg.norm(travel) < travel_above and abs(turn) < turn_above:
        turn, travel = 0.0, np.zeros(2)
    goal = first.copy()
    anchor = first[root][:2]
    goal[root] = over_ground(first[root][None], anchor, anchor + travel, turn)[0]
    missing = difference(model, last[None], goal[None])
    faster = _speed(model, reference, slice(0, 4)) - _speed(model, reference, slice(-4, None))
    if reference.frame_count < 8:
        faster[:] = 0.0
    lines = model.dof_slice(model.root).start
    ahead = rotation(turn) @ _speed(model, reference, slice(0, 4))[lines : lines + 2]
    faster[lines : lines + 2] += ahead - _speed(model, reference, slice(0, 4))[lines : lines + 2]
    share, span = closing(reference)
    bend = smoothstep(share) * missing + share**2 * (share - 1.0) * span * faster
    closed = integrate(model, reference.joint_q, bend)
    size = np.sqrt(np.mean(missing[0, _joint_dofs(model)] ** 2))
    return Cycle(replace(reference, joint_q=closed), turn, tuple(travel.tolist()), float(size))


def closing(reference: Reference) -> tuple[np.ndarray, float]:
    """How far (frames, 1) the end of a clip has come, from 0 to 1, in being bent back to its beginning; and
    how long [s] that takes."""
    span = min(BLEND, 0.5 * reference.duration)
    before = reference.duration - reference.timestep * np.arange(reference.frame_count)
    return np.clip(1.0 - before / span, 0.0, 1.0)[:, None], span


def _speed(model: Model, reference: Reference, rows: slice) -> np.ndarray:
    """Mean velocity (nv,) over a few rows, which noise of single rows does not reach."""
    part = reference.joint_q[rows]
    return difference(model, part[:-1], part[1:]).mean(axis=0) / reference.timestep


def resample_q(model: Model, joint_q: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Rows of joint_q (frames, nq) at fractional frame numbers `at` (n,): geodesics for
    rotations, lines for the rest."""
    turns = model.coordinates.turn_q
    out = interpolate_lines(joint_q, at)
    out[:, turns] = interpolate_rotations(joint_q[:, turns], at)
    return out


def difference(model: Model, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The motion (..., nv) that carries joint coordinates `start` (..., nq) to `end` in unit
    time."""
    at, out = model.coordinates, np.zeros((*start.shape[:-1], model.nv))
    out[..., at.line_dof] = end[..., at.line_q] - start[..., at.line_q]
    before, after = (Rotation.from_quat(q[..., at.turn_q].reshape(-1, 4)) for q in (start, end))
    turn = (before.inv() * after).as_rotvec()
    out[..., at.turn_dof] = turn.reshape(*start.shape[:-1], *at.turn_dof.shape)
    return out


def integrate(model: Model, start: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Joint coordinates (..., nq) reached from `start` by `motion` (..., nv) in unit time;
    undoes `difference`."""
    at, out = model.coordinates, np.array(start, dtype=float)
    out[..., at.line_q] += motion[..., at.line_dof]
    before = Rotation.from_quat(out[..., at.turn_q].reshape(-1, 4))
    after = before * Rotation.from_rotvec(motion[..., at.turn_dof].reshape(-1, 3))
    out[..., at.turn_q] = after.as_quat().reshape(*out.shape[:-1], *at.turn_q.shape)
    return out


def _joint_dofs(model: Model) -> np.ndarray:
    """Where the velocities of all but free joints are in joint_qd."""
    return np.concatenate([np.arange(model.nv)[joint.dof] for joint in model.joints if joint.kind != "free"])
