"""ASF/AMC clips in (CMU's original format): the AMC file has the angles, the ASF file the skeleton.

A bone with axis frame C and angles M (its channels in their order, each about a fixed axis of C) is turned
against its parent by C M C^-1; its far end lies at its near end plus that rotation times direction x length.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ..sims.recording.motion import Motion
from .asf import SHIFTS, TURNS, Bone, Skeleton, read_asf, read_text
from .errors import ClipError
from .rate import given_rate, header_rate
from .space import CMU_UNIT, check_numbers, into_room

RATE = 120.0
"""[Hz] where no header says it, as none of CMU's does; most of their recordings of people have this."""
RATE_WORDS = (":samples-per-second", ":sample-rate", ":frames-per-second", ":frame-rate", ":fps")
BVH_NAMES = {
    "root": "Hips", "lowerback": "LowerBack", "upperback": "Spine", "thorax": "Spine1",
    "lowerneck": "Neck", "upperneck": "Neck1", "head": "Head",
}  # fmt: skip
SIDE_NAMES = {
    "hipjoint": "{short}HipJoint", "femur": "{side}UpLeg", "tibia": "{side}Leg", "foot": "{side}Foot",
    "toes": "{side}ToeBase", "clavicle": "{side}Shoulder", "humerus": "{side}Arm",
    "radius": "{side}ForeArm", "wrist": "{side}Hand", "hand": "{side}FingerBase",
    "fingers": "{side}HandIndex1", "thumb": "{short}Thumb",
}  # fmt: skip
for _short, _side in (("l", "Left"), ("r", "Right")):
    for _bone, _name in SIDE_NAMES.items():
        BVH_NAMES[_short + _bone] = _name.format(short=_short.upper(), side=_side)
"""CMU's bones -> the joints of their BVH conversion, so that both are one skeleton to all that follows."""


def read_amc(
    path: str | Path,
    units: str | float | None = None,
    up: str | None = None,
    asf: str | Path | None = None,
    rate: float | None = None,
) -> tuple[Motion, list[str]]:
    """Read an AMC file as a Motion in metres, Z up, and notes.

    asf: the skeleton; without it the one ASF file of the same name, of the part before `_`, or alone in
    the folder. units, up, rate: as in `clips.read_clip`. Raises ClipError.
    """
    path = Path(path)
    lines = read_text(path, "AMC")
    asf = Path(asf) if asf is not None else _skeleton_beside(path)
    skeleton = read_asf(asf)
    numbers, degrees = _frames(path, lines, skeleton)
    rate, said = given_rate(rate) if rate is not None else _rate(path, lines)
    motion = _motion(path, skeleton, numbers, degrees, rate)
    notes = [f"skeleton {asf.name}; {said}"]
    special = None
    if set(skeleton.bones) == set(BVH_NAMES):
        notes.append("CMU skeleton: joints named as in its BVH conversion")
    if skeleton.length != 1.0:
        special = (0.0254 / skeleton.length, f"inches, scaled by {skeleton.length:g} in the ASF header")
        if abs(special[0] - CMU_UNIT) < 1e-9:
            special = (CMU_UNIT, "CMU, inches over 0.45")
    motion, told = into_room(path, motion, units, up, special)
    return motion, notes + told


def _skeleton_beside(path: Path) -> Path:
    """The ASF file that belongs to an AMC file."""
    beside = sorted(p for p in path.parent.iterdir() if p.suffix.lower() == ".asf" and p.is_file())
    for stem in (path.stem, path.stem.partition("_")[0]):
        for asf in beside:
            if asf.stem.lower() == stem.lower():
                return asf
    if len(beside) == 1:
        return beside[0]
    has = "there is none" if not beside else f"there are {', '.join(p.name for p in beside[:3])}"
    raise ClipError(path, f"needs its skeleton, {path.stem.partition('_')[0]}.asf, beside it; {has}")


def _rate(path: Path, lines: list[list[str]]) -> tuple[float, str]:
    """[Hz] of the header, and a note."""
    for line in lines:
        if line[0].lower() in RATE_WORDS:
            return header_rate(path, " ".join(line[1:]))
    return RATE, f"rate taken as {RATE:g} Hz, the file does not say it"


