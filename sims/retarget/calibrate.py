"""The T-poses of a recording and of a model laid over each other: what turns one into the other, limb by
limb, and a T-pose for recordings that have none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model, pose
from ..recording.motion import Motion
from .mapping import Mapping, MappingError

STRAIGHT = np.radians(8.0)
"""A hinge that never bends more than this shows no axis."""
LEFT = np.array([0.0, 1.0, 0.0])
"""The model's left in its zero pose."""


def since_rest(motion: Motion, frames: np.ndarray) -> Callable[[str], Rotation]:
    """A function: joint -> Rotation (frames,), how far it has turned in the world since the T-pose. frames:
    (frames, joints, 4), joint frames in the world, of `Motion.forward`."""
    _, rest = motion.rest()

    def turned(joint: str) -> Rotation:
        i = motion.index(joint)
        return Rotation.from_quat(frames[:, i]) * Rotation.from_quat(rest[i]).inv()

    return turned


def match_limbs(
    model: Model, motion: Motion, mapping: Mapping, turned: Callable[[str], Rotation]
) -> dict[str, Rotation]:
    """Body of a limb -> what turns the model's zero pose into the recording's T-pose there.

    The limb's line is matched, and about it the hinge's axis, which the recording shows by how it bends.
    Hands continue the line of their arm, feet do not. turned: of `since_rest`.
    """
    match = {}
    rest_at, _ = motion.rest()
    zero = model.zero_pose
    for hinge, (near, middle, far) in mapping.limbs.items():
        upper, lower, end = pose.limb_bodies(model, hinge)
        own = zero[end, :3] - zero[upper, :3]
        theirs = rest_at[motion.index(far)] - rest_at[motion.index(near)]
        axis = model.joint_axis(hinge)
        shown = common_axis((turned(near).inv() * turned(middle)).as_rotvec())
        if shown is None:
            matched = shortest(own, theirs)
        else:
            matched = pose.frame_of(theirs, shown) * pose.frame_of(own, axis).inv()
        match[model.body_names[upper]] = match[model.body_names[lower]] = matched
        if hinge in mapping.arms:
            match[model.body_names[end]] = shortest(own, theirs)
    return match


def common_axis(bends: np.ndarray) -> np.ndarray | None:
    """The axis (3,) about which rotation vectors (frames, 3) [rad] turn, mostly forward; None when they are
    too small to tell."""
    if np.linalg.norm(bends, axis=1).max() < STRAIGHT:
        return None
    axis = np.linalg.eigh(bends.T @ bends)[1][:, -1]
    return axis if np.sum(bends @ axis) > 0.0 else -axis


def shortest(start: np.ndarray, end: np.ndarray) -> Rotation:
    """The smallest rotation that turns direction `start` into `end`; half a turn goes about the left."""
    start, end = start / np.linalg.norm(start), end / np.linalg.norm(end)
    axis = np.cross(start, end)
    sine = np.linalg.norm(axis)
    if sine < 1e-6:
        return Rotation.identity() if start @ end > 0.0 else Rotation.from_rotvec(np.pi * LEFT)
    return Rotation.from_rotvec(axis * (np.arctan2(sine, start @ end) / sine))


def rest_by_directions(model: Model, motion: Motion, mapping: Mapping) -> Motion:
    """The motion with a T-pose built for it: every bone points where the model's does in its zero pose.

    For files whose pose at zero angles is no T-pose. The pelvis is turned by its hips and spine, the bones
    after it by the smallest rotation from where they would be, so that nothing twists.
    """
    zero = model.zero_pose[:, :3]
    wanted = _directions(model, zero, motion, mapping)
    at, frames = replace(
        motion, rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (len(motion.joint_names), 1))
    ).rest()
    hips = [motion.index(mapping.bodies[b]) for b in _hip_bodies(model, mapping)]
    spine = next(j for j in reversed(_trunk(model, motion, mapping)) if at[j].any())
    local = Rotation.from_quat(frames[0]).inv()
    left = local.apply(at[hips[0]] - at[hips[1]])
    up = local.apply(at[spine] - 0.5 * (at[hips[0]] + at[hips[1]]))
    world = [pose.frame_of(LEFT, np.array([0.0, 0.0, 1.0])) * pose.frame_of(left, up).inv()]
    rest = [world[0]]
    for joint in range(1, len(at)):
        above = world[motion.parents[joint]]
        turn = Rotation.identity()
        if joint in wanted:
            bone, direction = wanted[joint]
            turn = shortest(above.apply(bone), direction)
        world.append(turn * above)
        rest.append(above.inv() * world[joint])
    return replace(motion, rest_rotations=np.stack([r.as_quat() for r in rest]))


def _hip_bodies(model: Model, mapping: Mapping) -> list[str]:
    """The bodies of both thighs, the left one first."""
    upper = [pose.limb_bodies(model, knee)[0] for knee in mapping.legs]
    zero = model.zero_pose
    return [model.body_names[b] for b in sorted(upper, key=lambda b: -zero[b, 1])]


def _directions(
    model: Model, zero: np.ndarray, motion: Motion, mapping: Mapping
) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Joint -> (its bone in its own frame, the model's direction of it in the zero pose)."""
    wanted = {}
    for hinge, joints in mapping.limbs.items():
        bodies = pose.limb_bodies(model, hinge)
        line = zero[bodies[2]] - zero[bodies[0]]
        for near, far in (joints[:2], joints[1:]):
            wanted[motion.index(near)] = (motion.offsets[motion.index(far)], line)
        if hinge in mapping.legs:
            foot = motion.index(joints[2])
            toes = [j for j in range(len(zero)) if j < len(motion.parents) and motion.parents[j] == foot]
            own = [b for b, parent in enumerate(model.body_parent) if parent == bodies[2]]
            if toes and own and motion.offsets[toes[0]].any():
                wanted[foot] = (motion.offsets[toes[0]], zero[own[0]] - zero[bodies[2]])
        else:
            shoulder, clavicle = motion.index(joints[0]), int(model.body_parent[bodies[0]])
            named = mapping.bodies.get(model.body_names[clavicle])
            if named is not None and motion.parents[shoulder] == motion.index(named):
                line = zero[bodies[0]] - zero[clavicle]
                wanted[motion.index(named)] = (motion.offsets[shoulder], line)
    for joint in _trunk(model, motion, mapping):
        if motion.parents[joint] > 0:
            wanted[int(motion.parents[joint])] = (motion.offsets[joint], np.array([0.0, 0.0, 1.0]))
    return {joint: (bone, line) for joint, (bone, line) in wanted.items() if bone.any()}


def _trunk(model: Model, motion: Motion, mapping: Mapping) -> list[int]:
    """The joints from the head down to the first behind the root."""
    head = model.roles.one("head")
    if head not in mapping.bodies:
        raise MappingError(f"{mapping.name}: bodies.{head}: missing; a T-pose by directions needs it")
    chain = [motion.index(mapping.bodies[head])]
    while motion.parents[chain[-1]] > 0:
        chain.append(int(motion.parents[chain[-1]]))
    return chain
