"""Trunk and idle arms from angles in the world: what goes round with a cycle, as a mean and two harmonics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model, pose
from .breath import Swing, swing

STILL: Swing = (0.0, 0.0)


@dataclass(frozen=True)
class Wave:
    """What repeats once a cycle, and what twice."""

    mean: float
    once: Swing = STILL
    twice: Swing = STILL

    def at(self, turns: np.ndarray) -> np.ndarray:
        """(frames,) at turns (frames,) cycles."""
        return self.mean + swing(self.once, turns) + swing(self.twice, turns, 2.0)


@dataclass(frozen=True)
class Turn:
    """Of a body in the world [degrees]: to the left, bent forward, its right side down."""

    yaw: Wave
    pitch: Wave
    roll: Wave

    def at(self, turns: np.ndarray) -> Rotation:
        """(frames,) rotations."""
        return turn(self.yaw.at(turns), self.pitch.at(turns), self.roll.at(turns))


@dataclass(frozen=True)
class Posture:
    """How a trunk is turned. The lower back is half way between pelvis and torso."""

    pelvis: Turn
    torso: Turn
    head: Turn
    shoulders: Wave
    """[degrees] the collar bones, up."""


def stand_up(model: Model, joint_q: np.ndarray, style: Posture, turns: np.ndarray) -> None:
    """Turn root, back, neck and collar bones of joint_q (frames, nq), in place; turns: (frames,) cycles."""
    pelvis, torso, head = (part.at(turns) for part in (style.pelvis, style.torso, style.head))
    half = Rotation.from_rotvec(0.5 * (pelvis.inv() * torso).as_rotvec())
    root = model.q_slice(model.root)
    joint_q[:, root.start + 3 : root.stop] = pelvis.as_quat()
    joint_q[:, model.q_slice("lower_back")] = half.as_quat()
    joint_q[:, model.q_slice("torso")] = half.as_quat()
    joint_q[:, model.q_slice("neck")] = (torso.inv() * head).as_quat()
    shrug(model, joint_q, style.shoulders.at(turns))


def shrug(model: Model, joint_q: np.ndarray, up: np.ndarray) -> None:
    """Lift both collar bones by so much (frames,) [degrees], in place."""
    for side, sign in (("l", 1.0), ("r", -1.0)):
        lifted = turn(0.0 * up, 0.0 * up, sign * up)
        joint_q[:, model.q_slice(f"{side}_clavicle")] = lifted.as_quat()


def hang(
    model: Model, joint_q: np.ndarray, side: str, down: np.ndarray, elbow: np.ndarray, outward: float = 0.35
) -> None:
    """An arm that nothing is asked of, in place: its upper arm points `down` (frames, 3) in the world, the
    elbow, bent by (frames,) [degrees], takes the forearm ahead, and `outward` by so much of that."""
    upper, lower, _ = pose.limb_bodies(model, f"{side}_elbow")
    zero = model.zero_pose[:, :3]
    axis = np.tile([outward if side == "l" else -outward, -1.0, 0.0], (len(joint_q), 1))
    own = pose.frame_of(zero[lower] - zero[upper], model.joint_axis(f"{side}_elbow"))
    above = int(model.body_parent[upper])
    parent = pose.forward(model, joint_q, [above])[:, above, 3:]
    turned = Rotation.from_quat(parent).inv() * pose.frame_of(down, axis) * own.inv()
    joint_q[:, model.q_slice(f"{side}_shoulder")] = turned.as_quat()
    joint_q[:, model.q_slice(f"{side}_elbow")] = np.radians(elbow)[:, None]


def turn(yaw: np.ndarray, pitch: np.ndarray, roll: np.ndarray) -> Rotation:
    """Left, down and right side down [degrees], in turn."""
    return Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]), degrees=True)
