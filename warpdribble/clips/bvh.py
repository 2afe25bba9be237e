"""BVH files in: read strictly, brought to metres and Z up, known defects repaired and said.

The CMU conversion of 2010 (cgspeed.com) needs three things beyond the format: its length unit, the
added T-pose in the first row, and the lengths of its branching bones, which the conversion lost.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pybvh
from scipy.spatial.transform import Rotation

from ..sims.recording.motion import Motion
from .errors import ClipError
from .space import CMU_UNIT, check_numbers, into_room

CMU_JOINTS = {"LHipJoint", "RHipJoint", "LowerBack", "Spine", "Spine1", "LeftFingerBase", "LThumb"}
CMU_WRISTS = {
    "LeftHand": ("LeftFingerBase", "LThumb"),
    "RightHand": ("RightFingerBase", "RThumb"),
}
CMU_THORAX = ("Neck", "LeftShoulder", "RightShoulder")


def read_bvh(
    path: str | Path, units: str | float | None = None, up: str | None = None
) -> tuple[Motion, list[str]]:
    """Read a BVH file as a Motion in metres, Z up, and notes on what was detected or repaired.

    units, up: as in `clips.read_clip`. Frames count from 0; where the file begins with an added T-pose
    row, that row becomes the rest pose and frame 0 is the row after it. Raises ClipError when the file is
    missing, is not BVH, is cut short, or holds values that are no motion.
    """
    path = Path(path)
    clip = _parse(path)
    names, parents, offsets = _skeleton(clip)
    if len(set(names)) < len(names):
        raise ClipError(path, f"two joints are called '{max(names, key=names.count)}'")
    angles, position = clip.joint_angles, clip.root_pos
    check_numbers(path, **{"joint angles": angles, "root positions": position, "offsets": offsets})
    if not 1.0 <= 1.0 / clip.frame_time <= 2000.0:
        raise ClipError(path, f"a frame time of {clip.frame_time} s is not that of a motion")

    notes = []
    joints = [names.index(name) for name in clip.joint_names]
    rotations = np.zeros((len(angles), len(names), 4))
    rotations[..., 3] = 1.0
    for i, joint in enumerate(joints):
        rotations[:, joint] = Rotation.from_euler(clip.euler_orders[i], angles[:, i]).as_quat()

    special = None
    if set(names) >= CMU_JOINTS:
        special = (CMU_UNIT, "CMU conversion")
        repaired = repair_cmu_offsets(names, offsets)
        if repaired:
            notes.append(f"CMU conversion: lost bone lengths put back at {', '.join(repaired)}")
    rest = np.tile([0.0, 0.0, 0.0, 1.0], (len(names), 1))
    if _is_added_pose(angles):
        rest, rotations, position = rotations[0], rotations[1:], position[1:]
        notes.append("first row is an added T-pose: used as the rest pose, frames count after it")
    motion = Motion(
        joint_names=tuple(names),
        parents=np.array(parents),
        offsets=offsets,
        rotations=rotations,
        root_position=position,
        rate=1.0 / clip.frame_time,
        rest_rotations=rest,
    )
    motion, told = into_room(path, motion, units, up, special)
    return motion, notes + told


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


def _parse(path: Path) -> pybvh.Bvh:
    if not path.exists():
        raise ClipError(path, "no such file")
    if path.is_dir():
        raise ClipError(path, "is a folder, not a BVH file")
    if path.suffix.lower() != ".bvh":
        raise ClipError(path, f"only .bvh clips can be read, not '{path.suffix or path.name}'")
    try:
        head = path.read_text().partition("MOTION")[0]
        if head.count("{") != head.count("}"):
            raise ClipError(path, "broken BVH: the braces of the hierarchy do not match")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return pybvh.read_bvh_file(path)
    except ClipError:
        raise
    except OSError as error:
        raise ClipError(path, error.strerror or str(error)) from None
    except UnicodeDecodeError:
        raise ClipError(path, "not a BVH file (binary data)") from None
    except Exception as error:
        reason = " ".join(str(error).replace(f"in file {path}", "").replace(f"in {path}", "").split())
        raise ClipError(path, f"broken BVH: {reason or type(error).__name__}") from None


def _skeleton(clip: pybvh.Bvh) -> tuple[list[str], list[int], np.ndarray]:
    numbers = {id(node): i for i, node in enumerate(clip.nodes)}
    names: list[str] = []
    for node in clip.nodes:
        name = f"{node.parent.name}_end" if node.is_end_site() else node.name
        same = sum(n == name or n.startswith(f"{name}_") for n in names)
        names.append(f"{name}_{same + 1}" if same and node.is_end_site() else name)
    parents = [-1 if n.parent is None else numbers[id(n.parent)] for n in clip.nodes]
    return names, parents, np.array([n.offset for n in clip.nodes], dtype=float)


def _is_added_pose(angles: np.ndarray) -> bool:
    """Whether row 0 of angles (frames, joints, 3) [rad] was typed in, not recorded: root
    unturned, whole degrees."""
    degrees = np.degrees(angles[0])
    return (
        len(angles) > 1
        and not degrees[0].any()
        and np.abs(degrees - np.round(degrees)).max() < 1e-9
        and np.abs(np.degrees(angles[1])).max() > 1.0
    )
