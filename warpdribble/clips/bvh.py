"""BVH files in: brought to metres and Z up, known defects repaired and said.

The CMU conversion of 2010 (cgspeed.com) needs three things beyond the format: its length unit, the
added T-pose in the first row, and the lengths of its branching bones, which the conversion lost.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ..sims.recording.motion import Motion
from ..sims.recording.names import bare
from .bvh_places import carried, replaced
from .bvh_text import BvhText, Joint, read_bvh_text
from .errors import ClipError
from .rate import given_rate, rate_of
from .space import CMU_UNIT, check_numbers, into_room

CMU_JOINTS = {"LHipJoint", "RHipJoint", "LowerBack", "Spine", "Spine1", "LeftFingerBase", "LThumb"}
CMU_WRISTS = {
    "LeftHand": ("LeftFingerBase", "LThumb"),
    "RightHand": ("RightFingerBase", "RThumb"),
}
CMU_THORAX = ("Neck", "LeftShoulder", "RightShoulder")


def read_bvh(
    path: str | Path,
    units: str | float | None = None,
    up: str | None = None,
    rate: float | None = None,
    drop_positions: bool = False,
) -> tuple[Motion, list[str]]:
    """Read a BVH file as a Motion in metres, Z up, and notes on what was detected or repaired.

    units, up, rate, drop_positions: as in `clips.read_clip`. Frames count from 0; where the file begins with
    an added T-pose row, that row becomes the rest pose and frame 0 is the row after it. Raises ClipError when
    the file is missing, is not BVH, is cut short, or holds values that are no motion.
    """
    path = Path(path)
    file = read_bvh_text(path)
    names, notes = _names(file.joints)
    notes = [*file.notes, *notes]
    rate, said = given_rate(rate) if rate is not None else rate_of(path, file.frame_time)
    offsets = np.array([joint.offset for joint in file.joints])
    check_numbers(path, rows=file.rows, offsets=offsets)
    rotations, steps = _rotations(path, file), _steps(file, offsets)
    special = None
    if set(plain := list(bare(names))) >= CMU_JOINTS:
        special = (CMU_UNIT, "CMU conversion")
        if repaired := repair_cmu_offsets(plain, offsets):
            notes.append(f"CMU conversion: lost bone lengths put back at {', '.join(repaired)}")
            steps = {joint: step for joint, step in steps.items() if plain[joint] not in repaired}
    rest = np.tile([0.0, 0.0, 0.0, 1.0], (len(names), 1))
    if _is_added_pose(file):
        rest, rotations = rotations[0], rotations[1:]
        steps = {joint: step[1:] for joint, step in steps.items()}
        notes.append("first row is an added T-pose: used as the rest pose, frames count after it")
    root = steps.pop(0, None)
    if root is None:
        root = np.tile(offsets[0], (len(rotations), 1))
        notes.append(f"'{names[0]}' has no positions: the root stays where it is")
    motion = Motion(
        joint_names=tuple(names),
        parents=np.array([joint.parent for joint in file.joints]),
        offsets=offsets,
        rotations=rotations,
        root_position=root,
        rate=rate,
        rest_rotations=rest,
    )
    motion, steps, folded = carried(motion, steps)
    motion, apart, added = replaced(motion, steps, used=not drop_positions)
    moved, told = into_room(path, motion, units, up, special)
    scale = np.linalg.norm(moved.offsets) / max(float(np.linalg.norm(motion.offsets)), 1e-30)
    places = apart.said(float(scale), used=not drop_positions) if apart else ""
    return moved, [*notes, *(note for note in (said, folded, added, places) if note), *told]


def repair_cmu_offsets(names: list[str], offsets: np.ndarray) -> list[str]:
    """Give the branching bones of the CMU conversion their lengths back, in place; the names of
    those repaired.

    offsets: (joints, 3) in any unit. Only offsets that are exactly zero are touched. The wrist bone
    is half the radius (exact in the skeletons compared), the thorax continues the spine (within 3.5
    mm).
    """
    lost: dict[str, np.ndarray] = {}
    for hand, fingers in CMU_WRISTS.items():
        lost |= {f: 0.5 * offsets[names.index(hand)] for f in fingers if {f, hand} <= set(names)}
    lower, upper = (offsets[names.index(n)] for n in ("Spine", "Spine1"))
    lost |= {n: upper + 0.55 * (upper - lower) for n in CMU_THORAX if n in names}
    repaired = [n for n in lost if not offsets[names.index(n)].any()]
    for name in repaired:
        offsets[names.index(name)] = lost[name]
    return repaired


def _names(joints: list[Joint]) -> tuple[list[str], list[str]]:
    """A name for each joint, no two alike, the ends after their parents; and notes."""
    names = [""] * len(joints)
    taken: set[str] = set()
    doubled = []
    for number in sorted(range(len(joints)), key=lambda n: not joints[n].name):
        joint = joints[number]
        wanted = joint.name or f"{names[joint.parent]}_end"
        name, count = wanted, 1
        while name in taken:
            count += 1
            name = f"{wanted}_{count}"
        if joint.name and name != wanted:
            doubled.append(name)
        names[number] = name
        taken.add(name)
    return names, [f"joints of the same name, told apart as {', '.join(doubled)}"] if doubled else []


def _rotations(path: Path, file: BvhText) -> np.ndarray:
    """(frames, joints, 4) xyzw: the turns of a joint, one after another about its own axes, as listed."""
    rotations = np.zeros((len(file.rows), len(file.joints), 4))
    rotations[..., 3] = 1.0
    turning = False
    for number, joint in enumerate(file.joints):
        if turns := joint.columns("rotation"):
            order = "".join("XYZ"[axis] for axis, _ in turns)
            angles = np.radians(file.rows[:, [column for _, column in turns]])
            rotations[:, number] = Rotation.from_euler(order, angles).as_quat()
            turning = True
    if not turning:
        raise ClipError(path, "no joint has rotations: a motion of positions only cannot be used")
    return rotations


def _steps(file: BvhText, offsets: np.ndarray) -> dict[int, np.ndarray]:
    """Joint -> (frames, 3) where it lies in its parent's frame, for those that have positions."""
    steps = {}
    for number, joint in enumerate(file.joints):
        if places := joint.columns("position"):
            step = np.tile(offsets[number], (len(file.rows), 1))
            for axis, column in places:
                step[:, axis] = file.rows[:, column]
            steps[number] = step
    return steps


def _is_added_pose(file: BvhText) -> bool:
    """Whether row 0 was typed in, not recorded: root unturned, whole degrees."""
    turns = [column for joint in file.joints for _, column in joint.columns("rotation")]
    root = [column for _, column in file.joints[0].columns("rotation")]
    first, *others = file.rows[:2]
    return bool(
        others
        and not first[root].any()
        and np.abs(first[turns] - np.round(first[turns])).max() < 1e-9
        and np.abs(others[0][turns]).max() > 1.0
    )
