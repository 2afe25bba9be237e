"""Reads an MJCF file, with MuJoCo's own compiler, into the tables that the kernels step.

Any tree of free, ball and hinge joints with capsules, boxes, spheres and planes loads. `drives` reads the
actuators. What cannot be simulated is refused by name rather than left out: `fields` and `supported`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from .joints import BALL, FREE, HINGE

if TYPE_CHECKING:
    import mujoco

JOINTS = {0: FREE, 1: BALL, 3: HINGE}
"""MuJoCo's joint types, but for the slide, which is not simulated."""
GEOMS = {0: "plane", 2: "sphere", 3: "capsule", 6: "box"}
"""MuJoCo's geom types that are simulated."""
USER = (0.0, 0.2, 1.0e-5)
"""What a geom's user numbers are where a file does not give them: restitution, erp, cfm."""
ANYWHERE = 1.0e9
"""Effort limit [N m] of a joint that has none."""


class ModelError(ValueError):
    """A model file that cannot be read or simulated; the message says which part and what to do."""


@dataclass
class Shape:
    """A collision shape, as MuJoCo's geom: sizes are half sizes."""

    name: str
    body: int
    """index into `Model.body_names`; -1 for the world"""
    kind: str
    """"sphere", "capsule", "box" or "plane\""""
    size: np.ndarray
    """sphere (r), capsule (r, half length along local z), box (hx, hy, hz) [m]"""
    pos: np.ndarray
    """(3,) in the body's frame [m]"""
    quat: np.ndarray
    """(4,) xyzw"""
    rgba: np.ndarray
    friction: float
    restitution: float
    erp: float
    cfm: float
    condim: int
    contype: int
    conaffinity: int


@dataclass
class Tables:
    """Links (row 0 is the ground), dofs and bodies as arrays; see `kernels.tree.Tree` for each."""

    link_parent: list[int] = field(default_factory=lambda: [0])
    link_joint: list[int] = field(default_factory=lambda: [FREE])
    link_q: list[int] = field(default_factory=lambda: [0])
    link_dof: list[int] = field(default_factory=lambda: [0])
    link_offset: list[np.ndarray] = field(default_factory=lambda: [np.zeros(3)])
    link_turn: list[np.ndarray] = field(default_factory=lambda: [np.array([0, 0, 0, 1.0])])
    link_axis: list[np.ndarray] = field(default_factory=lambda: [np.array([0, 0, 1.0])])
    link_zero: list[float] = field(default_factory=lambda: [0.0])
    link_effort: list[float] = field(default_factory=lambda: [ANYWHERE])
    link_driven: list[int] = field(default_factory=lambda: [0])
    link_limited: list[int] = field(default_factory=lambda: [0])
    link_lower: list[float] = field(default_factory=lambda: [0.0])
    link_upper: list[float] = field(default_factory=lambda: [0.0])
    link_near: list[float] = field(default_factory=lambda: [0.0])
    link_sprung: list[int] = field(default_factory=lambda: [0])


def xyzw(q: np.ndarray) -> np.ndarray:
    """MuJoCo's wxyz to xyzw, along the last axis."""
    return np.roll(np.asarray(q, float), -1, axis=-1)


def wxyz(q: np.ndarray) -> np.ndarray:
    """xyzw to MuJoCo's wxyz, along the last axis."""
    return np.roll(np.asarray(q, float), 1, axis=-1)


def compile_mjcf(
    path: str | Path, rigid: tuple[str, ...] = (), pose: str = "start", without: tuple[str, ...] = ()
) -> tuple[mujoco.MjModel, dict[str, dict[str, np.ndarray]], set[str]]:
    """MuJoCo's model of an MJCF file; its keyframes: name -> {joint name: qpos} in joint order; and the names
    of the bodies that were left out.

    Joints whose names match a pattern of `rigid` are frozen as they are in the keyframe `pose`, or in the
    zero pose where there is no such keyframe. The bodies of `without` are left out. Raises ModelError.
    """
    import mujoco

    path = Path(path)
    if not path.is_file():
        raise ModelError(f"{path}: no such file; give the path of an MJCF file, or 'player'")
    try:
        path.read_text(encoding="utf-8")  # MuJoCo takes other bytes as names, and cannot say them
        spec = mujoco.MjSpec.from_file(str(path))
        _fill_user(spec, path)
        model = spec.compile()
        keys = {model.key(k).name: _by_joint(model, model.key_qpos[k]) for k in range(model.nkey)}
        bodies = {model.body(b).name for b in range(model.nbody)}
        if rigid or without:
            for joint in spec.joints:  # numbers change when others go, names stay
                joint.name = joint.name or f"joint{joint.id}"
            for key in list(spec.keys):
                spec.delete(key)
            if rigid:
                _freeze(spec, model, rigid, keys.get(pose, _by_joint(model, model.qpos0)), path)
            for name in without:
                _leave_out(spec, name, path)
            if len(spec.bodies) < 2:
                raise ModelError(f"{path}: nothing is left without {', '.join(without)}")
            model = spec.compile()
            left = {model.joint(j).name for j in range(model.njnt)}
            keys = {
                key: {name: q for name, q in joints.items() if name in left} for key, joints in keys.items()
            }
    except (ValueError, RuntimeError) as error:
        if isinstance(error, ModelError):
            raise
        reason = " ".join(str(error).split())
        raise ModelError(f"{path}: not a valid MJCF file: {reason}") from None
    return model, keys, bodies - {model.body(b).name for b in range(model.nbody)}


