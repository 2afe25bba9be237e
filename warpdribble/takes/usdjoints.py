"""The joints of a model as UsdPhysics: frames, limits, drives and the roots of articulations.

A hinge is a RevoluteJoint about the X axis of its frame. A ball joint is said in one of three ways:

revolute
    three RevoluteJoints between the same two bodies, about X, then Y, then Z: intrinsic Euler angles. MuJoCo
    reads them as the hinges of one body, Newton as one joint of three axes; PhysX would take them for a loop.
d6
    one PhysicsJoint with locked translations, three limits and three drives: Omniverse, Isaac, Newton.
spherical
    one SphericalJoint with a cone limit; the schema has no drive for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
Gains = tuple[float, float, float]
"""kp [N m/rad], kd [N m s/rad], effort [N m], ANYWHERE where it has no limit."""


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
    gains = (joint.kp, joint.kd, joint.effort) if joint.kp > 0.0 else None
    limits, armature = joint.limits, joint.armature
    at_start = frame0.R.inv() * turn * frame1.R
    if joint.kind != "ball":
        axis = Rotation.align_vectors([joint.axis], [[1.0, 0.0, 0.0]])[0]
        angle = float((axis.inv() * at_start * axis).as_rotvec()[0])
        limits = limits and (limits[0] - joint.zero, limits[1] - joint.zero)
        _revolute(stage, path, ends, frame0, frame1, axis, limits, gains, angle)
        _extend(stage.GetPrimAtPath(path), armature, angle)
        return
    euler = at_start.as_euler("XYZ")
    reach = limits and limits[1]
    if kind == "revolute":
        for k, angle in enumerate(euler):
            axis = Rotation.align_vectors([np.eye(3)[k]], [[1.0, 0.0, 0.0]])[0]
            both = None if reach is None else (-reach, reach)
            part = f"{path}_{AXES[k].lower()}"
            _revolute(stage, part, ends, frame0, frame1, axis, both, gains, angle)
            _extend(stage.GetPrimAtPath(part), armature)
    elif kind == "d6":
        _d6(stage, path, ends, frame0, frame1, reach, gains, euler)
        _extend(stage.GetPrimAtPath(path), armature)
    else:
        spherical = _joint(stage, UsdPhysics.SphericalJoint, path, ends, frame0, frame1)
        spherical.CreateAxisAttr(_bone_axis(model, joint))
        if reach is not None:
            spherical.CreateConeAngle0LimitAttr(min(np.degrees(reach), 179.0))
            spherical.CreateConeAngle1LimitAttr(min(np.degrees(reach), 179.0))


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
    gains: Gains | None,
    angle: float,
) -> None:
    aside = Frame(np.zeros(3), axis)
    joint = _joint(stage, UsdPhysics.RevoluteJoint, path, ends, frame0 @ aside, frame1 @ aside)
    joint.CreateAxisAttr("X")
    if limits:
        joint.CreateLowerLimitAttr(float(np.degrees(limits[0])))
        joint.CreateUpperLimitAttr(float(np.degrees(limits[1])))
    _drive(joint.GetPrim(), "angular", gains, angle)


def _d6(
    stage: Usd.Stage,
    path: str,
    ends: Ends,
    frame0: Frame,
    frame1: Frame,
    reach: float | None,
    gains: Gains | None,
    euler: np.ndarray,
) -> None:
    prim = _joint(stage, UsdPhysics.Joint, path, ends, frame0, frame1).GetPrim()
    for k, axis in enumerate(AXES):
        lock = UsdPhysics.LimitAPI.Apply(prim, f"trans{axis}")
        lock.CreateLowAttr(1.0)
        lock.CreateHighAttr(-1.0)
        if reach is not None:
            limit = UsdPhysics.LimitAPI.Apply(prim, f"rot{axis}")
            limit.CreateLowAttr(float(-np.degrees(reach)))
            limit.CreateHighAttr(float(np.degrees(reach)))
        _drive(prim, f"rot{axis}", gains, euler[k])


def _drive(prim: Usd.Prim, where: str, gains: Gains | None, angle: float) -> None:
    """A force drive to `angle` [rad]."""
    if gains is None:
        return
    drive = UsdPhysics.DriveAPI.Apply(prim, where)
    drive.CreateTypeAttr("force")
    drive.CreateStiffnessAttr(gains[0] * PER_DEGREE)
    drive.CreateDampingAttr(gains[1] * PER_DEGREE)
    if gains[2] < ANYWHERE:
        drive.CreateMaxForceAttr(gains[2])
    drive.CreateTargetPositionAttr(float(np.degrees(angle)))
    drive.CreateTargetVelocityAttr(0.0)


def _extend(prim: Usd.Prim, armature: float, angle: float | None = None) -> None:
    """What the schema has no word for, in the words of engines: armature [kg m^2], and for MuJoCo the angle
    [rad] at which a hinge starts, without which it would count limits from there."""
    said = {
        "NewtonJointAPI": ("newton:armature", Sdf.ValueTypeNames.Float, armature),
        "PhysxJointAPI": ("physxJoint:armature", Sdf.ValueTypeNames.Float, armature),
    }
    if angle is not None:
        said["MjcJointAPI"] = ("mjc:ref", Sdf.ValueTypeNames.Double, float(np.degrees(angle)))
    for schema, (name, kind, value) in said.items():
        prim.AddAppliedSchema(schema)
        prim.CreateAttribute(name, kind, custom=False).Set(value)


def _bone_axis(model: Model, joint: Joint) -> str:
    """The axis of a joint's frame that its bone runs along: towards the joints it carries, else its mass."""
    carried = [other.offset for other in model.joints if other.parent == joint.link]
    along = np.sum(carried, axis=0) if carried else joint.com
    return AXES[int(np.argmax(np.abs(along)))]


def _quatf(turn: Rotation) -> Gf.Quatf:
    x, y, z, w = turn.as_quat().tolist()
    return Gf.Quatf(w, x, y, z)
