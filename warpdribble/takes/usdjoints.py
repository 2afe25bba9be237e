"""The joints of a model as UsdPhysics: frames, limits, drives and the roots of articulations.

A hinge is a RevoluteJoint about the X axis of its frame. A ball joint is said in one of three ways:

revolute
    three RevoluteJoints between the same two bodies, about X, then Y, then Z: intrinsic Euler angles. MuJoCo
    reads them as the hinges of one body, Newton as one joint of three axes; PhysX would take them for a loop.
d6
    one PhysicsJoint with locked translations, three limits and three drives: Omniverse, Isaac, Newton.
spherical
    one SphericalJoint with a cone limit; the schema has no drive for it.

A spring and a damper are a drive too, one without a limit to its torque. Beside a servo that has a limit the
damper is `newton:damping`, and the spring is among what is `left_out`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
from scipy.spatial.transform import Rotation

from ..sims.model import Joint, Model
from ..sims.model.mjcf import ANYWHERE
from .names import prim_names

KINDS = ("revolute", "d6", "spherical")
PER_DEGREE = np.pi / 180.0
"""[rad] in a degree: a gain per radian times this is the gain per degree."""
AXES = "XYZ"
Ends = tuple[str | None, str]
"""Paths of the bodies that a joint ties: the parent's, None for the world, and the child's."""


class Drive(NamedTuple):
    """Of one axis: a torque kp (target - angle) - kd rate."""

    kp: float
    """[N m/rad]"""
    kd: float
    """[N m s/rad]"""
    effort: float
    """[N m], ANYWHERE where the torque has no limit"""
    target: float
    """[rad]"""


@dataclass(frozen=True)
class Frame:
    """A place and a turn in the axes of something else."""

    p: np.ndarray
    """(3,) [m]"""
    R: Rotation

    def __matmul__(self, other: Frame) -> Frame:
        return Frame(self.p + self.R.apply(other.p), self.R * other.R)

    def inverse(self) -> Frame:
        return Frame(-self.R.inv().apply(self.p), self.R.inv())


WORLD = Frame(np.zeros(3), Rotation.identity())


def add(
    stage: Usd.Stage, base: str, model: Model, body_q: np.ndarray, paths: dict[str, str], kind: str
) -> None:
    """Every joint of the model below `base`/Player/Joints. Drives hold the pose body_q (nbody, 7). paths: of
    the bodies, by name. Raises ValueError for a kind that is none."""
    if kind not in KINDS:
        raise ValueError(f"joints '{kind}': give one of {', '.join(KINDS)}")
    where = f"{base}/Player/Joints"
    legal = prim_names([*model.joint_names, *(f"{name} weld" for name in model.body_names)])
    for body, name in enumerate(model.body_names):
        if is_static(model, body):
            continue
        joints = model.body_joints(body)
        parent = int(model.body_parent[body])
        if [joint.kind for joint in joints] == ["free"]:
            if body in model.body_parent:
                UsdPhysics.ArticulationRootAPI.Apply(stage.GetPrimAtPath(paths[name]))
            continue
        if parent < 0 or is_static(model, parent):
            UsdPhysics.ArticulationRootAPI.Apply(stage.GetPrimAtPath(paths[name]))
        UsdGeom.Scope.Define(stage, where)
        ends = (paths[model.body_names[parent]] if parent >= 0 else None, paths[name])
        turn = _pose(body_q, parent).R.inv() * _pose(body_q, body).R
        if not joints:
            frame = _in_link(model, parent).inverse() @ _in_link(model, body)
            _joint(stage, UsdPhysics.FixedJoint, f"{where}/{legal[name + ' weld']}", ends, frame, WORLD)
        for joint, frame0, frame1 in _frames(model, parent, body, joints):
            path = f"{where}/{legal[joint.name]}"
            _add_joint(stage, path, model, joint, ends, frame0, frame1, turn, kind)


def left_out(model: Model, kind: str) -> list[str]:
    """What a model has and joints of a kind cannot say, a line each; empty where they say all."""
    lost = {
        "passive damping": [j.name for j in model.joints if j.kind == "free" and j.damping > 0.0],
        "armature": [j.name for j in model.joints if j.kind == "free" and j.armature > 0.0],
        "servo": [j.name for j in model.joints if _mute(j, kind) and j.kp > 0.0],
        "spring": [j.name for j in model.joints if j.stiffness > 0.0 and (_mute(j, kind) or _capped(j))],
    }
    return [f"{what} of {_some(names)}" for what, names in lost.items() if names]


def _some(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} others" if len(names) > 3 else "")


def _mute(joint: Joint, kind: str) -> bool:
    """Whether a joint is of a schema that has no drive."""
    return kind == "spherical" and joint.kind == "ball"


def _capped(joint: Joint) -> bool:
    """Whether a joint has a servo with an effort limit, which does not bound its spring and damper."""
    return joint.kp > 0.0 and joint.effort < ANYWHERE


def _drive_of(joint: Joint, angle: float, rest: float) -> Drive | None:
    """The drive of one axis: the servo holds `angle`, the spring pulls to `rest` [rad]."""
    if _capped(joint):
        return Drive(joint.kp, joint.kd, joint.effort, angle)
    kp, kd = joint.kp + joint.stiffness, joint.kd + joint.damping
    if kp == 0.0 and kd == 0.0:
        return None
    target = (joint.kp * angle + joint.stiffness * rest) / kp if kp > 0.0 else angle
    return Drive(kp, kd, ANYWHERE, target)


def is_static(model: Model, body: int) -> bool:
    """Whether a body is welded to the world."""
    return bool(model.body_link[body] == 0)


def _pose(body_q: np.ndarray, body: int) -> Frame:
    return WORLD if body < 0 else Frame(body_q[body, :3], Rotation.from_quat(body_q[body, 3:]))


def _in_link(model: Model, body: int) -> Frame:
    """A body's frame in that of its last link."""
    if body < 0:
        return WORLD
    return Frame(model.body_offset[body], Rotation.from_quat(model.body_turn[body]))