def _fill_user(spec: mujoco.MjSpec, path: Path) -> None:
    """Give every geom the user numbers that it does not say: MuJoCo itself would pad with zeros."""
    for geom in spec.geoms:
        given = list(geom.userdata)
        user = given + list(USER)[len(given) :]
        if not (0 <= user[0] <= 1 and 0 <= user[1] <= 1 and user[2] >= 0):
            said = " ".join(f"{number:g}" for number in given)
            raise ModelError(
                f"{path}: user '{said}' of geom '{geom.name}' is not restitution, erp (0 to 1 each) and cfm"
            )
        geom.userdata = user
    if spec.nuser_geom >= 0:
        spec.nuser_geom = max(spec.nuser_geom, len(USER))


def _by_joint(m: mujoco.MjModel, qpos: np.ndarray) -> dict[str, np.ndarray]:
    parts = np.split(qpos, m.jnt_qposadr[1:])
    return {m.joint(j).name or f"joint{j}": part.copy() for j, part in zip(range(m.njnt), parts)}


def _leave_out(spec: mujoco.MjSpec, name: str, path: Path) -> None:
    """Take a body at the top level, and all that hangs on it, out of a spec."""
    body = spec.body(name)
    if body is None or body.parent is None or body.parent.name != "world":
        raise ModelError(f"{path}: no body named '{name}' at the top level, to be left out")
    spec.delete(body)


def _freeze(
    spec: mujoco.MjSpec,
    m: mujoco.MjModel,
    rigid: tuple[str, ...],
    pose: dict[str, np.ndarray],
    path: Path,
) -> None:
    """Take the joints that match a pattern out of a spec, their bodies turned as in `pose`."""
    frozen = {name for name in pose if any(fnmatch(name, pattern) for pattern in rigid)}
    if not frozen:
        raise ModelError(f"{path}: no joint is named like {', '.join(rigid)}")
    for actuator in list(spec.actuators):
        if actuator.target in frozen:
            spec.delete(actuator)
    for joint in list(spec.joints):
        if joint.name not in frozen:
            continue
        j = m.joint(joint.name).id
        b = int(m.jnt_bodyid[j])
        if m.jnt_type[j] not in (1, 3) or m.body_jntnum[b] != 1:
            raise ModelError(f"{path}: joint '{joint.name}' cannot be made rigid: not its body's only one")
        q = pose[joint.name]
        turn = Rotation.from_quat(xyzw(q)) if len(q) == 4 else None
        if turn is None:
            turn = Rotation.from_rotvec((q[0] - m.qpos0[m.jnt_qposadr[j]]) * m.jnt_axis[j])
        frame = Rotation.from_quat(xyzw(m.body_quat[b]))
        anchor = m.jnt_pos[j]
        body = spec.body(m.body(b).name)
        body.pos = m.body_pos[b] + frame.apply(anchor - turn.apply(anchor))
        body.quat = wxyz((frame * turn).as_quat())
        spec.delete(joint)


