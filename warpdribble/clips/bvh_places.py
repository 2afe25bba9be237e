"""BVH joints with positions of their own (Bandai-Namco, MotionBuilder, Blender, ...): what they change.

A position stands in place of the joint's OFFSET; with some writers it is added to it. Most only say the
offset again. One that is constant is the bone's true length, one that changes is the joint's recorded place.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..sims.recording import anatomy
from ..sims.recording.motion import Motion
from ..sims.trees import below

NOTHING = 1e-3
"""Share of the way from the root to the farthest end that counts as no difference: 1 mm or so."""
ADDED = 0.2
"""Positions that are smaller than this share of what they differ from the offsets are added to these."""


@dataclass(frozen=True)
class Apart:
    """By how much the positions differ from the offsets."""

    joints: tuple[str, ...]
    worst: str
    distance: float
    """[file units] at the worst joint."""
    moving: bool
    """Whether some change over time."""

    def said(self, scale: float, used: bool) -> str:
        """A note; scale: metres per file unit."""
        more = f" and {len(self.joints) - 3} more" if len(self.joints) > 3 else ""
        how = "recorded places" if self.moving else "lengths of the bones"
        return (
            f"positions of {', '.join(self.joints[:3])}{more} differ from their offsets, by up to "
            f"{100.0 * scale * self.distance:.3g} cm at {self.worst}: "
            f"{f'used as {how}' if used else 'dropped'}"
        )


def carried(motion: Motion, steps: dict[int, np.ndarray]) -> tuple[Motion, dict[int, np.ndarray], str]:
    """A root that only carries the person, as MotionBuilder's Reference does, made one joint with the hips.

    steps: joint -> (frames, 3) its place in its parent's frame, where it has positions. Returns the motion,
    the steps by their new numbers, and a note or "".
    """
    chain = _carriers(motion)
    least = NOTHING * reach(motion)
    moved = [i for i, j in enumerate(chain) if j in steps and _apart(motion, j, steps[j]) > least]
    if not moved:
        return motion, steps, ""
    chain = chain[: moved[-1] + 1]
    kept = below(motion.parents, chain[-1])
    place = motion.root_position
    turn, rest = (Rotation.from_quat(r[..., 0, :]) for r in (motion.rotations, motion.rest_rotations))
    for joint in chain[1:]:
        place = place + turn.apply(steps.get(joint, motion.offsets[joint]))
        turn = turn * Rotation.from_quat(motion.rotations[:, joint])
        rest = rest * Rotation.from_quat(motion.rest_rotations[joint])
    rotations, rested = motion.rotations[:, kept], motion.rest_rotations[kept]
    rotations[:, 0], rested[0] = turn.as_quat(), rest.as_quat()
    number = {joint: i for i, joint in enumerate(kept)}
    one = Motion(
        joint_names=tuple(motion.joint_names[j] for j in kept),
        parents=np.array([-1, *(number[motion.parents[j]] for j in kept[1:])]),
        offsets=motion.offsets[kept],
        rotations=rotations,
        root_position=place,
        rate=motion.rate,
        rest_rotations=rested,
    )
    root = motion.joint_names[chain[-1]]
    gone = [name for name in motion.joint_names if name not in one.joint_names and not name.endswith("_end")]
    said = f"root taken as '{root}': what carries it moves with it ({', '.join(gone)})"
    return one, {number[j]: step for j, step in steps.items() if j in number and j != kept[0]}, said


def _carriers(motion: Motion) -> list[int]:
    """The root and what comes after it, as long as one child has all of the person below it."""
    found = anatomy.parts(motion.joint_names, motion.parents)
    chain = [0]
    while {"left_hip", "right_hip"} <= set(found):
        children = np.flatnonzero(motion.parents == chain[-1])
        whole = [int(c) for c in children if set(found.values()) <= set(below(motion.parents, int(c))) - {c}]
        if not whole:
            break
        chain.append(whole[0])
    return chain


def replaced(motion: Motion, steps: dict[int, np.ndarray], used: bool) -> tuple[Motion, Apart | None, str]:
    """The motion with the positions used, or not; how far they are from its offsets, and a note or ""."""
    said = ""
    joints = list(steps)
    apart = {j: _apart(motion, j, steps[j]) for j in joints}
    size = {j: np.linalg.norm(steps[j], axis=1).max() for j in joints}
    if sum(size.values()) < ADDED * sum(apart.values()):
        said = "positions are small: taken as added to the offsets"
        steps = {j: motion.offsets[j] + step for j, step in steps.items()}
        apart = size
    least = NOTHING * reach(motion)
    differ = [j for j in joints if apart[j] > least]
    if not differ:
        return motion, None, said
    worst = max(differ, key=lambda j: apart[j])
    moving = any(_extent(steps[j]) > least for j in differ)
    names = tuple(motion.joint_names[j] for j in differ)
    found = Apart(names, motion.joint_names[worst], apart[worst], moving)
    if not used:
        return motion, found, said
    offsets = motion.offsets.copy()
    for joint in differ:
        offsets[joint] = steps[joint].mean(axis=0)
    motion = replace(motion, offsets=offsets)
    if moving:
        motion = replace(motion, positions=_places(motion, {j: steps[j] for j in differ}))
    return motion, found, said


def reach(motion: Motion) -> float:
    """[file units] from the root to its farthest end, along the bones."""
    lengths = np.linalg.norm(motion.offsets, axis=1)
    along = np.zeros(len(lengths))
    for joint in range(1, len(lengths)):
        along[joint] = along[motion.parents[joint]] + lengths[joint]
    return float(along.max())


def _apart(motion: Motion, joint: int, step: np.ndarray) -> float:
    return float(np.linalg.norm(step - motion.offsets[joint], axis=1).max())


def _extent(step: np.ndarray) -> float:
    return float(np.linalg.norm(step - step.mean(axis=0), axis=1).max())


def _places(motion: Motion, steps: dict[int, np.ndarray]) -> np.ndarray:
    """Joint origins (frames, joints, 3) where some joints move in their parent's frame."""
    places, frames = motion.forward()
    for joint in range(1, len(motion.parents)):
        parent = motion.parents[joint]
        step = steps.get(joint, motion.offsets[joint])
        places[:, joint] = places[:, parent] + Rotation.from_quat(frames[:, parent]).apply(step)
    return places
