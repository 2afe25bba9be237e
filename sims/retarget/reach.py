"""Limbs brought to goals: legs to feet, arms to hands, each joint within its range; the root gives where a
leg is too short."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.spatial.transform import Rotation

from ..model import Model, gaps, pose
from ..model.joints import Joint
from ..signals import smoothstep

STRETCH = 0.998
"""Of a leg's length that it is stretched to at most; a straight knee jerks."""
SHRUG = 0.25
"""[rad] by which a clavicle is turned at most for a shoulder to come nearer to its goal."""
STRAIGHT = 0.02
"""[m] An elbow nearer to the line from shoulder to wrist does not say where it points."""
BEYOND = 0.5
"""[rad] A hand or foot that would have to turn this far beyond its range keeps the angles it has."""
SUNK = 0.001
"""[m] A foot or hand deeper than this in the ground is lifted out."""
LARGEST = 0.12
"""[m] by which the root is lowered at most."""


def reach(
    model: Model,
    joint_q: np.ndarray,
    hinge: str,
    end: np.ndarray,
    turn: Rotation,
    axis: np.ndarray | None = None,
) -> None:
    """Bend a limb of joint_q (frames, nq) in place so that its far body comes to `end` (frames, 3) [m]
    with rotation `turn`; the hinge keeps its direction in the world, or takes `axis` (frames, 3)."""
    upper, lower, last = pose.limb_bodies(model, hinge)
    if axis is None:
        axis = _turn(model, joint_q, lower).apply(model.joint_axis(hinge))
    wrist = model.q_slice(model.body_joint(last))
    before = Rotation.from_quat(joint_q[:, wrist])
    pose.place_limb(model, joint_q, hinge, end, turn, axis)
    for joint in (model.body_joint(upper), hinge):
        keep_range(model, joint_q, joint)
    # a hinge or ball stopped by its range leaves the far body turned: its own joint makes up for it
    wanted = _turn(model, joint_q, lower).inv() * turn
    largest = joint_range(model.joints[model.joint(model.body_joint(last))])[1]
    joint_q[:, wrist] = brought_within(wanted, largest, before).as_quat()


def lift_out(
    model: Model, joint_q: np.ndarray, hinge: str, end: np.ndarray | None, bodies: list[int]
) -> None:
    """Raise the end of a limb, in place, by as much as its bodies are below the ground: from `end` (frames,
    3) [m], or from where it is."""
    last = pose.limb_bodies(model, hinge)[2]
    body_q = pose.forward(model, joint_q, {last, *bodies})
    low = gaps.lowest_point(model, body_q, bodies)
    if low.min() < -SUNK:
        end = body_q[:, last, :3] if end is None else end
        end = end - np.minimum(low, 0.0)[:, None] * [0.0, 0.0, 1.0]
        reach(model, joint_q, hinge, end, Rotation.from_quat(body_q[:, last, 3:]))


def lower_root(model: Model, joint_q: np.ndarray, legs: dict[str, np.ndarray]) -> np.ndarray:
    """Lower the root in place until every leg reaches; legs: knee hinge -> ankle goal (frames, 3) [m].

    Returns by how much (frames,) [m], eased in and out.
    """
    limbs = {hinge: pose.limb_bodies(model, hinge) for hinge in legs}
    body_q = pose.forward(model, joint_q, [upper for upper, _, _ in limbs.values()])
    zero = model.zero_pose[:, :3]
    needed = np.zeros(len(joint_q))
    for hinge, ankle in legs.items():
        upper, lower, last = limbs[hinge]
        length = np.linalg.norm(zero[lower] - zero[upper]) + np.linalg.norm(zero[last] - zero[lower])
        apart = body_q[:, upper, :3] - ankle
        room = np.maximum((STRETCH * length) ** 2 - np.sum(apart[:, :2] ** 2, axis=1), 0.0)
        needed = np.maximum(needed, apart[:, 2] - np.sqrt(room))
    window = max(3, 2 * round(0.06 / model.timestep) + 1)
    eased = gaussian_filter1d(
        maximum_filter1d(np.minimum(needed, LARGEST), window, mode="nearest"), window / 5.0, mode="nearest"
    )
    joint_q[:, model.q_slice(model.root).start + 2] -= eased
    return eased


