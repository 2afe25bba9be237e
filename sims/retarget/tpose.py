"""The T-pose of a recording: its rest pose where that is one, else built from where the bones point.

A T-pose is what both skeletons are laid over each other in. Few files have one: at zero angles arms hang, or
the person lies or is turned, or all bones lie along one axis of their joints. Where a person could stand or
sit like that, limbs that are off are turned into the T-pose, each by the smallest rotation; where nobody
could, it is built (see `directions`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model, pose
from ..recording.motion import Motion
from .bones import LEFT, POINT, UP, Bones, Limb, Row, find_bones
from .calibrate import shortest
from .directions import flat_feet, from_directions
from .mapping import Mapping, MappingError

OFF, BENT, END_OFF = np.radians([25.0, 12.0, 45.0])
"""[rad] A T-pose's limbs, its knees and elbows, its hands and feet are no farther from their lines. Feet of
some skeletons have the ankle high above the toes."""
STANDS = np.radians(45.0)
"""[rad] No person's hips, shoulders and trunk are farther from a T-pose's at rest."""
SITS = np.radians(80.0)
"""[rad] The same of the lines from hips to ankles: who sits shows a T-pose too."""


def t_pose(model: Model, motion: Motion, mapping: Mapping) -> tuple[Motion, tuple[str, ...]]:
    """The motion with a T-pose as its rest pose, and what was found or done that a user should know.

    Raises MappingError where no T-pose can be known: limbs without length, hips that do not show which side
    is left, feet that point backward.
    """
    bones = find_bones(model, motion, mapping)
    at, turns = motion.rest()
    whole = _turned_back(bones, at)
    rest = whole * Rotation.from_quat(turns)
    off = _off(motion, bones, rest)
    if mapping.rest == "recorded":
        return motion, (
            f"T-pose: the rest pose, as the mapping says, though off by degrees: {off}",
        ) if off else ()
    person = _is_person(bones, whole.apply(at))
    if not person or mapping.rest == "directions":
        built = from_directions(model, motion, mapping, flat_feet(motion, bones))
        why = "the mapping asks for it" if person else "nobody stands or sits as the rest pose does"
        return _with_rest(motion, built), (f"T-pose: built from the bones' directions and the clip; {why}",)
    _check_sides(motion, mapping, bones, rest)
    said = []
    if whole.magnitude():
        said.append(f"turned by {np.degrees(whole.magnitude()):.0f} degrees as a whole")
    if off:
        said.append(f"limbs laid into it that were off by degrees: {off}")
    if not said:
        return motion, ()
    rest = _straightened(flat_feet(motion, bones), rest)
    return _with_rest(motion, rest), (f"T-pose: the rest pose, {' and '.join(said)}",)


def _with_rest(motion: Motion, rest: Rotation) -> Motion:
    """The motion with joint frames (joints,) in the world as its rest pose."""
    local = [rest[0], *(rest[int(p)].inv() * rest[j] for j, p in enumerate(motion.parents) if p >= 0)]
    return replace(motion, rest_rotations=np.stack([turn.as_quat() for turn in local]))


def _frame(bones: Bones, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From right to left hip, and from the hips up to the shoulders; joint places (joints, 3) [m]."""
    hips, shoulders = at[bones.hips], at[bones.shoulders]
    return hips[0] - hips[1], shoulders.mean(axis=0) - hips.mean(axis=0)


def _turned_back(bones: Bones, at: np.ndarray) -> Rotation:
    """What turns the rest pose (joints, 3) as a whole to stand and face +X: nothing where it nearly does, and
    as few odd angles as may be, as leaning by some degrees is the skeleton's own."""
    left, up = _frame(bones, at)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    axis = min(axes, key=lambda one: _angle(up, one))
    up = axis if _angle(up, axis) < OFF else up
    if np.linalg.norm(np.cross(left, up)) < POINT:
        return Rotation.identity()
    turn = pose.frame_of(UP, LEFT) * pose.frame_of(up, left).inv()
    quarters = Rotation.create_group("O")
    apart = (quarters.inv() * turn).magnitude()
    nearest = quarters[int(np.argmin(apart))] if apart.min() < OFF else turn
    return nearest if nearest.magnitude() > OFF else Rotation.identity()


