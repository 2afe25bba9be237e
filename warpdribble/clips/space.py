"""From a file's own lengths and axes to metres and Z up: given, or told from the skeleton."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ..sims.errors import InputError
from ..sims.recording import anatomy
from ..sims.recording.motion import Motion
from .errors import ClipError
from .upright import find_up

CMU_UNIT = 2.54 / 100 / 0.45
"""[m] of one length unit of CMU's data: inches, divided by the 0.45 of the ASF header."""
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "foot": 0.3048, "cmu": CMU_UNIT}
PERSON = (0.7, 2.2)
"""[m] from the root to the farthest end of a person's skeleton."""
TO_Z_UP = {
    "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}
TO_Z_UP |= {f"-{axis}": np.diag([1.0, -1.0, -1.0]) @ turn for axis, turn in TO_Z_UP.items()}
"""Up axis of a file -> the cyclic change of axes that makes it Z; half a turn more where it points down."""
LARGEST = 1e7
"""No number of a clip is larger, in any unit."""


def check_numbers(path: Path, **values: np.ndarray) -> None:
    """Raise ClipError where a named array holds what is no number of a motion."""
    for name, array in values.items():
        if not np.isfinite(array).all():
            raise ClipError(path, f"the {name} hold values that are not finite numbers")
        if array.size and np.abs(array).max() > LARGEST:
            raise ClipError(path, f"the {name} hold the value {array.flat[np.abs(array).argmax()]:.3g}")


def into_room(
    path: Path,
    motion: Motion,
    units: str | float | None,
    up: str | None,
    special: tuple[float, str] | None = None,
) -> tuple[Motion, list[str]]:
    """A motion as its file has it, brought to metres and Z up, rest pose facing +X; and notes.

    units: a name of UNITS, metres per unit, or None; up: "x", "y", "z" or None. special: (metres per
    unit, its name) that is tried first when none are given. Raises ClipError for what cannot be told.
    """
    scale, said = _unit(path, motion, units, special)
    axis, told = _up(path, motion, up)
    turn = TO_Z_UP[axis]
    yaw = _facing(motion, turn)
    turn = Rotation.from_euler("z", 90.0 * yaw, degrees=True).as_matrix().round() @ turn
    moved = replace(
        motion,
        offsets=scale * motion.offsets @ turn.T,
        rotations=change_basis(motion.rotations, turn),
        root_position=scale * motion.root_position @ turn.T,
        rest_rotations=change_basis(motion.rest_rotations, turn),
        positions=None if motion.positions is None else scale * motion.positions @ turn.T,
    )
    return moved, [note for note in (said, told) if note]


def change_basis(quaternions: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Rotations seen in a basis turned by `turn`: the vector part turns, the angle stays."""
    return np.concatenate([quaternions[..., :3] @ turn.T, quaternions[..., 3:]], axis=-1)


def _unit(
    path: Path, motion: Motion, units: str | float | None, special: tuple[float, str] | None
) -> tuple[float, str]:
    """Metres per length unit, and how it was told."""
    if units is not None:
        scale = metres(units)
        return scale, f"length unit given: {scale:.6g} m"
    reach = np.zeros(len(motion.joint_names))
    for joint in range(1, len(reach)):
        reach[joint] = reach[motion.parents[joint]] + np.linalg.norm(motion.offsets[joint])
    longest = reach.max()
    names = {"m": "metre", "cm": "centimetre", "mm": "millimetre", "inch": "inch"}
    if special is not None and PERSON[0] < special[0] * longest < PERSON[1]:
        return special[0], f"{special[1]}: one length unit is {special[0]:.6f} m"
    for unit, name in names.items():
        if PERSON[0] < UNITS[unit] * longest < PERSON[1]:
            how = f"root to farthest end {longest:.4g}"
            return UNITS[unit], f"length unit taken as one {name} ({how})"
    raise ClipError(
        path,
        f"cannot tell the length unit: from root to farthest end {longest:.4g} units; "
        f"it may be {', '.join(UNITS)} or metres per unit",
        "units",
    )


def metres(units: str | float) -> float:
    """Metres per unit of a name of UNITS or a number. Raises InputError for anything else."""
    if units in UNITS:
        return UNITS[units]
    try:
        scale = float(units)
    except (TypeError, ValueError):
        scale = np.nan
    if not 1e-6 < scale < 1e6:
        raise InputError(
            f"there is no unit '{units}': it is {', '.join(UNITS)} or metres per unit", "", "units"
        )
    return scale


def _up(path: Path, motion: Motion, up: str | None) -> tuple[str, str]:
    """The axis that points up, and how it was told."""
    if up is not None:
        if up not in tuple("xyz"):
            raise InputError(f"there is no axis '{up}': it is x, y or z", "", "up")
        return up, f"up axis given: {up.upper()}"
    told = find_up(motion)
    if told is None:
        raise ClipError(path, "cannot tell which axis points up: x, y or z", "up")
    return told


def _facing(motion: Motion, turn: np.ndarray) -> int:
    """Quarter turns about Z after `turn` that bring the rest pose's left side to +Y; 0 when it shows none."""
    found = anatomy.parts(motion.joint_names, motion.parents)
    left = anatomy.leftward(found, motion.rest()[0] @ turn.T)
    if left is None or np.abs(left[:2]).max() < 0.8:
        return 0
    return round(1.0 - 2.0 / np.pi * float(np.arctan2(left[1], left[0]))) % 4
