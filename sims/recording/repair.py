"""Repairs of a recorded motion, each of them optional and each saying what it did.

Rotations are filtered as unit quaternions with continuous signs, in the four dimensions they live in, and
put back on the sphere: turning all of them by the same rotation, from either side, turns the result by it
too; nothing is singular, and a steady spin of any number of turns stays what it is.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..signals import interpolate_lines, interpolate_rotations, low_pass, low_pass_rotations
from . import anatomy, defects
from .motion import RECORDED, Motion
from .stance import stance

Interpolate = Callable[[np.ndarray, np.ndarray], np.ndarray]
REPAIRS = ("spikes", "toes", "lowpass", "ground")
"""In the order in which they are made."""
WINDOW = 4
"""[frames] to either side that say where a joint should be."""
SPIKE_TURN, SPIKE_WAY = np.radians(6.0), 0.02
"""[rad], [m] A frame this far from the middle of those around it may be a spike."""
SPIKE_RATIO = 4.0
"""It is one when it is this many times as far as those usually are, with floors of a tenth of the above."""
SPIKE_SHARE = 0.15
"""A joint that would lose more of its frames than this is noisy, not spiked, and is left alone."""
TOE_CUT_OFF = 5.0
"""[Hz] A toe bends and straightens within about 0.2 s."""
CUT_OFF = 8.0
"""[Hz] Hands that dribble move up and down at up to 3 Hz and stop within about 0.1 s."""
SOLE = 0.02
"""[m] Height of the lowest joint of a standing foot: what BallPlay-M, whose ground is known, shows."""


def repair(motion: Motion, names: Collection[str]) -> tuple[Motion, list[str]]:
    """The motion with the named repairs, and a note on each. Raises InputError for an unknown name."""
    for name in names:
        if name not in REPAIRS:
            raise InputError(f"there is no repair '{name}': there are {', '.join(REPAIRS)}", "", "repairs")
    notes = []
    for name in REPAIRS:
        if name in names:
            motion, said = STEPS[name](motion)
            notes.append(f"repair {name}: {said}")
    return motion, notes


def spikes(motion: Motion) -> tuple[Motion, str]:
    """Replace frames in which a joint is for a moment far from where it is before and after, by what lies
    between their good neighbours."""
    if motion.frame_count <= 2 * WINDOW:
        return motion, "too short to tell"
    rotations, positions = motion.rotations.copy(), motion.positions
    joints, touched = defects.watched(motion), {}

    def bridge(name: str, values: np.ndarray, flags: np.ndarray, interpolate: Interpolate) -> np.ndarray:
        if not 0 < flags.sum() <= SPIKE_SHARE * len(flags):
            return values
        touched[name] = int(flags.sum())
        return _bridge(values, flags, interpolate)

    for joint, flags in zip(joints, _off_rotations(rotations[:, joints]).T):
        name = motion.joint_names[joint]
        rotations[:, joint] = bridge(name, rotations[:, joint], flags, interpolate_rotations)
    root = motion.root_position
    root = bridge("place of the root", root, _off_places(root), interpolate_lines)
    if positions is not None:
        positions = positions.copy()
        for joint in joints:
            path, name = positions[:, joint], f"place of {motion.joint_names[joint]}"
            positions[:, joint] = bridge(name, path, _off_places(path), interpolate_lines)
    said = ", ".join(f"{name} {count}" for name, count in touched.items())
    motion = replace(motion, rotations=rotations, root_position=root, positions=positions)
    return motion, f"frames bridged: {said}" if touched else "none found"


def toes(motion: Motion) -> tuple[Motion, str]:
    """Low-pass the rotations of the toes, the noisiest joints of most recordings."""
    found = anatomy.parts(motion.joint_names, motion.parents)
    joints = [found[f"{side}_toe"] for side in anatomy.SIDES if f"{side}_toe" in found]
    rotations = motion.rotations.copy()
    rotations[:, joints] = low_pass_rotations(rotations[:, joints], motion.rate, TOE_CUT_OFF)
    change = _largest_turn(motion.rotations[:, joints], rotations[:, joints])
    said = f"low-pass {TOE_CUT_OFF:g} Hz, changed by up to {change:.1f} degrees"
    return replace(motion, rotations=rotations), said if joints else "no toe joints"


def lowpass(motion: Motion) -> tuple[Motion, str]:
    """Low-pass all rotations, the root's place and recorded joint positions; a recorded ball stays, as its
    bounces are sharp."""
    rotations = low_pass_rotations(motion.rotations, motion.rate, CUT_OFF)
    positions = motion.positions
    if positions is not None:
        positions = low_pass(positions, motion.rate, CUT_OFF)
    root = low_pass(motion.root_position, motion.rate, CUT_OFF)
    joints = defects.watched(motion)
    change = _largest_turn(motion.rotations[:, joints], rotations[:, joints])
    moved = replace(motion, rotations=rotations, root_position=root, positions=positions)
    return moved, f"{CUT_OFF:g} Hz, joints (fingers left out) turned by up to {change:.1f} degrees"


def ground(motion: Motion) -> tuple[Motion, str]:
    """Raise or lower everything so that standing feet are on z = 0. With a recorded ball the ground is the
    recording's own and stays."""
    if motion.ball is not None:
        return motion, "left as recorded with the ball"
    _, height, _ = stance(motion)
    if np.isnan(height):
        return motion, "no foot stands, left as it is"
    up = np.array([0.0, 0.0, SOLE - height])
    recorded = {n: getattr(motion, n) for n in RECORDED if n != "ball_held"}
    moved = {n: values + up for n, values in recorded.items() if values is not None}
    said = f"moved by {100.0 * up[2]:+.1f} cm"
    return replace(motion, root_position=motion.root_position + up, **moved), said