def read_shapes(m: mujoco.MjModel) -> list[Shape]:
    """The geoms that collide, and those that only show, of a supported kind."""
    shapes = []
    for g in range(m.ngeom):
        kind = GEOMS.get(int(m.geom_type[g]))
        if kind is None:
            continue
        user = m.geom_user[g]
        sizes = {"sphere": 1, "capsule": 2, "box": 3, "plane": 0}[kind]
        shapes.append(
            Shape(
                name=m.geom(g).name or f"geom{g}",
                body=int(m.geom_bodyid[g]) - 1,
                kind=kind,
                size=m.geom_size[g, :sizes].copy(),
                pos=m.geom_pos[g].copy(),
                quat=xyzw(m.geom_quat[g]),
                rgba=m.geom_rgba[g].astype(float),
                friction=float(m.geom_friction[g, 0]),
                restitution=float(user[0]),
                erp=float(user[1]),
                cfm=float(user[2]),
                condim=int(m.geom_condim[g]),
                contype=int(m.geom_contype[g]),
                conaffinity=int(m.geom_conaffinity[g]),
            )
        )
    return shapes


def read_links(m: mujoco.MjModel) -> tuple[Tables, dict[str, np.ndarray]]:
    """The kinematic tree: one link per joint, and where each body sits in its link."""
    t = Tables()
    body_link = np.zeros(m.nbody, int)
    body_offset = np.zeros((m.nbody, 3))
    body_turn = np.tile([0, 0, 0, 1.0], (m.nbody, 1))
    for b in range(1, m.nbody):
        parent = int(m.body_parentid[b])
        link = int(body_link[parent])
        frame = Rotation.from_quat(body_turn[parent])
        offset = body_offset[parent] + frame.apply(m.body_pos[b])
        turn = (frame * Rotation.from_quat(xyzw(m.body_quat[b]))).as_quat()
        first = int(m.body_jntadr[b])
        for j in range(first, first + int(m.body_jntnum[b])):
            joint = JOINTS[int(m.jnt_type[j])]
            anchor = np.zeros(3) if joint == FREE else m.jnt_pos[j]
            # a limit pushes from its margin on, as MuJoCo's; a ball joint's lower end is no limit
            margin = m.jnt_margin[j]
            low, high = m.jnt_range[j] + [0.0 if joint == BALL else margin, -margin]
            q = int(m.jnt_qposadr[j])
            t.link_parent.append(link)
            t.link_joint.append(joint)
            t.link_q.append(q)
            t.link_dof.append(int(m.jnt_dofadr[j]))
            t.link_offset.append(offset + Rotation.from_quat(turn).apply(anchor))
            t.link_turn.append(turn)
            t.link_axis.append(m.jnt_axis[j].copy())
            t.link_zero.append(float(m.qpos0[q]) if joint == HINGE else 0.0)
            t.link_effort.append(ANYWHERE)
            t.link_driven.append(0)
            t.link_limited.append(int(m.jnt_limited[j]))
            t.link_lower.append(float(low))
            t.link_upper.append(float(high))
            t.link_near.append(float(np.cos(0.5 * max(high - 0.3, 0.0))))
            stiffness = np.atleast_1d(m.jnt_stiffness[j])[0]
            t.link_sprung.append(int(stiffness > 0))
            link = len(t.link_parent) - 1
            offset, turn = -anchor, np.array([0, 0, 0, 1.0])
        body_link[b], body_offset[b], body_turn[b] = link, offset, turn
    bodies = {"body_link": body_link, "body_offset": body_offset, "body_turn": body_turn}
    return t, bodies


def read_inertia(
    m: mujoco.MjModel,
    body_link: np.ndarray,
    body_offset: np.ndarray,
    body_turn: np.ndarray,
    link_count: int,
) -> dict[str, np.ndarray]:
    """Mass, centre of mass and second moments of each link about its origin, in its axes."""
    mass = np.zeros(link_count)
    first = np.zeros((link_count, 3))
    second = np.zeros((link_count, 3, 3))
    for b in range(1, m.nbody):
        i = body_link[b]
        frame = Rotation.from_quat(body_turn[b])
        com = body_offset[b] + frame.apply(m.body_ipos[b])
        R = (frame * Rotation.from_quat(xyzw(m.body_iquat[b]))).as_matrix()
        k = m.body_mass[b]
        mass[i] += k
        first[i] += k * com
        second[i] += R @ np.diag(m.body_inertia[b]) @ R.T
        second[i] += k * (com @ com * np.eye(3) - np.outer(com, com))
    com = np.divide(first, mass[:, None], out=np.zeros_like(first), where=mass[:, None] > 0)
    return {
        "link_mass": mass,
        "link_com": com,
        "link_moments": second[:, [0, 1, 2], [0, 1, 2]],
        "link_products": second[:, [0, 0, 1], [1, 2, 2]],
    }
