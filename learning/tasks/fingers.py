"""Fingers as a hand moves them together: between flat and fist, by three signals a hand (P1 3.1, Eq. 1-3)."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ...sims.model import Model
from ...sims.worlds import Signal

FINGERS = ("thumb", "index", "middle", "ring", "pinky")
SIGNALS = ("thumb", "index", "pinky")
SHARES = np.array([[1, 0, 0], [0, 1, 0], [0, 2 / 3, 1 / 3], [0, 1 / 3, 2 / 3], [0, 0, 1]])
"""(fingers, signals): what each finger has of the signals (Eq. 2, 3)."""
READY = 0.2
"""Of an idle hand (P1 5.1): the way from flat to fist of the model's keyframe "ready"."""


def finger_signals(model: Model) -> tuple[Signal, ...]:
    """A column of offsets for each finger, the left hand's first: 1 leads from flat to fist (Eq. 1). A
    finger's joints are told by their names, which begin with the side and the finger.
    Raises ValueError for a model without the keyframes "flat" and "fist", or without fingers."""
    flat, fist = (_keyframe(model, name) for name in ("flat", "fist"))
    found: list[Signal] = []
    for side in "lr":
        for finger in FINGERS:
            joints = [j for j in model.joints if j.name.startswith(f"{side}_{finger}_")]
            if not joints:
                raise ValueError(f"{model.path}: the model has no finger '{side}_{finger}'")
            found.append({j.name: _way(j.kind, flat[j.q], fist[j.q]) for j in joints})
    return tuple(found)


def finger_joints(model: Model) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The joints of the left and of the right hand's fingers."""
    signals, half = finger_signals(model), len(FINGERS)
    left, right = (tuple(name for s in part for name in s) for part in (signals[:half], signals[half:]))
    return left, right


def with_ready_hands(model: Model, joint_q: np.ndarray, plays: np.ndarray) -> np.ndarray:
    """joint_q (frames, nq) with the fingers of the hands that play (2,) as they wait for the ball; an idle
    hand stays as it is."""
    joint_q, ready = joint_q.copy(), _keyframe(model, "ready")
    for names, does in zip(finger_joints(model), plays):
        for name in names if does else ():
            joint_q[:, model.q_slice(name)] = ready[model.q_slice(name)]
    return joint_q


def _keyframe(model: Model, name: str) -> np.ndarray:
    if name not in model.keyframes:
        raise ValueError(f"{model.path}: the model has no keyframe '{name}', which fingers are led by")
    return np.asarray(model.keyframes[name])


def _way(kind: str, start: np.ndarray, end: np.ndarray) -> float | list[float]:
    """From one joint's coordinates to another's: an angle, or a rotation vector in the joint's axes [rad]."""
    if kind == "hinge":
        return float(end[0] - start[0])
    turn = Rotation.from_quat(start).inv() * Rotation.from_quat(end)
    return [float(x) for x in turn.as_rotvec()]
