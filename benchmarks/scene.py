"""The scene that is timed: both feet down, the ball in one hand, every joint's target stirred."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..sims import Model
from ..sims.model.mjcf import wxyz

FRAGMENT = 5
"""Steps between new targets: one control fragment of 0.05 s (P1 3.2)."""
STIR = 0.03
"""Standard deviation of each target about the pose, per axis [rad]: P1's first sampling width."""


@dataclass
class Scene:
    model: Model
    start: np.ndarray
    """(nq,) joint_q"""
    targets: np.ndarray
    """(fragments, worlds, nq) joint_target_q"""
    controls: np.ndarray
    """(fragments, nu) the first world's, as MuJoCo's ctrl"""


def hold(worlds: int, fragments: int, seed: int = 0) -> Scene:
    """The player holding the ball on its right palm."""
    model = Model.load("player")
    start = model.keyframes["hold"]
    random = np.random.default_rng(seed)
    targets = np.tile(start, (fragments, worlds, 1))
    controls = []
    for name in model.joint_names:
        kind, q = model.joint_type(name), model.q_slice(name)
        if kind == "free":
            continue
        noise = random.normal(scale=STIR, size=(fragments, worlds, 3 if kind == "ball" else 1))
        if kind == "ball":
            turn = Rotation.from_quat(start[q]) * Rotation.from_rotvec(noise.reshape(-1, 3))
            targets[:, :, q] = turn.as_quat().reshape(fragments, worlds, 4)
            first = Rotation.from_quat(targets[:, 0, q])
            controls.append(first.as_rotvec())
        else:
            targets[:, :, q] += noise
            controls.append(targets[:, 0, q])
    return Scene(model, start, targets, np.concatenate(controls, axis=1))


def mujoco_q(model: Model, q: np.ndarray) -> np.ndarray:
    """joint_q as MuJoCo's qpos."""
    q = q.copy()
    for k in model.quaternions():
        q[k : k + 4] = wxyz(q[k : k + 4])
    return q