STEPS = {"spikes": spikes, "toes": toes, "lowpass": lowpass, "ground": ground}


def _off_rotations(quaternions: np.ndarray) -> np.ndarray:
    """Frames (frames, joints) bool in which a joint is off: the rotations around, seen from it, lie apart
    from it and together."""
    frames, joints = quaternions.shape[:2]
    own = Rotation.from_quat(quaternions.reshape(-1, 4)).inv()
    at = _around(frames)
    seen = [(own * Rotation.from_quat(quaternions[i].reshape(-1, 4))).as_rotvec() for i in at.T]
    return _off(np.stack(seen).reshape(len(seen), frames, joints, 3), SPIKE_TURN)


def _off_places(path: np.ndarray) -> np.ndarray:
    """The same for a path (frames, 3) [m]."""
    seen = np.stack([path[i] - path for i in _around(len(path)).T])
    return _off(seen, SPIKE_WAY)


def _around(frames: int) -> np.ndarray:
    """Frame numbers (frames, 2 WINDOW) around each frame, moved inward at the ends."""
    offsets = [i for i in range(-WINDOW, WINDOW + 1) if i]
    middle = np.clip(np.arange(frames), WINDOW, frames - 1 - WINDOW)
    return middle[:, None] + offsets


def _off(seen: np.ndarray, least: float) -> np.ndarray:
    """Whether the places around (around, ..., 3) lie apart from the origin: (...) bool."""
    usual = np.median(seen, axis=0)
    unrest = np.median(np.linalg.norm(seen - usual, axis=-1), axis=0)
    apart = np.linalg.norm(usual, axis=-1)
    off = (apart > least) & (apart > SPIKE_RATIO * (unrest + 0.1 * least))
    off[:WINDOW] = off[-WINDOW:] = False
    return off


def _bridge(values: np.ndarray, flags: np.ndarray, interpolate: Interpolate) -> np.ndarray:
    """Values (frames, n) with those flagged (frames,) taken from between their good neighbours."""
    good = np.flatnonzero(~flags)
    at = np.interp(np.arange(len(values)), good, np.arange(len(good)))
    new = values.copy()
    new[flags] = interpolate(values[good], at[flags])
    return new


def _largest_turn(before: np.ndarray, after: np.ndarray) -> float:
    """[deg] largest angle between two stacks of rotations."""
    if not before.size:
        return 0.0
    apart = Rotation.from_quat(before.reshape(-1, 4)).inv() * Rotation.from_quat(after.reshape(-1, 4))
    return float(np.degrees(apart.magnitude().max()))