def _is_person(bones: Bones, at: np.ndarray) -> bool:
    """Whether it is a person who stands or sits: hips, shoulders, trunk and legs where they belong."""
    left, up = _frame(bones, at)
    across = at[bones.shoulders[0]] - at[bones.shoulders[1]]
    lines = [(left, LEFT, STANDS), (across, LEFT, STANDS), (up, UP, STANDS)]
    lines += [(at[leg.joints[-1]] - at[leg.joints[0]], leg.line, SITS) for leg in bones.legs]
    if bones.spine.joints:
        lines.append((at[bones.spine.joints[-1]] - at[bones.hips].mean(axis=0), UP, STANDS))
    return all(_angle(one, line) < most for one, line, most in lines)


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    """[rad] between two directions; half a turn where one is none."""
    lengths = np.linalg.norm(one) * np.linalg.norm(other)
    return float(np.arccos(np.clip(one @ other / lengths, -1.0, 1.0))) if lengths > POINT else np.pi


def _angles(row: Row, rest: Rotation) -> list[float]:
    """[rad] between each bone of a row and its line."""
    return [_angle(rest[joint].apply(bone), row.line) for joint, bone in row.bones.items()]


def _bend(limb: Limb, rest: Rotation) -> float:
    """[rad] between the limb's first and last bone."""
    first, last = (rest[j].apply(limb.bones[j]) for j in (min(limb.bones), max(limb.bones)))
    return _angle(first, last)


def _limb_off(limb: Limb, rest: Rotation) -> float:
    """[rad] by which an arm or leg is off; 0 for a T-pose's."""
    worst = max(_angles(limb, rest))
    return worst if worst > OFF or _bend(limb, rest) > BENT else 0.0


def _off(motion: Motion, bones: Bones, rest: Rotation) -> str:
    """What is off a T-pose in the rest pose, by degrees; empty when nothing is."""
    said = []
    for limb in bones.limbs:
        worst = _limb_off(limb, rest)
        if worst:
            said.append((motion.joint_names[limb.joints[0]], worst))
        elif max(_angles(limb.end, rest), default=0.0) > END_OFF:
            said.append((motion.joint_names[limb.joints[-1]], max(_angles(limb.end, rest))))
    for row in bones.collars:
        if max(_angles(row, rest), default=0.0) > END_OFF:
            said.append((motion.joint_names[row.joints[0]], max(_angles(row, rest))))
    words = [f"{joint} {np.degrees(angle):.0f}" for joint, angle in said]
    return ", ".join(words)


def _check_sides(motion: Motion, mapping: Mapping, bones: Bones, rest: Rotation) -> None:
    """Raise MappingError where what the names call left is right: then feet point backward."""
    ahead = [rest[j].apply(bone)[0] / np.linalg.norm(bone)
             for leg in bones.legs for j, bone in leg.end.bones.items()]  # fmt: skip
    if ahead and max(ahead) < -np.sin(STANDS):
        left = motion.joint_names[bones.hips[0]]
        raise MappingError(
            f"{mapping.name}: the feet point backward: {left} is on the right, the recording is "
            "mirrored or its sides are exchanged; give a mapping with left and right exchanged"
        )


def _straightened(bones: Bones, rest: Rotation) -> Rotation:
    """The rest pose (joints,) with each limb that is off laid onto its line, bone by bone."""
    turns = list(rest)

    def lay(row: Row) -> None:
        for joint, bone in row.bones.items():
            turns[joint] = shortest(turns[joint].apply(bone), row.line) * turns[joint]

    for limb in bones.limbs:
        if _limb_off(limb, rest):
            wrist = limb.joints[-1]
            lay(limb)
            if limb in bones.arms:
                before = max(limb.bones)
                turns[wrist] = turns[before] * rest[before].inv() * turns[wrist]
        if max(_angles(limb.end, Rotation.concatenate(turns)), default=0.0) > END_OFF:
            lay(limb.end)
    for row in bones.collars:
        if max(_angles(row, rest), default=0.0) > END_OFF:
            lay(row)
    return Rotation.concatenate(turns)
