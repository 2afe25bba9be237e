"""ASF: the skeleton of an Acclaim recording (CMU's original format), read strictly.

    :units      length scale, angle in degrees or radians
    :root       order of its channels, position and orientation
    :bonedata   per bone: direction, length, axis (the frame its angles are about) and dof
    :hierarchy  lines "parent child child ..."

Format: Acclaim "ASF/AMC" by M. Lander (Game Developer, Jan 1998) and the files of mocap.cs.cmu.edu.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from .errors import ClipError

TURNS = {"rx": 0, "ry": 1, "rz": 2}
SHIFTS = {"tx": 0, "ty": 1, "tz": 2}
LARGEST = 64 * 2**20
"""[bytes] of a text file that is read."""


@dataclass
class Bone:
    """A segment; it turns at its near end, where its parent ends."""

    name: str
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """(3,) from its near to its far end in the zero pose, file units."""
    axis: Rotation = field(default_factory=Rotation.identity)
    """Frame its angles are about, in the zero pose (C of the format's descriptions)."""
    dof: tuple[str, ...] = ()
    """Channels in the order of the AMC file's numbers."""
    parent: str = ""
    """Empty for the root."""


@dataclass
class Skeleton:
    """What an ASF file says."""

    bones: dict[str, Bone]
    """By name, parents first, beginning with "root"."""
    length: float
    """The header's length scale: lengths are inches times this in CMU's files."""
    degrees: bool
    """Whether angles are degrees."""


def read_text(path: Path, kind: str) -> list[list[str]]:
    """The words of each line, comments and empty lines left out. Raises ClipError."""
    if not path.exists():
        raise ClipError(path, "no such file")
    if path.is_dir():
        raise ClipError(path, f"is a folder, not an {kind} file")
    try:
        if path.stat().st_size > LARGEST:
            raise ClipError(path, f"larger than {LARGEST // 2**20} MB")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ClipError(path, error.strerror or "cannot be read") from None
    except UnicodeDecodeError:
        raise ClipError(path, f"not an {kind} file (binary data)") from None
    lines = (line.partition("#")[0].split() for line in text.splitlines())
    return [line for line in lines if line]


def read_asf(path: str | Path) -> Skeleton:
    """Read a skeleton. Raises ClipError."""
    path = Path(path)
    sections = _sections(path, read_text(path, "ASF"))
    for name in (":root", ":bonedata", ":hierarchy"):
        if name not in sections:
            raise ClipError(path, f"no ASF file, or cut short: it has no {name}")
    try:
        units = {line[0]: line[1] for line in sections.get(":units", []) if len(line) == 2}
        length = float(units.get("length", "1"))
        degrees = units.get("angle", "deg").startswith("deg")
        bones = {"root": _root(sections[":root"], degrees)}
        for bone in _bones(sections[":bonedata"], degrees):
            if bone.name in bones:
                raise ValueError(f"two bones are called '{bone.name}'")
            bones[bone.name] = bone
        ordered = _ordered(bones, sections[":hierarchy"])
    except (ValueError, IndexError, KeyError) as error:
        raise ClipError(path, f"broken ASF: {error}") from None
    if not np.isfinite(length) or length <= 0.0:
        raise ClipError(path, f"a length scale of {length} is none")
    return Skeleton(ordered, length, degrees)


def _sections(path: Path, lines: list[list[str]]) -> dict[str, list[list[str]]]:
    found: dict[str, list[list[str]]] = {}
    inside: list[list[str]] = []
    for line in lines:
        if line[0].startswith(":"):
            if line[0] in found:
                raise ClipError(path, f"broken ASF: {line[0]} twice")
            inside = found[line[0]] = []
        else:
            inside.append(line)
    return found


def _root(lines: list[list[str]], degrees: bool) -> Bone:
    values = {line[0]: line[1:] for line in lines}
    dof = tuple(word.lower() for word in values["order"])
    if set(dof) - set(TURNS) - set(SHIFTS) or len(set(dof)) < len(dof):
        raise ValueError(f"the root's channels {' '.join(dof)} are not positions and rotations")
    turn = _frame([*values.get("orientation", ["0", "0", "0"]), *values.get("axis", ["XYZ"])], degrees)
    return Bone("root", np.zeros(3), turn, dof)


def _bones(lines: list[list[str]], degrees: bool) -> list[Bone]:
    bones: list[Bone] = []
    values: dict[str, list[str]] | None = None
    for line in lines:
        if line[0] == "begin":
            values = {}
        elif line[0] == "end":
            if values is None:
                raise ValueError("an 'end' without 'begin' among the bones")
            bones.append(_bone(values, degrees))
            values = None
        elif values is not None and line[0] not in values:
            values[line[0]] = line[1:]
    if values is not None:
        raise ValueError("the last bone has no 'end'")
    return bones


def _bone(values: dict[str, list[str]], degrees: bool) -> Bone:
    for key in ("name", "direction", "length", "axis"):
        if key not in values:
            raise ValueError(f"bone {' '.join(values.get('name', ['?']))} has no {key}")
    name = values["name"][0]
    dof = tuple(word.lower() for word in values.get("dof", []))
    if set(dof) - set(TURNS) or len(set(dof)) < len(dof):
        raise ValueError(f"bone {name}: channels {' '.join(dof)} are not rotations")
    offset = _numbers(values["direction"], 3) * _numbers(values["length"], 1)
    return Bone(name, offset, _frame(values["axis"], degrees), dof)


def _ordered(bones: dict[str, Bone], lines: list[list[str]]) -> dict[str, Bone]:
    """Bones, parents first, with their parents set; every bone must hang from the root."""
    ordered = {"root": bones["root"]}
    for parent, *children in (line for line in lines if line[0] not in ("begin", "end")):
        for child in children:
            if child not in bones or parent not in ordered or child in ordered:
                raise ValueError(f"the hierarchy puts '{child}' below '{parent}'")
            bones[child].parent = parent
            ordered[child] = bones[child]
    if len(ordered) < len(bones):
        lost = next(name for name in bones if name not in ordered)
        raise ValueError(f"the hierarchy leaves out '{lost}'")
    return ordered


def _frame(words: list[str], degrees: bool) -> Rotation:
    """'20 0 40 XYZ': turned about the world's X, then Y, then Z."""
    order = words[3].lower() if len(words) > 3 else "xyz"
    if sorted(order) != ["x", "y", "z"]:
        raise ValueError(f"an axis order of {order.upper()}")
    values = _numbers(words[:3], 3)
    return Rotation.from_euler(order, values[["xyz".index(letter) for letter in order]], degrees=degrees)


def _numbers(words: list[str], count: int) -> np.ndarray:
    values = np.array([float(word) for word in words])
    if len(values) != count or not np.isfinite(values).all() or np.abs(values).max() > 1e6:
        raise ValueError(f"{' '.join(words)} should be {count} numbers")
    return values
