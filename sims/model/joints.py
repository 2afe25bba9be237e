"""Joints: their kinds, what a model's file says of each, and where they are in joint_q and joint_qd."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

Kind = Literal["free", "ball", "hinge"]
KINDS: tuple[Kind, Kind, Kind] = ("free", "ball", "hinge")
FREE, BALL, HINGE = 0, 1, 2
"""Their numbers in the tables, which are the kernels' too."""
Q_SIZE, DOF_SIZE = (7, 4, 1), (6, 3, 1)
"""Coordinates and degrees of freedom of each kind."""


@dataclass(frozen=True)
class Joint:
    """A joint, and the link that it moves: the bodies behind it up to the next joints. All vectors are in the
    axes of links: those of the parent link, or of the own one, which is the joint's frame."""

    name: str
    kind: Kind
    link: int
    """The own link. Link 0 is the ground."""
    parent: int
    """The parent link."""
    body: int
    """The body that it moves."""
    q: slice
    """Its coordinates in joint_q: free, position [m] and quaternion xyzw; ball, quaternion; hinge, angle
    [rad]."""
    dof: slice
    """Its velocities in joint_qd."""
    offset: np.ndarray
    """(3,) [m], its place in the parent link."""
    turn: np.ndarray
    """(4,) xyzw, its frame in the parent link, at angle zero."""
    axis: np.ndarray
    """(3,) of a hinge, in its own frame and in that of its body."""
    zero: float
    """[rad] coordinate at which a hinge is as the file draws it."""
    limits: tuple[float, float] | None
    """[rad] least and largest angle; a ball joint's second is that about any axis. None where it has none."""
    kp: float
    """[N m/rad] of its drive, 0 without one."""
    kd: float
    """[N m s/rad]"""
    effort: float
    """[N m] largest torque of the drive, `mjcf.ANYWHERE` where it has no limit."""
    driven: bool
    armature: float
    """[kg m^2]"""
    damping: float
    """[N m s/rad] that no effort limit bounds."""
    stiffness: float
    """[N m/rad] of its spring, 0 without one."""
    rest: np.ndarray
    """Its coordinates where the spring is at rest."""
    com: np.ndarray
    """(3,) [m], centre of mass of the own link."""


@dataclass(frozen=True)
class Coordinates:
    """Which of a model's coordinates add and which turn. That is all there is to telling free, ball and hinge
    joints apart where poses are compared, moved or blended."""

    line_q: np.ndarray
    """(n,) where angles [rad] and positions [m] are in joint_q, ..."""
    line_dof: np.ndarray
    """(n,) ... and their rates in joint_qd."""
    turn_q: np.ndarray
    """(m, 4) where quaternions xyzw are in joint_q, ..."""
    turn_dof: np.ndarray
    """(m, 3) ... and their angular velocities in joint_qd."""


def coordinates(joints: Sequence[Joint]) -> Coordinates:
    """The coordinates of joints."""
    line_q, line_dof, turn_q, turn_dof = ([] for _ in range(4))
    for joint in joints:
        q, dof = (list(range(part.start, part.stop)) for part in (joint.q, joint.dof))
        if joint.kind != "hinge":
            turn_q.append(q[-4:])
            turn_dof.append(dof[-3:])
            q, dof = q[:-4], dof[:-3]
        line_q += q
        line_dof += dof
    return Coordinates(
        np.array(line_q, int),
        np.array(line_dof, int),
        np.array(turn_q, int).reshape(-1, 4),
        np.array(turn_dof, int).reshape(-1, 3),
    )
