"""From an MJCF file to what a `Model` holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from .drives import read_drives
from .joints import DOF_SIZE, HINGE, Q_SIZE
from .mjcf import (
    GEOMS,
    JOINTS,
    compile_mjcf,
    read_inertia,
    read_links,
    read_shapes,
    xyzw,
)
from .slots import build_slots
from .supported import check_supported

if TYPE_CHECKING:
    import mujoco


def read_model(
    path: Path, name: str, rigid: tuple[str, ...], pose: str, without: tuple[str, ...]
) -> dict[str, Any]:
    """The fields of the `Model` of a file; see `Model.load`."""
    m, keys, gone = compile_mjcf(path, rigid, pose, without)
    notes = check_supported(m, path)
    t, bodies = read_links(m)
    inertia = read_inertia(m, **bodies, link_count=len(t.link_parent))
    drives = read_drives(m, t, path)
    shapes = read_shapes(m)
    geoms = [g for g in range(m.ngeom) if int(m.geom_type[g]) in GEOMS]
    slots, pairs, said = build_slots(m, geoms, shapes, t, bodies, inertia)
    stiffness = np.zeros(m.nv)
    for j in range(m.njnt):
        dofs = slice(m.jnt_dofadr[j], m.jnt_dofadr[j] + DOF_SIZE[JOINTS[int(m.jnt_type[j])]])
        stiffness[dofs] = m.jnt_stiffness[j]
    tables = {key: np.array(value) for key, value in vars(t).items()} | inertia | slots
    tables |= {
        "body_link": bodies["body_link"][1:],
        "body_offset": bodies["body_offset"][1:],
        "body_turn": bodies["body_turn"][1:],
        "dof_kp": drives.kp,
        "dof_kd": drives.kd,
        "dof_armature": drives.armature,
        "dof_damping": drives.damping,
        "dof_stiffness": stiffness,
        "pair_erp": np.array([p["erp"] for p in pairs]),
        "pair_cfm": np.array([p["cfm"] for p in pairs]),
        "q_spring": _order(m, m.qpos_spring),
        "gravity": m.opt.gravity.copy(),
    }
    in_link = Rotation.from_quat(bodies["body_turn"][1:])
    tables["body_com"] = bodies["body_offset"][1:] + in_link.apply(m.body_ipos[1:])
    keyframes = {key: _order(m, np.concatenate(list(joints.values()))) for key, joints in keys.items()}
    return {
        "name": name,
        "path": path,
        "timestep": float(m.opt.timestep),
        "nq": m.nq,
        "nv": m.nv,
        "body_names": [m.body(b).name or f"body{b}" for b in range(1, m.nbody)],
        "body_parent": m.body_parentid[1:] - 1,
        "body_mass": m.body_mass[1:].copy(),
        "body_com": m.body_ipos[1:].copy(),
        "body_inertia": _inertia_matrices(m),
        "joint_names": [m.joint(j).name or f"joint{j}" for j in range(m.njnt)],
        "joint_link": np.arange(1, m.njnt + 1),
        "joint_child": m.jnt_bodyid - 1,
        "shapes": shapes,
        "sites": {
            m.site(s).name: (int(m.site_bodyid[s]) - 1, m.site_pos[s].copy(), xyzw(m.site_quat[s]))
            for s in range(m.nsite)
        },
        "keyframes": keyframes,
        "texts": {
            _string(m.names, m.name_textadr[k]): " ".join(
                word for word in _string(m.text_data, m.text_adr[k]).split() if word not in gone
            )
            for k in range(m.ntext)
        },
        "start_q": keyframes.get("start", _order(m, m.qpos0)).copy(),
        "tables": tables,
        "pairs": pairs,
        "excluded": [(int(two >> 16) - 1, int(two & 0xFFFF) - 1) for two in m.exclude_signature],
        "notes": notes + drives.notes + said,
    }


def _string(data: bytes, start: int) -> str:
    """The zero-terminated string at `start` of one of MuJoCo's buffers."""
    data = bytes(data)
    return data[start : data.index(b"\0", start)].decode()


def _order(m: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """MuJoCo's qpos with quaternions turned to xyzw."""
    q = np.array(qpos, float)
    for kind, start in zip(m.jnt_type, m.jnt_qposadr):
        if JOINTS[int(kind)] != HINGE:
            turn = slice(start, start + Q_SIZE[JOINTS[int(kind)]])
            q[turn][-4:] = xyzw(q[turn][-4:])
    return q


def _inertia_matrices(m: mujoco.MjModel) -> np.ndarray:
    R = Rotation.from_quat(xyzw(m.body_iquat[1:])).as_matrix()
    return np.einsum("bij,bj,bkj->bik", R, m.body_inertia[1:], R)
