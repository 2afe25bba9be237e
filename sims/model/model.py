"""`Model`: what a character is made of, the same for every world."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from ...assets import path as asset
from ..trees import below
from .joints import DOF_SIZE, KINDS, Q_SIZE, Coordinates, Joint, Kind, coordinates
from .load import read_model
from .loose import loose_tables
from .mjcf import ModelError, Shape
from .pose import forward
from .roles import Roles, find_roles
from .slots import Pair


@dataclass
class Model:
    """An articulated model: bodies and joints by name, shapes, and the tables that kernels read.

    Bodies and joints keep their order in the MJCF file. `joint_q` (nq,) holds, joint by joint: free,
    position [m] then quaternion xyzw; ball, quaternion xyzw; hinge, angle [rad]. `joint_qd` (nv,):
    free, linear velocity of the body's origin in the world [m/s] then angular velocity in the body's
    axes [rad/s]; ball, angular velocity in the child's axes; hinge, rate.
    """

    name: str
    path: Path
    timestep: float
    """[s]"""
    nq: int
    nv: int
    body_names: list[str]
    body_parent: np.ndarray
    """(nbody,) index of the parent body, -1 for the world"""
    body_mass: np.ndarray
    """(nbody,) [kg]"""
    body_com: np.ndarray
    """(nbody, 3) centre of mass in the body's frame [m]"""
    body_inertia: np.ndarray
    """(nbody, 3, 3) about the centre of mass, body axes [kg m^2]"""
    joint_names: list[str]
    joint_link: np.ndarray
    joint_child: np.ndarray
    """(njoint,) index of the body that each joint moves against its parent"""
    shapes: list[Shape]
    sites: dict[str, tuple[int, np.ndarray, np.ndarray]]
    """site name -> (body, position (3,) [m], quaternion xyzw (4,)) in the body's frame"""
    keyframes: dict[str, np.ndarray]
    """joint_q (nq,) by name"""
    texts: dict[str, str]
    """<custom><text> elements of the file: lists of names that mean something to its user, see `roles`"""
    start_q: np.ndarray
    """(nq,) the keyframe `start`, or the file's zero pose"""
    tables: dict[str, np.ndarray]
    """arrays for `kernels.tree.Tree`, by its field names"""
    pairs: list[Pair]
    """contact properties per pair of shapes"""
    excluded: list[tuple[int, int]]
    """pairs of bodies, by index and -1 for the world, that the file keeps from touching"""
    notes: list[str] = field(default_factory=list)

    @staticmethod
    def load(
        name: str | Path = "player",
        rigid: tuple[str, ...] = (),
        pose: str = "start",
        without: tuple[str, ...] = (),
    ) -> Model:
        """Model of an MJCF file, or the shipped one by name ("player").

        Joints whose names match a pattern of `rigid` are frozen as in the keyframe `pose`, and the
        bodies of `without` are left out: `rigid=("*_mcp", "*_pip", "*_dip"), without=("ball",)` is
        a player with stiff hands and 51 degrees of freedom.

        Raises ModelError (a ValueError) when the file is missing, broken or holds something that is
        not simulated.
        """
        path, shown = Path(name), Path(name).stem
        if str(name) == "player":
            path, shown = asset("player.xml"), "player"
        model = Model(**read_model(path, shown, rigid, pose, without))
        model.tables["slot_flag"] = _flags(model)
        model.tables |= loose_tables(model)
        return model

    def convert_q(self, other: Model, joint_q: np.ndarray) -> np.ndarray:
        """joint_q (..., nq) of another model with joints of the same names, for this one; joints that
        the other lacks take the start pose."""
        joint_q = np.asarray(joint_q)
        q = np.broadcast_to(self.start_q, (*joint_q.shape[:-1], self.nq)).copy()
        for name in set(self.joint_names) & set(other.joint_names):
            q[..., self.q_slice(name)] = joint_q[..., other.q_slice(name)]
        return q

    # ------------------------------------------------------------------------------------- names

    @property
    def nbody(self) -> int:
        return len(self.body_names)

    def body(self, name: str) -> int:
        """Index of a body. Raises KeyError with the names there are."""
        return _index(self.body_names, name, "body")

    def joint(self, name: str) -> int:
        """Index of a joint. Raises KeyError with the names there are."""
        return _index(self.joint_names, name, "joint")

    def joint_type(self, name: str) -> Kind:
        """ "free", "ball" or "hinge"."""
        return self.joints[self.joint(name)].kind

    def joint_axis(self, name: str) -> np.ndarray:
        """(3,) unit axis of a hinge in its body's frame."""
        return self.joints[self.joint(name)].axis.copy()

    @property
    def root(self) -> str:
        """The free joint of the first tree. Raises ModelError where there is none."""
        return self.roles.one("root")

    def joint_body(self, name: str) -> int:
        """Index of the body that a joint moves against its parent."""
        return int(self.joint_child[self.joint(name)])

    def body_joints(self, body: int) -> list[Joint]:
        """The joints that move a body against its parent, from there outward; none when it is welded."""
        return [joint for joint in self.joints if joint.body == body]

    def body_joint(self, body: int) -> str:
        """The one joint that moves a body against its parent. Raises ValueError when there are none or
        several."""
        joints = self.body_joints(body)
        if len(joints) != 1:
            raise ValueError(f"body '{self.body_names[body]}' has {len(joints)} joints, not one")
        return joints[0].name

    def q_slice(self, name: str) -> slice:
        """Where a joint's coordinates are in joint_q."""
        return self.joints[self.joint(name)].q

    def dof_slice(self, name: str) -> slice:
        """Where a joint's velocities are in joint_qd."""
        return self.joints[self.joint(name)].dof

    def listed(self, text: str) -> list[str]:
        """Names of bodies that the file lists under <custom><text name=...>, in its order; empty where it
        does not. Raises ModelError for a name that is no body's."""
        names = self.texts.get(text, "").split()
        for name in names:
            if name not in self.body_names:
                raise ModelError(f"{self.path}: <text name=\"{text}\"> in <custom> names no body: '{name}'")
        return names

    def named_bodies(self, text: str) -> set[int]:
        """The bodies that are `listed`, by index."""
        return {self.body(name) for name in self.listed(text)}

    @cached_property
    def roles(self) -> Roles:
        """Which bodies and joints play which part: root, hands, feet, ball ..."""
        return find_roles(self)

    # -------------------------------------------------------------------------------------- tree

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """All joints, in the order of `joint_names`."""
        return tuple(self._joint(i) for i in range(len(self.joint_names)))

    def _joint(self, i: int) -> Joint:
        t, link = self.tables, int(self.joint_link[i])
        kind, q, dof = (int(t[name][link]) for name in ("link_joint", "link_q", "link_dof"))
        limits = (float(t["link_lower"][link]), float(t["link_upper"][link]))
        return Joint(
            name=self.joint_names[i],
            kind=KINDS[kind],
            link=link,
            parent=int(t["link_parent"][link]),
            body=int(self.joint_child[i]),
            q=slice(q, q + Q_SIZE[kind]),
            dof=slice(dof, dof + DOF_SIZE[kind]),
            offset=t["link_offset"][link],
            turn=t["link_turn"][link],
            axis=t["link_axis"][link],
            zero=float(t["link_zero"][link]),
            limits=limits if t["link_limited"][link] else None,
            kp=float(t["dof_kp"][dof]),
            kd=float(t["dof_kd"][dof]),
            effort=float(t["link_effort"][link]),
            driven=bool(t["link_driven"][link]),
            armature=float(t["dof_armature"][dof]),
            damping=float(t["dof_damping"][dof]),
            stiffness=float(t["dof_stiffness"][dof]),
            rest=t["q_spring"][q : q + Q_SIZE[kind]],
            com=t["link_com"][link],
        )

    @cached_property
    def coordinates(self) -> Coordinates:
        """Which coordinates add and which turn."""
        return coordinates(self.joints)

    def quaternions(self) -> list[int]:
        """Where quaternions start in joint_q."""
        return self.coordinates.turn_q[:, 0].tolist()

    @property
    def body_link(self) -> np.ndarray:
        """(nbody,) the link that each body is part of; 0 where it is welded to the world."""
        return self.tables["body_link"]

    @property
    def body_offset(self) -> np.ndarray:
        """(nbody, 3) [m] of each body's origin in its link."""
        return self.tables["body_offset"]

    @property
    def body_turn(self) -> np.ndarray:
        """(nbody, 4) xyzw of each body's frame in its link."""
        return self.tables["body_turn"]

    @property
    def gravity(self) -> np.ndarray:
        """(3,) [m/s^2]"""
        return self.tables["gravity"]

    def children(self, body: int) -> list[int]:
        """The bodies that hang from a body; from the world for -1."""
        return np.flatnonzero(self.body_parent == body).tolist()

    def descendants(self, body: int) -> list[int]:
        """A body and all bodies that hang from it, directly or not."""
        return below(self.body_parent, body)

    def first_shape(self, body: int) -> Shape:
        """The shape of a body that the file names first. Raises ValueError when it has none."""
        for shape in self.shapes:
            if shape.body == body:
                return shape
        raise ValueError(f"body '{self.body_names[body]}' of the model has no shape")

    @property
    def ball_radius(self) -> float:
        """[m] of the ball. Raises ModelError for a model without one."""
        return float(self.first_shape(self.body(self.roles.one("ball"))).size[0])

    @cached_property
    def zero_q(self) -> np.ndarray:
        """(nq,) coordinates of the zero pose: free joints where the file puts them, every angle zero. Not to
        be written to."""
        joint_q = np.zeros(self.nq)
        joint_q[self.coordinates.turn_q[:, 3]] = 1.0
        for joint in self.joints:
            if joint.kind == "free":
                joint_q[joint.q] = [*joint.offset, *joint.turn]
            elif joint.kind == "hinge":
                joint_q[joint.q] = joint.zero
        joint_q.flags.writeable = False
        return joint_q

    @cached_property
    def zero_pose(self) -> np.ndarray:
        """(nbody, 7) [m, -] body frames in the zero pose, position and quaternion xyzw. Not to be written
        to."""
        body_q = forward(self, self.zero_q)[0]
        body_q.flags.writeable = False
        return body_q


def _index(names: list[str], name: str, what: str) -> int:
    try:
        return names.index(name)
    except ValueError:
        known = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
        raise KeyError(f"no {what} named {name!r}; there are: {known}") from None


def _flags(model: Model) -> np.ndarray:
    """What a touch in each slot means: 1, a fall (part of the player other than its feet on the ground);
    2, a bad contact (the ball on the player's body other than the hands)."""
    feet, hands, ball = (model.named_bodies(k) for k in ("feet", "hands", "ball"))
    flags = []
    for a, b in zip(model.tables.get("slot_a", []), model.tables.get("slot_b", []), strict=True):
        touching = {model.shapes[a].body, model.shapes[b].body}
        moving = touching - {-1}
        if len(moving) == 1:
            flags.append(int(bool(feet) and not moving & (feet | ball)))
        else:
            flags.append(2 if touching & ball and not touching & hands else 0)
    return np.array(flags, int)