def shrug(model: Model, joint_q: np.ndarray, upper: int, goal: np.ndarray) -> None:
    """Turn the body before an upper arm, in place, so that the shoulder comes nearer to goal (frames, 3)
    [m]; by SHRUG at most."""
    clavicle = int(model.body_parent[upper])
    before = int(model.body_parent[clavicle])
    body_q = pose.forward(model, joint_q, (before, clavicle, upper))
    turn = Rotation.from_quat(body_q[:, clavicle, 3:])
    here, now = body_q[:, clavicle, :3], body_q[:, upper, :3]
    own, wanted = _unit(now - here), _unit(goal - here)
    axis = np.cross(own, wanted)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, np.sum(own * wanted, axis=1, keepdims=True))
    by = Rotation.from_rotvec(axis / np.maximum(sine, 1e-9) * SHRUG * np.tanh(angle / SHRUG))
    above = Rotation.from_quat(body_q[:, before, 3:])
    joint = model.body_joint(clavicle)
    joint_q[:, model.q_slice(joint)] = (above.inv() * by * turn).as_quat()
    keep_range(model, joint_q, joint)


def elbow_axis(
    model: Model, joint_q: np.ndarray, hinge: str, elbow: np.ndarray, wrist: np.ndarray
) -> np.ndarray:
    """Where the hinge's axis (frames, 3) should point for the elbow to come nearest to its goal (frames, 3)
    [m] with the wrist on its own; a nearly straight arm keeps the axis it has."""
    upper, lower, _ = pose.limb_bodies(model, hinge)
    body_q = pose.forward(model, joint_q, (upper, lower))
    now = Rotation.from_quat(body_q[:, lower, 3:]).apply(model.joint_axis(hinge))
    shoulder = body_q[:, upper, :3]
    line = _unit(wrist - shoulder)
    off = elbow - shoulder
    off = off - np.sum(off * line, axis=1, keepdims=True) * line
    return np.cross(off, line) + STRAIGHT * now


def _turn(model: Model, joint_q: np.ndarray, body: int) -> Rotation:
    """World rotation (frames,) of a body."""
    return Rotation.from_quat(pose.forward(model, joint_q, [body])[:, body, 3:])


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)


def keep_range(model: Model, joint_q: np.ndarray, joint: str) -> None:
    """Bring one joint of joint_q (frames, nq) into its range, in place."""
    own = model.joints[model.joint(joint)]
    low, high = joint_range(own)
    if own.kind == "hinge":
        joint_q[:, own.q] = np.clip(joint_q[:, own.q], low, high)
    elif own.kind == "ball":
        joint_q[:, own.q] = within(Rotation.from_quat(joint_q[:, own.q]), high).as_quat()


def brought_within(turn: Rotation, largest: float, instead: Rotation) -> Rotation:
    """Rotations cut back along their axis to an angle of `largest` [rad]; those far beyond become `instead`,
    as at half a turn the axis turns round and what is cut back jumps to the range's other side."""
    share = smoothstep(np.clip((turn.magnitude() - largest) / BEYOND, 0.0, 1.0))[:, None]
    # with w >= 0, quaternions within an angle are a cone: what lies between two of them is within it too
    cut, far = (r.as_quat(canonical=True) for r in (within(turn, largest), instead))
    return Rotation.from_quat((1.0 - share) * cut + share * far)


def within(turn: Rotation, largest: float) -> Rotation:
    """Rotations cut back along their axis to an angle of `largest` [rad]."""
    vector = turn.as_rotvec()
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return Rotation.from_rotvec(vector * np.minimum(1.0, largest / np.maximum(angle, 1e-9)))


def joint_range(joint: Joint) -> tuple[float, float]:
    """[rad] limits to keep of a joint (a ball joint's second is its largest angle), a hundredth inside those
    of the model; infinite where it has none."""
    if joint.limits is None:
        return -np.inf, np.inf
    low, high = joint.limits
    inside = 0.01 * (high - max(low, 0.0))
    return low + inside * (low < 0.0), high - inside
