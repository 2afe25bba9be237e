"""Which axis of a file points up: the one along which its skeleton stands at zero angles. The clip confirms
it, and decides only where nobody stands at zero angles, or where it shows that they lie."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..sims.recording import anatomy
from ..sims.recording.motion import Motion

AXES = dict(zip("xyz", np.eye(3))) | {f"-{name}": -axis for name, axis in zip("xyz", np.eye(3))}
STANDS = np.cos(np.radians(45.0))
"""[-] Cosine between an axis and the trunk and both legs of who stands along it."""
CLEAR = 1.5
"""[-] The head is above the feet along an axis if it is this many times farther than along any other."""
LEVEL, SAME, CLEARER = 0.15, 0.04, 3.0
"""[-] The ground is at 0 along an axis if the lowest joints are no farther from there, as a share of how far
joints get from the root (less than the second share is 0), and this many times farther along any other."""
MOST = 60
"""Frames of the clip that are looked at."""


def find_up(motion: Motion) -> tuple[str, str] | None:
    """The axis that points up, a key of AXES, and how it was told; None where it cannot be.

    motion: as its file has it, in any unit, at zero angles in its rest pose.
    """
    found = anatomy.parts(motion.joint_names, motion.parents)
    some = np.linspace(0, motion.frame_count - 1, min(motion.frame_count, MOST)).astype(int)
    part = replace(motion, rotations=motion.rotations[some], root_position=motion.root_position[some],
                   positions=None)  # fmt: skip
    places = part.forward()[0]
    stands, head = _stands_along(found, motion.rest()[0]), _head_along(found, places)
    level = {name: _level(places, axis) for name, axis in AXES.items()}
    ground = min(level, key=level.__getitem__)
    others = min(value for name, value in level.items() if name[-1] != ground[-1])
    clear = level[ground] < LEVEL and others > CLEARER * max(level[ground], SAME)
    if stands is not None:
        if stands == head:
            return stands, _up(stands)
        if head is not None and head == ground and clear:
            return head, f"{_up(head)}, as in the clip on ground at 0; at zero angles the skeleton lies"
        return stands, f"{_up(stands)}, as the skeleton stands at zero angles; in the clip it does not"
    why = "guessed from the clip, as the skeleton does not stand at zero angles"
    if clear and ground != head:
        return (ground, f"{_up(ground)}: {why}: its ground is at 0") if ground in tuple("xyz") else None
    if head in tuple("xyz") and (level[head] < LEVEL or level[ground] > LEVEL):
        return head, f"{_up(head)}: {why}: the head is above the feet"
    return None


def _up(axis: str) -> str:
    return f"{axis[-1].upper()} points {'down' if axis[0] == '-' else 'up'}"


def _stands_along(found: dict[str, int], rest: np.ndarray) -> str | None:
    """The axis along which trunk and legs of the rest pose (joints, 3) stand, one over the other."""
    ends = [
        [found.get(f"{side}_{part}", -1) for side in anatomy.SIDES] for part in ("hip", "ankle", "shoulder")
    ]
    if -1 in ends[0] + ends[1] or ("head" not in found and -1 in ends[2]):
        return None
    hips, ankles = rest[ends[0]], rest[ends[1]]
    top = rest[found["head"]] if "head" in found else rest[ends[2]].mean(axis=0)
    lines = np.array([*(hips - ankles), top - hips.mean(axis=0)])
    lengths = np.linalg.norm(lines, axis=1, keepdims=True)
    if lengths.min() < 0.2 * lengths.max():
        return None
    return next((name for name, axis in AXES.items() if (lines / lengths @ axis).min() > STANDS), None)


def _head_along(found: dict[str, int], places: np.ndarray) -> str | None:
    """The axis from the feet to the head over the clip, places (frames, joints, 3); that of its largest
    extent where no names tell."""
    feet = [found[part] for part in ("left_ankle", "right_ankle") if part in found]
    if feet and "head" in found:
        along = (places[:, found["head"]] - places[:, feet].mean(axis=1)).mean(axis=0)
    else:
        along = np.ptp(places, axis=1).mean(axis=0)
    *_, second, most = np.argsort(np.abs(along))
    if abs(along[most]) < CLEAR * max(abs(along[second]), 1e-9):
        return None
    return "xyz"[most] if along[most] > 0.0 else f"-{'xyz'[most]}"


def _level(places: np.ndarray, axis: np.ndarray) -> float:
    """[-] How far the lowest joints along an axis are from 0 and from each other over the clip, as a share of
    how far joints get from the root."""
    low = (places @ axis).min(axis=1)
    far = np.linalg.norm(places - places[:, :1], axis=2).max()
    return float((abs(np.median(low)) + np.ptp(np.quantile(low, [0.05, 0.95]))) / max(far, 1e-9))