def _frames(
    model: Model, parent: int, body: int, joints: Sequence[Joint]
) -> list[tuple[Joint, Frame, Frame]]:
    """(joint, its frame in the parent body, its frame in the body), all joints at zero."""
    frame, frames = _in_link(model, parent).inverse(), []
    for joint in joints:
        frame = frame @ Frame(joint.offset, Rotation.from_quat(joint.turn))
        frames.append(frame)
    child = frames[-1] @ _in_link(model, body) if frames else frame
    return [(joint, f, child.inverse() @ f) for joint, f in zip(joints, frames)]


def _add_joint(
    stage: Usd.Stage,
    path: str,
    model: Model,
    joint: Joint,
    ends: Ends,
    frame0: Frame,
    frame1: Frame,
    turn: Rotation,
    kind: str,
) -> None:
    limits, armature = joint.limits, joint.armature
    damping = joint.damping if _capped(joint) or _mute(joint, kind) else 0.0
    at_start = frame0.R.inv() * turn * frame1.R
    if joint.kind != "ball":
        axis = Rotation.align_vectors([joint.axis], [[1.0, 0.0, 0.0]])[0]
        limits = limits and (limits[0] - joint.zero, limits[1] - joint.zero)
        rest = float(joint.rest[0]) - joint.zero
        near = float(np.mean(limits)) if limits else rest if joint.stiffness > 0.0 else 0.0
        angle = _nearest(float((axis.inv() * at_start * axis).as_rotvec()[0]), near)
        _revolute(stage, path, ends, frame0, frame1, axis, limits, _drive_of(joint, angle, rest))
        _extend(stage.GetPrimAtPath(path), armature, damping, angle)
        return
    euler = zip(at_start.as_euler("XYZ"), Rotation.from_quat(joint.rest).as_euler("XYZ"), strict=True)
    drives = [_drive_of(joint, float(angle), float(rest)) for angle, rest in euler]
    reach = limits and limits[1]
    if kind == "revolute":
        for k, drive in enumerate(drives):
            axis = Rotation.align_vectors([np.eye(3)[k]], [[1.0, 0.0, 0.0]])[0]
            both = None if reach is None else (-reach, reach)
            part = f"{path}_{AXES[k].lower()}"
            _revolute(stage, part, ends, frame0, frame1, axis, both, drive)
            _extend(stage.GetPrimAtPath(part), armature, damping)
    elif kind == "d6":
        _d6(stage, path, ends, frame0, frame1, reach, drives)
        _extend(stage.GetPrimAtPath(path), armature, damping)
    else:
        spherical = _joint(stage, UsdPhysics.SphericalJoint, path, ends, frame0, frame1)
        spherical.CreateAxisAttr(_bone_axis(model, joint))
        if reach is not None:
            spherical.CreateConeAngle0LimitAttr(min(np.degrees(reach), 179.0))
            spherical.CreateConeAngle1LimitAttr(min(np.degrees(reach), 179.0))
        if damping > 0.0:
            _extend(spherical.GetPrim(), armature, damping)


def _nearest(angle: float, near: float) -> float:
    """An angle [rad] by whole turns as near to another as can be: poses do not tell 230 degrees from -130."""
    return angle + 2.0 * np.pi * round((near - angle) / (2.0 * np.pi))


