"""Where a model's bodies are for given joint coordinates, on plain NumPy: what making motion
needs, off the simulator."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ..planar import wrapped

if TYPE_CHECKING:
    from .model import Model


def forward(model: Model, joint_q: ArrayLike, bodies: Iterable[int] | None = None) -> np.ndarray:
    """Body frames (frames, nbody, 7) [m, -], position and quaternion xyzw, for joint_q (frames, nq).

    bodies: whose frames are wanted, all by default; the others are NaN. -1, the world, may be among them.
    """
    joint_q = np.atleast_2d(np.asarray(joint_q, dtype=float))
    frames, links = len(joint_q), model.body_link
    wanted = range(model.nbody) if bodies is None else [body for body in bodies if body >= 0]
    needed = {0}
    for body in wanted:
        link = int(links[body])
        while link not in needed:
            needed.add(link)
            link = model.joints[link - 1].parent
    places, turns = {0: np.zeros((frames, 3))}, {0: Rotation.identity(frames)}
    for joint in model.joints:
        if joint.link not in needed:
            continue
        q, above = joint_q[:, joint.q], turns[joint.parent]
        place = places[joint.parent] + above.apply(joint.offset)
        turn = above * Rotation.from_quat(joint.turn)
        if joint.kind == "free":
            place, turn = q[:, :3].copy(), Rotation.from_quat(q[:, 3:])
        elif joint.kind == "ball":
            turn = turn * Rotation.from_quat(q)
        else:
            turn = turn * Rotation.from_rotvec((q - joint.zero) * joint.axis)
        places[joint.link], turns[joint.link] = place, turn
    body_q = np.full((frames, model.nbody, 7), np.nan)
    for body in wanted:
        place, turn = places[int(links[body])], turns[int(links[body])]
        body_q[:, body, :3] = place + turn.apply(model.body_offset[body])
        body_q[:, body, 3:] = (turn * Rotation.from_quat(model.body_turn[body])).as_quat()
    return body_q


def centres_of_mass(model: Model, body_q: np.ndarray) -> tuple[list[int], np.ndarray]:
    """The root and what hangs on it: indices of the bodies, and their centres of mass (frames, bodies, 3) [m]
    at body_q (frames, nbody, 7)."""
    own = model.descendants(model.joint_body(model.root))
    turns = (Rotation.from_quat(body_q[:, b, 3:]) for b in own)
    return own, np.stack(
        [body_q[:, b, :3] + turn.apply(model.body_com[b]) for b, turn in zip(own, turns)], axis=1
    )


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


def limb_bodies(model: Model, hinge: str) -> tuple[int, int, int]:
    """The bodies before the hinge, behind it, and at the far end of the limb that it bends. Raises ValueError
    for a hinge that bends no limb."""
    lower = model.joint_body(hinge)
    ends, upper = model.children(lower), int(model.body_parent[lower])
    if not ends or upper < 0:
        raise ValueError(f"the hinge '{hinge}' does not join two segments of a limb")
    return upper, lower, ends[0]


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

    def length(self, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (n,) [m] from the ball joint to the end joint at hinge angles (n,) [rad], and its slope
        (n,) [m/rad]; the other way round than `bend_for`."""
        a, b, c = self._cosine()
        far = np.sqrt(2.0 * (a * np.cos(angle) + b * np.sin(angle) + c))
        return far, (b * np.cos(angle) - a * np.sin(angle)) / far

    def bend_for(self, distance: np.ndarray) -> np.ndarray:
        """Hinge angle (n,) [rad] at which the end is `distance` (n,) [m] from the ball joint;
        clipped to reach."""
        a, b, c = self._cosine()
        wanted = 0.5 * np.asarray(distance) ** 2 - c
        reach = np.hypot(a, b)
        return np.arctan2(b, a) + np.arccos(np.clip(wanted / reach, -1.0, 1.0))

    def _cosine(self) -> tuple[float, float, float]:
        """A, B and C [m^2] of 0.5 |upper + R(axis, t) lower|^2 = A cos t + B sin t + C."""
        along = self.axis * (self.axis @ self.lower)
        squares = self.upper @ self.upper + self.lower @ self.lower
        a = self.upper @ (self.lower - along)
        b = self.upper @ np.cross(self.axis, self.lower)
        return float(a), float(b), float(0.5 * squares + self.upper @ along)

    def solve(self, start: np.ndarray, end: np.ndarray, hinge: np.ndarray) -> tuple[Rotation, np.ndarray]:
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


def limb(model: Model, hinge: str) -> Limb:
    """The limb that a hinge bends. Raises ValueError for a hinge that bends none."""
    upper, lower, last = limb_bodies(model, hinge)
    zero = model.zero_pose[:, :3]
    return Limb(zero[lower] - zero[upper], zero[last] - zero[lower], model.joint_axis(hinge))


def place_limb(
    model: Model, joint_q: np.ndarray, hinge: str, end: ArrayLike, end_turn: Rotation, axis: ArrayLike
) -> None:
    """Solve a limb of joint_q (frames, nq) in place.

    The body at the limb's far end gets its origin to `end` (3,) or (frames, 3) [m] and the world
    rotation `end_turn`; the hinge's axis points toward `axis` (3,) or (frames, 3) in the world.
    """
    upper, _, last = limb_bodies(model, hinge)
    above = int(model.body_parent[upper])
    own = limb(model, hinge)
    now = forward(model, joint_q, (upper, above))
    frames = len(joint_q)
    end, axis = (np.array(np.broadcast_to(v, (frames, 3))) for v in (end, axis))
    turn, angle = own.solve(now[:, upper, :3], end, axis)
    parent = Rotation.from_quat(now[:, above, 3:]) if above >= 0 else Rotation.identity()
    joint_q[:, model.q_slice(model.body_joint(upper))] = (parent.inv() * turn).as_quat()
    joint_q[:, model.q_slice(hinge)] = angle[:, None]
    beyond = turn * Rotation.from_rotvec(angle[:, None] * model.joint_axis(hinge))
    joint_q[:, model.q_slice(model.body_joint(last))] = (beyond.inv() * end_turn).as_quat()
