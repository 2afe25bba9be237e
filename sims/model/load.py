"""From an MJCF file to a `Model`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from .joints import DOF_SIZE
from .mjcf import (
    GEOMS,
    JOINTS,
    check_supported,
    compile_mjcf,
    read_drives,
    read_inertia,
    read_links,
    read_shapes,
    xyzw,
)
from .model import Model
from .slots import build_slots


def load_mjcf(path: Path, name: str, rigid: tuple[str, ...], pose: str, without: tuple[str, ...]) -> Model:
    """The model of a file under a name; see `Model.load`."""
    m, keys, gone = compile_mjcf(path, rigid, pose, without)
    check_supported(m, path)
    t, bodies = read_links(m)
    inertia = read_inertia(m, **bodies, link_count=len(t.link_parent))
    kp, kd, notes = read_drives(m, t, path)
    shapes = read_shapes(m)
    geoms = [g for g in range(m.ngeom) if int(m.geom_type[g]) in GEOMS]
    links = {
        "com": inertia["link_com"],
        "count": np.bincount(bodies["body_link"][1:], minlength=len(t.link_parent)),
    }
    slots = build_slots(m, geoms, shapes, t, bodies, links)
    pairs = slots.pop("pairs")
    stiffness = np.zeros(m.nv)
    for j in range(m.njnt):
        dofs = slice(m.jnt_dofadr[j], m.jnt_dofadr[j] + DOF_SIZE[JOINTS[int(m.jnt_type[j])]])
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
    in_link = Rotation.from_quat(tables["body_turn"])
    tables["body_com"] = tables["body_offset"] + in_link.apply(m.body_ipos[1:])
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


def _inertia_matrices(m) -> np.ndarray:
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