def _joint(
    stage: Usd.Stage, schema: type[UsdPhysics.Joint], path: str, ends: Ends, frame0: Frame, frame1: Frame
) -> UsdPhysics.Joint:
    joint = schema.Define(stage, path)
    if ends[0]:
        joint.CreateBody0Rel().SetTargets([ends[0]])
    joint.CreateBody1Rel().SetTargets([ends[1]])
    joint.CreateLocalPos0Attr(Gf.Vec3f(*frame0.p.tolist()))
    joint.CreateLocalPos1Attr(Gf.Vec3f(*frame1.p.tolist()))
    joint.CreateLocalRot0Attr(_quatf(frame0.R))
    joint.CreateLocalRot1Attr(_quatf(frame1.R))
    return joint


def _revolute(
    stage: Usd.Stage,
    path: str,
    ends: Ends,
    frame0: Frame,
    frame1: Frame,
    axis: Rotation,
    limits: tuple[float, float] | None,
    drive: Drive | None,
) -> None:
    aside = Frame(np.zeros(3), axis)
    joint = _joint(stage, UsdPhysics.RevoluteJoint, path, ends, frame0 @ aside, frame1 @ aside)
    joint.CreateAxisAttr("X")
    if limits:
        joint.CreateLowerLimitAttr(float(np.degrees(limits[0])))
        joint.CreateUpperLimitAttr(float(np.degrees(limits[1])))
    _drive(joint.GetPrim(), "angular", drive)


def _d6(
    stage: Usd.Stage,
    path: str,
    ends: Ends,
    frame0: Frame,
    frame1: Frame,
    reach: float | None,
    drives: Sequence[Drive | None],
) -> None:
    prim = _joint(stage, UsdPhysics.Joint, path, ends, frame0, frame1).GetPrim()
    for axis, drive in zip(AXES, drives, strict=True):
        lock = UsdPhysics.LimitAPI.Apply(prim, f"trans{axis}")
        lock.CreateLowAttr(1.0)
        lock.CreateHighAttr(-1.0)
        if reach is not None:
            limit = UsdPhysics.LimitAPI.Apply(prim, f"rot{axis}")
            limit.CreateLowAttr(float(-np.degrees(reach)))
            limit.CreateHighAttr(float(np.degrees(reach)))
        _drive(prim, f"rot{axis}", drive)


def _drive(prim: Usd.Prim, where: str, pull: Drive | None) -> None:
    """A force drive."""
    if pull is None:
        return
    drive = UsdPhysics.DriveAPI.Apply(prim, where)
    drive.CreateTypeAttr("force")
    drive.CreateStiffnessAttr(pull.kp * PER_DEGREE)
    drive.CreateDampingAttr(pull.kd * PER_DEGREE)
    if pull.effort < ANYWHERE:
        drive.CreateMaxForceAttr(pull.effort)
    drive.CreateTargetPositionAttr(float(np.degrees(pull.target)))
    drive.CreateTargetVelocityAttr(0.0)


def _extend(prim: Usd.Prim, armature: float, damping: float, angle: float | None = None) -> None:
    """What the schema has no word for, in the words of engines: armature [kg m^2], damping [N m s/rad] beside
    a servo, and for MuJoCo the angle [rad] at which a hinge starts, without which it would count limits from
    there."""
    number = Sdf.ValueTypeNames.Float
    said = [
        ("NewtonJointAPI", "newton:armature", number, armature),
        ("PhysxJointAPI", "physxJoint:armature", number, armature),
    ]
    if damping > 0.0:
        said.append(("NewtonJointAPI", "newton:damping", number, damping * PER_DEGREE))
    if angle is not None:
        said.append(("MjcJointAPI", "mjc:ref", Sdf.ValueTypeNames.Double, float(np.degrees(angle))))
    for schema in dict.fromkeys(schema for schema, *_ in said):
        prim.AddAppliedSchema(schema)
    for _, name, kind, value in said:
        prim.CreateAttribute(name, kind, custom=False).Set(value)


def _bone_axis(model: Model, joint: Joint) -> str:
    """The axis of a joint's frame that its bone runs along: towards the joints it carries, else its mass."""
    carried = [other.offset for other in model.joints if other.parent == joint.link]
    along = np.sum(carried, axis=0) if carried else joint.com
    return AXES[int(np.argmax(np.abs(along)))]


def _quatf(turn: Rotation) -> Gf.Quatf:
    x, y, z, w = turn.as_quat().tolist()
    return Gf.Quatf(w, x, y, z)
