"""A T-pose for a recording whose rest pose is none: every bone is laid onto its line.

A line leaves one thing open, the turn about it. That is told by a second direction (hips, collar bones,
knuckles, the axis that a knee or an elbow bends about), else by the clip: on average nobody twists a bone
against the next one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model, pose
from ..recording.motion import Motion
from .bones import LEFT, POINT, Bones, Limb
from .calibrate import shortest
from .mapping import Mapping, MappingError

SHOWN = np.sin(np.radians(8.0))
"""[-] A hinge whose bends have a smaller mean sine shows no axis."""
QUARTER = np.radians(20.0)
"""[rad] Most skeletons' joint frames are quarter turns apart: a twist this near to one is taken for it."""
LEAN = np.radians(8.0)
"""[rad] From the middle of the hips to the beginning of the spine, backward: 4 (Mixamo) to 14 (CMU)."""
LOW, FLAT = 0.03, np.radians([5.0, 45.0])
"""[m] A foot is flat while ankle and toes are no higher than this above their lowest, [rad] and its bone then
points down by an angle within this range."""
MOST = 200
"""Frames of the clip that are looked at."""
Lines = tuple[np.ndarray, np.ndarray]
"""A direction in a joint's own frame, and where it points in a T-pose; both (3,)."""


def from_directions(model: Model, motion: Motion, mapping: Mapping, bones: Bones) -> Rotation:
    """Joint frames (joints,) of a T-pose. Raises MappingError where the skeleton does not show one."""
    if not bones.spine.joints:
        raise MappingError(f"{mapping.name}: bodies: names no head; a T-pose from directions needs it")
    some = np.linspace(0, motion.frame_count - 1, min(motion.frame_count, MOST)).astype(int)
    motion = replace(
        motion,
        rotations=motion.rotations[some],
        root_position=motion.root_position[some],
        positions=None,
        ball=None,
        ball_held=None,
    )
    at, frames = motion.forward()
    lines = {joint: (bone, row.line) for row in bones.rows() for joint, bone in row.bones.items()}
    seconds = _across(motion, bones)
    for limb in bones.limbs:
        seconds |= _hinge_axes(model, limb, at, frames)
    rest: list[Rotation] = []
    for joint, above in enumerate(motion.parents):
        parent = rest[int(above)] if above >= 0 else Rotation.identity()
        seen = parent * Rotation.from_quat(motion.rotations[:, joint])
        if joint == bones.pelvis:
            rest.append(_pelvis(mapping, bones, at, Rotation.from_quat(frames[:, joint])))
        elif joint not in lines:
            rest.append(seen.mean())
        elif joint in seconds:
            (bone, line), (side, toward) = lines[joint], seconds[joint]
            rest.append(pose.frame_of(line, toward) * pose.frame_of(bone, side).inv())
        else:
            zero = parent * Rotation.from_quat(motion.rest_rotations[joint])
            rest.append(
                _twisted(_laid(zero, *lines[joint]), _laid(seen, *lines[joint]).mean(), lines[joint][1])
            )
    return Rotation.concatenate(rest)


def flat_feet(motion: Motion, bones: Bones) -> Bones:
    """The bones with the feet's lines as they are while the feet stand flat in the clip, where they do: how
    high the ankle is above the toes differs between skeletons."""
    at = motion.forward()[0]
    legs = []
    for leg in bones.legs:
        foot = leg.end
        if foot.bones:
            ankle, toes = at[:, foot.joints[0], 2], at[:, foot.joints[1], 2]
            flat = [z < np.quantile(z, 0.05) + LOW for z in (ankle, toes)]
            down = (ankle - toes)[flat[0] & flat[1]] / np.linalg.norm(foot.bones[foot.joints[0]])
            angle = np.arcsin(np.clip(np.median(down), -1.0, 1.0)) if len(down) else 0.0
            if FLAT[0] < angle < FLAT[1]:
                foot = replace(foot, line=np.array([np.cos(angle), 0.0, -np.sin(angle)]))
        legs.append(replace(leg, end=foot))
    return replace(bones, legs=tuple(legs))


def _laid(turns: Rotation, bone: np.ndarray, line: np.ndarray) -> Rotation:
    """Rotations turned on, each by the smallest rotation, so that they lay a bone onto its line."""
    return shortest(turns.apply(bone), line) * turns


def _twisted(drawn: Rotation, mean: Rotation, line: np.ndarray) -> Rotation:
    """`drawn`, turned about the line by the quarter turns that come near to `mean`; `mean` where none do."""
    angle = float(pose.twist(mean * drawn.inv(), line))
    quarters = np.round(angle / (np.pi / 2)) * (np.pi / 2)
    return Rotation.from_rotvec(quarters * line) * drawn if abs(angle - quarters) < QUARTER else mean


def _pelvis(mapping: Mapping, bones: Bones, at: np.ndarray, turns: Rotation) -> Rotation:
    """The pelvis, by its hips and the beginning of the spine as they lie in it throughout the clip. at: of
    all joints, turns: (frames,) of the pelvis."""
    middle = at[:, bones.hips].mean(axis=1)
    left = turns.inv().apply(at[:, bones.hips[0]] - at[:, bones.hips[1]]).mean(axis=0)
    for joint in bones.spine.joints:
        up = turns.inv().apply(at[:, joint] - middle).mean(axis=0)
        begins = np.linalg.norm(at[0, joint] - at[0, bones.pelvis]) > POINT
        if begins and np.linalg.norm(np.cross(up, left)) > POINT**2:
            behind = np.array([-np.sin(LEAN), 0.0, np.cos(LEAN)])
            return pose.frame_of(LEFT, behind) * pose.frame_of(left, up).inv()
    raise MappingError(f"{mapping.name}: the hips and the spine do not show which way is left")


def _across(motion: Motion, bones: Bones) -> dict[int, Lines]:
    """Joint -> a direction across its bone that other bones show: collar bones at the chest, knuckles."""
    found = {}
    collars = [row.joints[0] for row in bones.collars]
    for left, right in (collars if len(collars) == 2 else bones.shoulders, bones.shoulders):
        across = motion.offsets[left] - motion.offsets[right]
        if motion.parents[left] == motion.parents[right] and np.linalg.norm(across) > POINT:
            found[int(motion.parents[left])] = across, LEFT
    for arm in bones.arms:
        wrist = arm.joints[-1]
        fingers = {motion.joint_names[j].lower(): j for j in np.flatnonzero(motion.parents == wrist)}
        index = [j for name, j in fingers.items() if "index" in name]
        little = [j for name, j in fingers.items() if "pinky" in name or "little" in name]
        if index and little:
            found[wrist] = motion.offsets[index[0]] - motion.offsets[little[0]], np.array([1.0, 0.0, 0.0])
    return found


def _hinge_axes(model: Model, limb: Limb, at: np.ndarray, frames: np.ndarray) -> dict[int, Lines]:
    """Joints at both bones of a limb -> the axis that its hinge bends about, where the clip bends it. at,
    frames: of `Motion.forward`."""
    near, middle, far = limb.joints[0], limb.middle, limb.joints[-1]
    upper, lower = at[:, middle] - at[:, near], at[:, far] - at[:, middle]
    normal = np.cross(upper, lower) / (np.linalg.norm(upper, axis=1) * np.linalg.norm(lower, axis=1))[:, None]
    found = {}
    for joint in (near, middle):
        own = Rotation.from_quat(frames[:, joint]).inv().apply(normal).mean(axis=0)
        if np.linalg.norm(own) > SHOWN:
            found[joint] = own, model.joint_axis(limb.hinge)
    return found
