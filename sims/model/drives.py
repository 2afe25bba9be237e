"""Actuators of an MJCF file: position and orientation servos become stable PD drives."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .joints import BALL, DOF_SIZE, FREE, HINGE
from .mjcf import ANYWHERE, JOINTS, ModelError, Tables

if TYPE_CHECKING:
    import mujoco


CAN = {
    "trn": "joint jointinparent so3",
    "dyn": "none",
    "gain": "fixed so3",
    "bias": "none affine so3",
}
"""Kinds of an actuator's parts, as MuJoCo names them."""
WORDS = {"trn": "transmission", "dyn": "activation", "gain": "gain", "bias": "bias"}


class Drives(NamedTuple):
    """What acts on each dof, (nv,) each."""

    kp: np.ndarray
    """[N m/rad]"""
    kd: np.ndarray
    """[N m s/rad]"""
    damping: np.ndarray
    """[N m s/rad] of joints and actuators, which no effort limit bounds"""
    armature: np.ndarray
    """[kg m^2] of joints and actuators"""
    notes: list[str]
    """on actuators that are left to the user"""


class Servo(NamedTuple):
    """A position servo on some dofs of a joint, in the joint's own terms."""

    dofs: slice
    kp: float
    kd: float
    effort: float


def read_drives(m: mujoco.MjModel, t: Tables, path: str | Path) -> Drives:
    """Drives from actuators; efforts go into `t`. Raises ModelError for actuators of other kinds."""
    import mujoco

    kp, kd = np.zeros(m.nv), np.zeros(m.nv)
    damping, armature = m.dof_damping.copy(), m.dof_armature.copy()
    effort = np.full(m.nv, ANYWHERE)
    notes = []
    for limited in np.flatnonzero(m.jnt_actfrclimited).tolist():
        low, high = m.jnt_actfrcrange[limited]
        what = f"{path}: actuatorfrcrange of joint '{m.joint(limited).name}'"
        effort[m.jnt_dofadr[limited]] = _both_ways(low, high, what)
    for a in range(m.nactuator):
        name = m.actuator(a).name or str(a)
        what = f"{path}: actuator '{name}'"
        _check_kinds(m, a, what)
        j, gear = int(m.actuator_trnid[a, 0]), m.actuator_gear[m.actuator_outadr[a]]
        # MuJoCo takes the first gear for all dofs of the joint, and none where a servo turns it whole
        if m.actuator_trntype[a] != mujoco.mjtTrn.mjTRN_SO3:
            dofs = _dofs(m, j)
            damping[dofs] += m.actuator_damping[a] * gear[0] ** 2
            armature[dofs] += m.actuator_armature[a] * gear[0] ** 2
        if int(m.actuator_biastype[a]) == 0 and int(m.actuator_gaintype[a]) == 0:
            notes.append(f"motor '{name}' has no drive: use Simulation.set_joint_force")
            continue
        servo = _servo(m, a, j, gear, what)
        if np.any(kp[servo.dofs] > 0):
            raise ModelError(f"{what} is a second drive of the same joint")
        kp[servo.dofs], kd[servo.dofs] = servo.kp, servo.kd
        effort[servo.dofs] = np.minimum(effort[servo.dofs], servo.effort)
        if JOINTS[int(m.jnt_type[j])] == HINGE and gear[0] != 1:
            notes.append(f"gear {gear[0]:g} of actuator '{name}' is in its gains: targets are joint angles")
    for i in range(1, len(t.link_joint)):
        dof = t.link_dof[i]
        if t.link_joint[i] == BALL:
            if any(np.ptp(v[dof : dof + 3]) > 1e-9 for v in (kp, kd, damping, armature)):
                raise ModelError(f"{path}: a ball joint's three drives must have the same kp and kv")
            t.link_effort[i] = float(effort[dof : dof + 3].min())
        elif t.link_joint[i] == HINGE:
            t.link_effort[i] = float(effort[dof])
        t.link_driven[i] = int(kp[dof] > 0 and t.link_effort[i] < ANYWHERE)
    return Drives(kp, kd, damping, armature, notes)


def _check_kinds(m: mujoco.MjModel, a: int, what: str) -> None:
    """Raise ModelError for an actuator with a part of a kind that is not in `CAN`."""
    import mujoco

    for field, may in CAN.items():
        kinds = getattr(mujoco, f"mjt{field.capitalize()}")
        kind = kinds(int(getattr(m, f"actuator_{field}type")[a])).name.partition("_")[2].lower()
        if kind not in may.split():
            raise ModelError(f"{what}: {WORDS[field]} {kind} is not supported; use position actuators")
    if m.actuator_trntype[a] == mujoco.mjtTrn.mjTRN_SO3 and m.actuator_trnid[a, 1] >= 0:
        raise ModelError(f"{what}: transmission site is not supported; turn a ball joint")


def _dofs(m: mujoco.MjModel, j: int) -> slice:
    first = int(m.jnt_dofadr[j])
    return slice(first, first + DOF_SIZE[JOINTS[int(m.jnt_type[j])]])


def _servo(m: mujoco.MjModel, a: int, j: int, gear: np.ndarray, what: str) -> Servo:
    """The servo of an actuator. With a gear g, its torque on the joint is g (kp (ctrl - g q) - kv g v): gains
    are g^2 times, the limit is g times the actuator's."""
    import mujoco

    both, kind = (m.actuator_gaintype[a], m.actuator_biastype[a]), JOINTS[int(m.jnt_type[j])]
    turns = both == (mujoco.mjtGain.mjGAIN_SO3, mujoco.mjtBias.mjBIAS_SO3)
    gain, bias = m.actuator_gainprm[a], m.actuator_biasprm[a]
    if not (turns or both == (mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE)):
        raise ModelError(f"{what}: its gain and bias are of two kinds; use position actuators")
    if gain[0] <= 0 or not np.isclose(gain[0], -bias[1]) or bias[0] != 0 or bias[2] > 0:
        raise ModelError(f"{what} is not a position servo (kp, kv)")
    clamped = not m.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    ctrl = int(m.actuator_ctrladr[a])
    if clamped and m.actuator_ctrllimited[ctrl]:
        low, high = m.actuator_ctrlrange[ctrl]
        raise ModelError(
            f"{what}: ctrlrange {low:g} {high:g} is not supported, targets are not clamped; limit the joint"
        )
    dofs, effort = _dofs(m, j), ANYWHERE
    low, high = m.actuator_forcerange[a]
    if turns:
        if kind != BALL:
            raise ModelError(f"{what} is not supported; orientation servos belong to ball joints")
        effort = float(high) if m.actuator_forcelimited[a] else ANYWHERE
        return Servo(dofs, float(gain[0]), float(-bias[2]), effort)
    used = np.flatnonzero(gear[:3]) if kind == BALL else np.array([0])
    g = float(gear[used[0]]) if len(used) == 1 else 0.0
    if kind == FREE or g == 0.0:
        raise ModelError(f"{what}: gear must turn a hinge, or one axis of a ball joint")
    if m.actuator_forcelimited[a]:
        effort = abs(g) * _both_ways(low, high, what)
    dof = dofs.start + int(used[0])
    return Servo(slice(dof, dof + 1), g * g * float(gain[0]), -g * g * float(bias[2]), effort)


def _both_ways(low: float, high: float, what: str) -> float:
    """The effort limit of a range. Raises ModelError where it is not the same both ways."""
    if not np.isclose(-low, high):
        raise ModelError(f"{what}: a force range must be the same both ways, not {low:g} to {high:g}")
    return float(high)
