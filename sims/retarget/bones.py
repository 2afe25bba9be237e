"""The bones of a recording that a mapping names, and where each points in a T-pose, the model's zero pose."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..model import Model, pose
from ..recording import anatomy
from ..recording.motion import Motion
from ..trees import path
from .mapping import Mapping, MappingError

LEFT, UP = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
"""Of the model in its zero pose."""
POINT = 1e-6
"""[m] What is shorter has no direction."""


@dataclass(frozen=True)
class Row:
    """Joints one after the other whose bones lie on one line in a T-pose."""

    joints: tuple[int, ...]
    bones: dict[int, np.ndarray]
    """Joint -> (3,) [m], its bone in its own frame; joints whose bone has a length."""
    line: np.ndarray
    """(3,) unit vector, where the bones point in a T-pose."""


@dataclass(frozen=True)
class Limb(Row):
    """An arm or a leg."""

    hinge: str
    """Joint of the model."""
    middle: int
    """Joint at the elbow or the knee."""
    end: Row
    """The hand or foot: from the limb's last joint on; without bones where the skeleton has no fingers or
    toes."""


@dataclass(frozen=True)
class Bones:
    """Rows of a recording's skeleton; pairs are left before right."""

    pelvis: int
    legs: tuple[Limb, ...]
    arms: tuple[Limb, ...]
    collars: tuple[Row, ...]
    spine: Row
    """From behind the pelvis to the head; without joints where the mapping has no head."""

    @property
    def limbs(self) -> tuple[Limb, ...]:
        return (*self.legs, *self.arms)

    @property
    def hips(self) -> list[int]:
        return [leg.joints[0] for leg in self.legs]

    @property
    def shoulders(self) -> list[int]:
        return [arm.joints[0] for arm in self.arms]

    def rows(self) -> tuple[Row, ...]:
        return (*self.limbs, *(limb.end for limb in self.limbs), *self.collars, self.spine)


def find_bones(model: Model, motion: Motion, mapping: Mapping) -> Bones:
    """The bones that a mapping names, in the motion's words. Raises MappingError for limbs that are none."""
    for table in ("legs", "arms"):
        if len(getattr(mapping, table)) != 2:
            raise MappingError(f"{mapping.name}: {table}: should be a left and a right one")
    root = model.body_names[model.joint_body(model.root)]
    if root not in mapping.bodies:
        raise MappingError(f"{mapping.name}: bodies.{root}: missing")
    pelvis = motion.index(mapping.bodies[root])
    left_first = sorted(mapping.limbs, key=lambda h: -model.zero_pose[pose.limb_bodies(model, h)[0], 1])
    limbs = [_limb(model, motion, mapping, hinge) for hinge in left_first]
    arms = tuple(limb for limb in limbs if limb.hinge in mapping.arms)
    return Bones(
        pelvis,
        tuple(limb for limb in limbs if limb.hinge in mapping.legs),
        arms,
        tuple(row for arm in arms for row in _collar(model, motion, mapping, arm)),
        _row(motion, _spine(model, motion, mapping, pelvis), UP),
    )


def _limb(model: Model, motion: Motion, mapping: Mapping, hinge: str) -> Limb:
    zero, parents = model.zero_pose[:, :3], motion.parents
    upper, _, end = pose.limb_bodies(model, hinge)
    near, middle, far = (motion.index(joint) for joint in mapping.limbs[hinge])
    row = _row(motion, path(parents, near, far), zero[end] - zero[upper])
    for a, b in ((near, middle), (middle, far)):
        part = path(parents, a, b)
        if not set(part) <= set(row.joints) or not set(part[:-1]) & set(row.bones):
            table = "arms" if hinge in mapping.arms else "legs"
            way = f"from {motion.joint_names[a]} to {motion.joint_names[b]}"
            raise MappingError(f"{mapping.name}: {table}.{hinge}: no bone leads {way}")
    line = row.line
    if hinge in mapping.legs:
        line = zero[model.children(end)[0]] - zero[end] if model.children(end) else np.array([1.0, 0.0, 0.0])
    return Limb(row.joints, row.bones, row.line, hinge, middle, _row(motion, _end(motion, far), line))


def _collar(model: Model, motion: Motion, mapping: Mapping, arm: Limb) -> list[Row]:
    """The row from an arm's collar bone to its shoulder; none where model, mapping or skeleton has none."""
    upper = pose.limb_bodies(model, arm.hinge)[0]
    collar = int(model.body_parent[upper])
    joint = mapping.bodies.get(model.body_names[collar])
    if joint is None or len(model.children(collar)) > 1:
        return []
    joints = path(motion.parents, motion.index(joint), arm.joints[0])
    return [_row(motion, joints, model.zero_pose[upper, :3] - model.zero_pose[collar, :3])] if joints else []


def _row(motion: Motion, joints: list[int], line: np.ndarray) -> Row:
    bones = {a: motion.offsets[b] for a, b in pairwise(joints)}
    bones = {a: bone for a, bone in bones.items() if np.linalg.norm(bone) > POINT}
    return Row(tuple(joints), bones, line / np.linalg.norm(line))


def _end(motion: Motion, joint: int) -> list[int]:
    """A foot's joint and the next toward the toes, a hand's and the next toward the longest finger; else that
    of its longest bone; only the joint itself where nothing hangs from it."""
    found = anatomy.parts(motion.joint_names, motion.parents)
    for side in anatomy.SIDES:
        for part in ("toe", "hand"):
            way = path(motion.parents, joint, found.get(f"{side}_{part}", 0))
            if len(way) > 1:
                return way[:2]
    lengths = {j: np.linalg.norm(motion.offsets[j]) for j in np.flatnonzero(motion.parents == joint)}
    return [joint, int(max(lengths, key=lengths.__getitem__))] if lengths else [joint]


def _spine(model: Model, motion: Motion, mapping: Mapping, pelvis: int) -> list[int]:
    """Joints from behind the pelvis to the head, and the head's end where only one hangs from it."""
    head = model.roles.head
    if head is None or head not in mapping.bodies:
        return []
    joints = path(motion.parents, pelvis, motion.index(mapping.bodies[head]))[1:]
    ends = [j for j, above in enumerate(motion.parents) if joints and above == joints[-1]]
    return joints + ends if len(ends) == 1 else joints
