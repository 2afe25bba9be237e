"""Where a model's bodies are for given joint coordinates, on plain NumPy: what making motion
needs, off the simulator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..planar import wrapped
from .model import JOINT_TYPES


def forward(model, joint_q: np.ndarray) -> np.ndarray:
    """Body frames (frames, nbody, 7) [m, -], position and quaternion xyzw, for joint_q (frames,
    nq)."""
    joint_q = np.atleast_2d(np.asarray(joint_q, dtype=float))
    t, frames = model.tables, len(joint_q)
    places, turns = [np.zeros((frames, 3))], [Rotation.identity(frames)]
    for link in range(1, len(t["link_parent"])):
        parent = t["link_parent"][link]
        turn = turns[parent] * Rotation.from_quat(t["link_turn"][link])
        place = places[parent] + turns[parent].apply(t["link_offset"][link])
        q = joint_q[:, t["link_q"][link] :]
        kind = JOINT_TYPES[t["link_joint"][link]]
        if kind == "free":
            place, turn = q[:, :3].copy(), Rotation.from_quat(q[:, 3:7])
        elif kind == "ball":
            turn = turn * Rotation.from_quat(q[:, :4])
        else:
            angle = q[:, :1] - t["link_zero"][link]
            turn = turn * Rotation.from_rotvec(angle * t["link_axis"][link])
        places.append(place)
        turns.append(turn)
    body_q = np.empty((frames, model.nbody, 7))
    for body, link in enumerate(t["body_link"]):
        body_q[:, body, :3] = places[link] + turns[link].apply(t["body_offset"][body])
        turn = turns[link] * Rotation.from_quat(t["body_turn"][body])
        body_q[:, body, 3:] = turn.as_quat()
    return body_q


def joint_body(model, joint: str) -> int:
    """The body that a joint moves against its parent."""
    return int(np.flatnonzero(model.tables["body_link"] == model.joint_link[model.joint(joint)])[0])


def body_joint(model, body: int) -> str:
    """The one joint that moves a body against its parent. Raises ValueError when there are none
    or several."""
    names = [n for n in model.joint_names if joint_body(model, n) == body]
    if len(names) != 1:
        raise ValueError(f"body '{model.body_names[body]}' has {len(names)} joints, not one")
    return names[0]


def zero_q(model) -> np.ndarray:
    """Joint coordinates (nq,) of the zero pose: free joints where the file puts them, every
    angle zero."""
    joint_q, t = np.zeros(model.nq), model.tables
    for name in model.joint_names:
        place, link = model.q_slice(name), model.joint_link[model.joint(name)]
        if model.joint_type(name) == "ball":
            joint_q[place.stop - 1] = 1.0
        elif model.joint_type(name) == "free":
            joint_q[place] = [*t["link_offset"][link], *t["link_turn"][link]]
        else:
            joint_q[place] = t["link_zero"][link]
    return joint_q


def twist(turn: Rotation, axis: np.ndarray) -> np.ndarray:
    """The angle (frames,) [rad] about `axis` that comes nearest to each rotation."""
    q = turn.as_quat()
    return wrapped(2.0 * np.arctan2(q[..., :3] @ axis, q[..., 3]))


def frame_of(direction: np.ndarray, toward: np.ndarray) -> Rotation:
    """The frame (n,) whose first axis is `direction` (n, 3) and whose second lies nearest
    `toward` (n, 3)."""
    first = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    second = toward - np.sum(toward * first, axis=-1, keepdims=True) * first
    second = second / np.linalg.norm(second, axis=-1, keepdims=True)
    return Rotation.from_matrix(np.stack([first, second, np.cross(first, second)], axis=-1))


def limb_bodies(model, hinge: str) -> tuple[int, int, int]:
    """The bodies before the hinge, behind it, and at the far end of the limb that it bends."""
    lower = joint_body(model, hinge)
    end = next((b for b, parent in enumerate(model.body_parent) if parent == lower), None)
    if end is None or model.body_parent[lower] < 0:
        raise ValueError(f"the hinge '{hinge}' does not join two segments of a limb")
    return int(model.body_parent[lower]), lower, end


@dataclass(frozen=True)
class Limb:
    """Two segments with a hinge between them: an arm or a leg.

    All vectors are in the zero pose, where the body frames are aligned with the world.
    """

    upper: np.ndarray
    """(3,) [m], from the ball joint to the hinge."""
    lower: np.ndarray
    """(3,) [m], from the hinge to the end joint."""
    axis: np.ndarray
    """(3,), the hinge's axis; it bends the limb at positive angles."""

    def bend_for(self, distance: np.ndarray) -> np.ndarray:
        """Hinge angle (n,) [rad] at which the end is `distance` (n,) [m] from the ball joint;
        clipped to reach.

        |upper + R(axis, t) lower|^2 = distance^2 is A cos t + B sin t + C = const.
        """
        along = self.axis * (self.axis @ self.lower)
        a = self.upper @ (self.lower - along)
        b = self.upper @ np.cross(self.axis, self.lower)
        c = self.upper @ along
        sum_of_squares = self.upper @ self.upper + self.lower @ self.lower
        wanted = 0.5 * (np.asarray(distance) ** 2 - sum_of_squares) - c
        reach = np.hypot(a, b)
        return np.arctan2(b, a) + np.arccos(np.clip(wanted / reach, -1.0, 1.0))

    def solve(self, start: np.ndarray, end: np.ndarray, hinge: np.ndarray):
        """World rotation (n,) of the upper segment and hinge angle (n,) [rad] that put the end
        joint at `end`.

        start, end: (n, 3) [m] in the world; hinge: (n, 3), where the hinge's axis should point in
        the world.
        """
        reach = end - start
        angle = self.bend_for(np.linalg.norm(reach, axis=-1))
        bent = Rotation.from_rotvec(angle[:, None] * self.axis).apply(self.lower)
        own = frame_of(self.upper + bent, np.tile(self.axis, (len(bent), 1)))
        return frame_of(reach, hinge) * own.inv(), angle


def place_limb(model, joint_q, hinge: str, end, end_turn: Rotation, axis) -> None:
    """Solve a limb of joint_q (frames, nq) in place.

    The body at the limb's far end gets its origin to `end` (3,) or (frames, 3) [m] and the world
    rotation `end_turn`; the hinge's axis points toward `axis` (3,) or (frames, 3) in the world.
    """
    upper, lower, last = limb_bodies(model, hinge)
    zero = forward(model, zero_q(model))[0, :, :3]
    limb = Limb(zero[lower] - zero[upper], zero[last] - zero[lower], model.joint_axis(hinge))
    now = forward(model, joint_q)
    frames = len(joint_q)
    end, axis = (np.array(np.broadcast_to(v, (frames, 3))) for v in (end, axis))
    turn, angle = limb.solve(now[:, upper, :3], end, axis)
    parent = Rotation.from_quat(now[:, model.body_parent[upper], 3:])
    joint_q[:, model.q_slice(body_joint(model, upper))] = (parent.inv() * turn).as_quat()
    joint_q[:, model.q_slice(hinge)] = angle[:, None]
    beyond = turn * Rotation.from_rotvec(angle[:, None] * model.joint_axis(hinge))
    joint_q[:, model.q_slice(body_joint(model, last))] = (beyond.inv() * end_turn).as_quat()
