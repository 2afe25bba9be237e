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

from .clip_error import ClipError
from .sims.motion import Motion

CMU_UNIT = 2.54 / 100 / 0.45
"""[m] of one length unit in the CMU conversion: inches, divided by the 0.45 of the ASF header."""
CMU_JOINTS = {"LHipJoint", "RHipJoint", "LowerBack", "Spine", "Spine1", "LeftFingerBase", "LThumb"}
CMU_WRISTS = {
    "LeftHand": ("LeftFingerBase", "LThumb"),
    "RightHand": ("RightFingerBase", "RThumb"),
}
CMU_THORAX = ("Neck", "LeftShoulder", "RightShoulder")

Z_UP_FROM_Y_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Takes a rest pose facing +Z, left +X, up +Y to one facing +X, left +Y, up +Z."""


def read_bvh(path: str | Path) -> tuple[Motion, list[str]]:
    """Read a BVH file as a Motion in metres, Z up, and notes on what was detected or repaired.

    Frames count from 0; where the file begins with an added T-pose row, that row becomes the rest
    pose and frame 0 is the row after it. Raises ClipError when the file is missing, is not BVH, is
    cut short, or holds values that are no motion.
    """
    path = Path(path)
    clip = _parse(path)
    names, parents, offsets = _skeleton(clip)
    angles = clip.joint_angles
    if not (np.isfinite(angles).all() and np.isfinite(clip.root_pos).all()):
        raise ClipError(path, "the motion holds values that are not finite numbers")
    if not np.isfinite(offsets).all():
        raise ClipError(path, "the skeleton holds offsets that are not finite numbers")
    if not 1.0 <= 1.0 / clip.frame_time <= 2000.0:
        raise ClipError(path, f"a frame time of {clip.frame_time} s is not that of a motion")

    notes = []
    joints = [names.index(name) for name in clip.joint_names]
    rotations = np.zeros((len(angles), len(names), 4))
    rotations[..., 3] = 1.0
    for i, joint in enumerate(joints):
        rotations[:, joint] = Rotation.from_euler(clip.euler_orders[i], angles[:, i]).as_quat()

    if set(names) >= CMU_JOINTS:
        repaired = repair_cmu_offsets(names, offsets)
        if repaired:
            notes.append(f"CMU conversion: lost bone lengths put back at {', '.join(repaired)}")
    unit, said = _unit(path, names, parents, offsets)
    notes.append(said)

    rest = np.tile([0.0, 0.0, 0.0, 1.0], (len(names), 1))
    position = clip.root_pos
    if _is_added_pose(angles):
        rest, rotations, position = rotations[0], rotations[1:], position[1:]
        notes.append("first row is an added T-pose: used as the rest pose, frames count after it")

    turn = Z_UP_FROM_Y_UP if "y" in clip.world_up.lower() else np.eye(3)
    return (
        Motion(
            joint_names=tuple(names),
            parents=np.array(parents),
            offsets=unit * offsets @ turn.T,
            rotations=_change_basis(rotations, turn),
            root_position=unit * position @ turn.T,
            rate=1.0 / clip.frame_time,
            rest_rotations=_change_basis(rest, turn),
        ),
        notes,
    )


def repair_cmu_offsets(names: list[str], offsets: np.ndarray) -> list[str]:
    """Give the branching bones of the CMU conversion their lengths back, in place; the names of
    those repaired.

    offsets: (joints, 3) in any unit. Only offsets that are exactly zero are touched. The wrist bone
    is half the radius (exact in the skeletons compared), the thorax continues the spine (within 3.5
    mm).
    """
    lost = {}
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
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return pybvh.read_bvh_file(path)
    except OSError as error:
        raise ClipError(path, error.strerror or str(error)) from None
    except UnicodeDecodeError:
        raise ClipError(path, "not a BVH file (binary data)") from None
    except Exception as error:
        reason = " ".join(
            str(error).replace(f"in file {path}", "").replace(f"in {path}", "").split()
        )
        raise ClipError(path, f"broken BVH: {reason or type(error).__name__}") from None


def _skeleton(clip: pybvh.Bvh) -> tuple[list[str], list[int], np.ndarray]:
    numbers = {id(node): i for i, node in enumerate(clip.nodes)}
    names = [f"{n.parent.name}_end" if n.is_end_site() else n.name for n in clip.nodes]
    parents = [-1 if n.parent is None else numbers[id(n.parent)] for n in clip.nodes]
    return names, parents, np.array([n.offset for n in clip.nodes], dtype=float)


def _unit(path, names, parents, offsets) -> tuple[float, str]:
    """Metres per length unit, and how it was told."""
    reach = np.zeros(len(names))
    for joint in range(1, len(names)):
        reach[joint] = reach[parents[joint]] + np.linalg.norm(offsets[joint])
    longest = reach.max()
    if set(names) >= CMU_JOINTS and 12.0 < longest < 25.0:
        return CMU_UNIT, f"CMU conversion: one length unit is {CMU_UNIT:.6f} m"
    for unit, name, low, high in ((1.0, "metre", 0.7, 2.2), (0.01, "centimetre", 70.0, 220.0)):
        if low < longest < high:
            return unit, f"length unit taken as one {name} (root to farthest end {longest:.4g})"
    raise ClipError(
        path, f"cannot tell the length unit: from root to farthest end {longest:.4g} units"
    )


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


def _change_basis(quaternions: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Rotations seen in a basis turned by `turn`: the vector part turns, the angle stays."""
    return np.concatenate([quaternions[..., :3] @ turn.T, quaternions[..., 3:]], axis=-1)
