"""Reference motion of a model: its joint coordinates over time, and how one cycle becomes many."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..planar import heading, over_ground, rotation, wrapped
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

    def velocity(self, model) -> np.ndarray:
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

    def repeat(self, model, count: int) -> Reference:
        """`count` cycles in a row, `count` x (frames - 1) + 1 rows. Raises ValueError when count
        < 1."""
        if count < 1:
            raise ValueError(f"a cycle is repeated at least once, not {count} times")
        body = self.reference.joint_q[:-1]
        pieces, start = [], self.reference.joint_q[:1]
        free = [model.q_slice(root_joint(model)), *self._carried(model)]
        for number in range(count):
            pieces.append(self._moved(body, free, number))
        pieces.append(self._moved(start, free, count))
        return replace(self.reference, joint_q=np.concatenate(pieces))

    def _carried(self, model) -> list[slice]:
        """Where what is loose and goes along, as a dribbled ball, is in joint_q."""
        loose = [model.q_slice(n) for n in model.joint_names[1:] if model.joint_type(n) == "free"]
        root, last = model.q_slice(root_joint(model)), self.reference.joint_q[-1]
        anchor = self.reference.joint_q[0, root][:2]
        along = []
        for part in loose:
            first = self.reference.joint_q[:1, part]
            goal = over_ground(first, anchor, anchor + np.asarray(self.travel), self.turn)[0]
            if np.linalg.norm(goal[:3] - last[part][:3]) < ALONG:
                along.append(part)
        return along

    def _moved(self, joint_q, free: list[slice], number: int) -> np.ndarray:
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


def close_cycle(model, reference: Reference, travel_above=0.25, turn_above=0.35) -> Cycle:
    """Make the end of a reference lead back to its first row (P1 7.1).

    What is missing is blended in over the last BLEND seconds, at most half the clip. The way over
    the ground is kept as the cycle's travel and turn when the root ends more than `travel_above`
    [m] or `turn_above` [rad] from where it began; a smaller one is drift of somebody who stays in
    place, and is closed too.
    """
    root = model.q_slice(root_joint(model))
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
    lines = model.dof_slice(root_joint(model)).start
    ahead = rotation(turn) @ _speed(model, reference, slice(0, 4))[lines : lines + 2]
    faster[lines : lines + 2] += ahead - _speed(model, reference, slice(0, 4))[lines : lines + 2]
    span = min(BLEND, 0.5 * reference.duration)
    before = reference.duration - reference.timestep * np.arange(reference.frame_count)
    share = np.clip(1.0 - before / span, 0.0, 1.0)[:, None]
    bend = smoothstep(share) * missing + share**2 * (share - 1.0) * span * faster
    closed = integrate(model, reference.joint_q, bend)
    size = np.sqrt(np.mean(missing[0, _joint_dofs(model)] ** 2))
    return Cycle(replace(reference, joint_q=closed), turn, tuple(travel.tolist()), float(size))


def _speed(model, reference: Reference, rows: slice) -> np.ndarray:
    """Mean velocity (nv,) over a few rows, which noise of single rows does not reach."""
    part = reference.joint_q[rows]
    return difference(model, part[:-1], part[1:]).mean(axis=0) / reference.timestep


def resample_q(model, joint_q: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Rows of joint_q (frames, nq) at fractional frame numbers `at` (n,): geodesics for
    rotations, lines for the rest."""
    out = interpolate_lines(joint_q, at)
    for start in model.quaternions():
        place = slice(start, start + 4)
        out[:, place] = interpolate_rotations(joint_q[:, place], at)
    return out


def difference(model, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The motion (..., nv) that carries joint coordinates `start` (..., nq) to `end` in unit
    time."""
    out = np.zeros((*start.shape[:-1], model.nv))
    for name in model.joint_names:
        q, dof = model.q_slice(name), model.dof_slice(name)
        if model.joint_type(name) == "hinge":
            out[..., dof] = end[..., q] - start[..., q]
        else:
            turn = slice(q.stop - 4, q.stop)
            out[..., dof.stop - 3 : dof.stop] = _turn(start[..., turn], end[..., turn])
        if model.joint_type(name) == "free":
            lines = slice(q.start, q.start + 3)
            out[..., dof.start : dof.start + 3] = end[..., lines] - start[..., lines]
    return out


def integrate(model, start: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Joint coordinates (..., nq) reached from `start` by `motion` (..., nv) in unit time;
    undoes `difference`."""
    out = np.array(start, dtype=float)
    for name in model.joint_names:
        q, dof = model.q_slice(name), model.dof_slice(name)
        if model.joint_type(name) == "hinge":
            out[..., q] += motion[..., dof]
        else:
            turn = slice(q.stop - 4, q.stop)
            by = Rotation.from_rotvec(motion[..., dof.stop - 3 : dof.stop].reshape(-1, 3))
            end = Rotation.from_quat(out[..., turn].reshape(-1, 4)) * by
            out[..., turn] = end.as_quat().reshape(out[..., turn].shape)
        if model.joint_type(name) == "free":
            out[..., q.start : q.start + 3] += motion[..., dof.start : dof.start + 3]
    return out


def root_joint(model) -> str:
    """Name of the free joint of the model's first tree. Raises ValueError when it has none."""
    name = model.joint_names[0]
    if model.joint_type(name) != "free":
        raise ValueError(f"the model's first joint '{name}' is not free: it has no root to move")
    return name


def _joint_dofs(model) -> np.ndarray:
    dofs = [model.dof_slice(n) for n in model.joint_names if model.joint_type(n) != "free"]
    return np.concatenate([np.arange(d.start, d.stop) for d in dofs])


def _turn(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    start, shape = Rotation.from_quat(start.reshape(-1, 4)), start.shape[:-1]
    return (start.inv() * Rotation.from_quat(end.reshape(-1, 4))).as_rotvec().reshape(*shape, 3)