def _frames(path: Path, lines: list[list[str]], skeleton: Skeleton) -> tuple[dict[str, np.ndarray], bool]:
    """Channels (frames, dof) of every bone that has any, and whether angles are degrees."""
    degrees = skeleton.degrees
    rows: dict[str, list[list[float]]] = {n: [] for n, b in skeleton.bones.items() if b.dof}
    frame = 0
    for line in lines:
        if line[0].startswith(":"):
            degrees = {":degrees": True, ":radians": False}.get(line[0].lower(), degrees)
        elif len(line) == 1 and line[0].isdecimal():
            _check_complete(path, rows, frame)
            frame += 1
        else:
            name, *words = line
            if frame == 0 or name not in rows or len(rows[name]) != frame - 1:
                raise ClipError(path, f"broken AMC: '{name[:40]}' in frame {frame} is not expected")
            if len(words) != len(skeleton.bones[name].dof):
                raise ClipError(path, f"broken AMC: '{name}' in frame {frame} has {len(words)} numbers")
            try:
                rows[name].append([float(word) for word in words])
            except ValueError:
                reason = f"'{name}' in frame {frame} holds what is no number"
                raise ClipError(path, f"broken AMC: {reason}") from None
    if frame == 0:
        raise ClipError(path, "no AMC file: it has no frames")
    _check_complete(path, rows, frame)
    numbers = {name: np.array(values) for name, values in rows.items()}
    check_numbers(path, **{f"channels of {name}": values for name, values in numbers.items()})
    return numbers, degrees


def _check_complete(path: Path, rows: dict[str, list[list[float]]], frame: int) -> None:
    short = [name for name, values in rows.items() if len(values) < frame]
    if short:
        raise ClipError(path, f"broken AMC: frame {frame} lacks {', '.join(short[:3])}")


def _motion(
    path: Path, skeleton: Skeleton, numbers: dict[str, np.ndarray], degrees: bool, rate: float
) -> Motion:
    """The motion in the file's units and axes: a joint where each bone begins, an end where a chain ends."""
    bones = list(skeleton.bones.values())
    numbering = {bone.name: i for i, bone in enumerate(bones)}
    ends = [b for b in bones[1:] if not any(c.parent == b.name for c in bones)]
    plain = set(skeleton.bones) == set(BVH_NAMES)
    names = [BVH_NAMES[b.name] if plain else b.name for b in bones]
    names += [f"{names[numbering[b.name]]}_end" for b in ends]
    above = [numbering[b.parent] for b in bones[1:]] + [numbering[b.name] for b in ends]
    offsets = [np.zeros(3), *(skeleton.bones[b.parent].offset for b in bones[1:]), *(b.offset for b in ends)]
    frames = len(numbers["root"]) if "root" in numbers else 0
    if not frames:
        raise ClipError(path, "broken ASF: the root has no channels")
    rotations = np.zeros((frames, len(names), 4))
    rotations[..., 3] = 1.0
    for i, bone in enumerate(bones):
        if bone.dof:
            rotations[:, i] = _turn(bone, numbers[bone.name], degrees).as_quat()
    position = np.zeros((frames, 3))
    for column, word in enumerate(bones[0].dof):
        if word in SHIFTS:
            position[:, SHIFTS[word]] = numbers["root"][:, column]
    return Motion(
        joint_names=tuple(names),
        parents=np.array([-1, *above]),
        offsets=np.array(offsets),
        rotations=rotations,
        root_position=position,
        rate=rate,
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (len(names), 1)),
    )


def _turn(bone: Bone, channels: np.ndarray, degrees: bool) -> Rotation:
    """C M C^-1 of a bone; the first rotation channel is made first, about fixed axes."""
    turn = Rotation.identity(len(channels))
    for column, word in enumerate(bone.dof):
        if word in TURNS:
            axis = np.eye(3)[TURNS[word]]
            angle = np.radians(channels[:, column]) if degrees else channels[:, column]
            turn = Rotation.from_rotvec(angle[:, None] * axis) * turn
    return bone.axis * turn * bone.axis.inv()
