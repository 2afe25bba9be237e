"""`Model`: what a character is made of, the same for every world."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from .mjcf import (
    BALL,
    FREE,
    ModelError,
    Shape,
    check_supported,
    compile_mjcf,
    read_drives,
    read_inertia,
    read_links,
    read_shapes,
    xyzw,
)
from .roles import Roles, find_roles
from .slots import build_slots

JOINT_TYPES = ("free", "ball", "hinge")
JOINT_Q = (7, 4, 1)
JOINT_DOF = (6, 3, 1)


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
    pairs: list[dict]
    """contact properties per pair of shapes"""
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
        if str(name) == "player":
            from ...assets import path as asset

            return load_mjcf(asset("player.xml"), "player", rigid, pose, without)
        return load_mjcf(Path(name), Path(name).stem, rigid, pose, without)

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

    def joint_type(self, name: str) -> str:
        """ "free", "ball" or "hinge"."""
        return JOINT_TYPES[self.tables["link_joint"][self.joint_link[self.joint(name)]]]

    def joint_axis(self, name: str) -> np.ndarray:
        """(3,) unit axis of a hinge in its body's frame."""
        return self.tables["link_axis"][self.joint_link[self.joint(name)]].copy()

    def joint_body(self, name: str) -> int:
        """Index of the body that a joint moves against its parent."""
        return int(self.joint_child[self.joint(name)])

    def body_joint(self, body: int) -> str:
        """The one joint that moves a body against its parent. Raises ValueError when there are none or
        several."""
        joints = np.flatnonzero(self.joint_child == body)
        if len(joints) != 1:
            raise ValueError(f"body '{self.body_names[body]}' has {len(joints)} joints, not one")
        return self.joint_names[joints[0]]

    def q_slice(self, name: str) -> slice:
        """Where a joint's coordinates are in joint_q."""
        link = self.joint_link[self.joint(name)]
        start = int(self.tables["link_q"][link])
        return slice(start, start + JOINT_Q[self.tables["link_joint"][link]])

    def dof_slice(self, name: str) -> slice:
        """Where a joint's velocities are in joint_qd."""
        link = self.joint_link[self.joint(name)]
        start = int(self.tables["link_dof"][link])
        return slice(start, start + JOINT_DOF[self.tables["link_joint"][link]])

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

    def quaternions(self) -> list[int]:
        """Where quaternions start in joint_q."""
        t = self.tables
        return [
            int(q) + (3 if joint == FREE else 0)
            for q, joint in zip(t["link_q"][1:], t["link_joint"][1:], strict=True)
            if joint in (FREE, BALL)
        ]


def _index(names: list[str], name: str, what: str) -> int:
    try:
        return names.index(name)
    except ValueError:
        known = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
        raise KeyError(f"no {what} named {name!r}; there are: {known}") from None


def load_mjcf(path: Path, name: str, rigid: tuple[str, ...], pose: str, without: tuple[str, ...]) -> Model:
    m, keys, gone = compile_mjcf(path, rigid, pose, without)
    check_supported(m, path)
    t, bodies = read_links(m)
    inertia = read_inertia(m, **bodies, link_count=len(t.link_parent))
    kp, kd, notes = read_drives(m, t, path)
    shapes = read_shapes(m)
    geoms = [g for g in range(m.ngeom) if int(m.geom_type[g]) in (0, 2, 3, 6)]
    links = {
        "com": inertia["link_com"],
        "count": np.bincount(bodies["body_link"][1:], minlength=len(t.link_parent)),
    }
    slots = build_slots(m, geoms, shapes, t, bodies, links)
    pairs = slots.pop("pairs")
    stiffness = np.zeros(m.nv)
    for j in range(m.njnt):
        dofs = slice(m.jnt_dofadr[j], m.jnt_dofadr[j] + JOINT_DOF[(0, 1, 0, 2)[m.jnt_type[j]]])
        stiffness[dofs] = m.jnt_stiffness[j]
    tables = {key: np.array(value) for key, value in vars(t).items()} | inertia | slots
    tables |= {
        "body_link": bodies["body_link"][1:],
        "body_offset": bodies["body_offset"][1:],
        "body_turn": bodies["body_turn"][1:],
        "dof_kp": kp,
        "dof_kd": kd,
        "dof_armature": m.dof_armature.copy(),
        "dof_damping": m.dof_damping.copy(),
        "dof_stiffness": stiffness,
        "pair_erp": np.array([p["erp"] for p in pairs]),
        "pair_cfm": np.array([p["cfm"] for p in pairs]),
    }
    model = Model(
        name=name,
        path=path,
        timestep=float(m.opt.timestep),
        nq=m.nq,
        nv=m.nv,
        body_names=[m.body(b).name or f"body{b}" for b in range(1, m.nbody)],
        body_parent=m.body_parentid[1:] - 1,
        body_mass=m.body_mass[1:].copy(),
        body_com=m.body_ipos[1:].copy(),
        body_inertia=_inertia_matrices(m),
        joint_names=[m.joint(j).name or f"joint{j}" for j in range(m.njnt)],
        joint_link=np.arange(1, m.njnt + 1),
        joint_child=m.jnt_bodyid - 1,
        shapes=shapes,
        sites={
            m.site(s).name: (
                int(m.site_bodyid[s]) - 1,
                m.site_pos[s].copy(),
                xyzw(m.site_quat[s]),
            )
            for s in range(m.nsite)
        },
        keyframes={},
        texts={
            _string(m.names, m.name_textadr[k]): " ".join(
                word for word in _string(m.text_data, m.text_adr[k]).split() if word not in gone
            )
            for k in range(m.ntext)
        },
        start_q=np.zeros(m.nq),
        tables=tables,
        pairs=pairs,
        notes=notes,
    )
    model.keyframes = {
        key: _order(model, np.concatenate(list(joints.values()))) for key, joints in keys.items()
    }
    model.start_q = model.keyframes.get("start", _order(model, m.qpos0)).copy()
    tables["q_spring"] = _order(model, m.qpos_spring)
    tables["gravity"] = m.opt.gravity.copy()
    tables["body_com"] = bodies["body_offset"][1:] + _rotate(bodies["body_turn"][1:], m.body_ipos[1:])
    tables["slot_flag"] = _flags(model)
    return model


def _string(data: bytes, start: int) -> str:
    """The zero-terminated string at `start` of one of MuJoCo's buffers."""
    data = bytes(data)
    return data[start : data.index(b"\0", start)].decode()


def _order(model: Model, qpos: np.ndarray) -> np.ndarray:
    """MuJoCo's qpos with quaternions turned to xyzw."""
    q = np.array(qpos, float)
    for k in model.quaternions():
        q[k : k + 4] = xyzw(q[k : k + 4])
    return q


def _rotate(quat: np.ndarray, v: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(quat).apply(v)


def _inertia_matrices(m) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    R = Rotation.from_quat(xyzw(m.body_iquat[1:])).as_matrix()
    return np.einsum("bij,bj,bkj->bik", R, m.body_inertia[1:], R)


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


__all__ = ["Model", "ModelError"]
