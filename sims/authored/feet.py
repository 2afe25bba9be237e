"""Feet on the ground, lying flat or risen over heel or toes, without sliding."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model, pose


def planted(
    model: Model, side: str, flat: np.ndarray, out: float, pitch: np.ndarray
) -> tuple[np.ndarray, Rotation, np.ndarray]:
    """Where an ankle is (frames, 3) [m], how its foot is turned, and how its toes are bent (frames,)
    [degrees].

    flat: (frames, 3) [m], the ankle when the foot lies flat; out: the foot turned outward [degrees]; pitch:
    (frames,) [degrees], toes down: the foot is risen over toes that stay on the ground, or, where it is
    negative, over its heel.
    """
    zero, foot = model.zero_pose[:, :3], model.body(f"{side}_foot")
    sole = model.first_shape(foot)
    heel = np.array([sole.pos[0] - sole.size[0], 0.0, sole.pos[2] - sole.size[2]])
    toes = (zero[model.body(f"{side}_toes")] - zero[foot]) * [1.0, 0.0, 1.0]
    out = out if side == "l" else -out
    turned = foot_turn(out + 0.0 * pitch, pitch)
    pivot = np.where(pitch[:, None] < 0.0, heel, toes)
    yaw = Rotation.from_euler("z", out, degrees=True)
    return flat + yaw.apply(pivot) - turned.apply(pivot), turned, -np.maximum(pitch, 0.0)


def foot_turn(left: np.ndarray, pitch: np.ndarray) -> Rotation:
    """Rotations (frames,) of a foot that points to the left and has its toes down [degrees]."""
    return Rotation.from_euler("ZY", np.column_stack([left, pitch]), degrees=True)


def place_foot(
    model: Model, joint_q: np.ndarray, side: str, ankle: np.ndarray, turned: Rotation, toes: np.ndarray
) -> None:
    """Solve a leg of joint_q (frames, nq), in place; its knee points where the foot does."""
    ahead = turned.apply([0.0, 1.0, 0.0])
    pose.place_limb(model, joint_q, f"{side}_knee", ankle, turned, ahead)
    joint_q[:, model.q_slice(f"{side}_toes")] = np.radians(toes)[:, None]
