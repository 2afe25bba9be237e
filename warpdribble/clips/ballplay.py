"""BallPlay-M clips in (`.pt`): a person and a recorded ball, read without PyTorch and without unpickling.

A file is an uncompressed zip archive with one float32 tensor (frames, 337): 60 Hz, metres, Z up, rest frame
X left, Y up, Z forward. Format, licence and citation: SkillMimic (Wang et al. 2024, arXiv:2408.15270).
"""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ..sims.recording.motion import Motion
from .errors import ClipError

RATE = 60.0
"""[Hz]"""
COLUMNS = 337
ROOT_TURN, TURNS, PLACES = slice(3, 6), slice(9, 165), slice(165, 324)
BALL, HELD = slice(324, 327), 336
LARGEST = 2**28
"""[bytes] of a clip (an hour), so that no archive can fill the memory."""
FAR = 1e3
"""[m] No joint and no ball is farther from the origin."""

Offset = tuple[float, float, float]
LEG = {"Hip": ("Pelvis", (0.1097, -0.0366, 0.0)), "Knee": ("Hip", (0.0, -0.4612, 0.0256))}
LEG |= {"Ankle": ("Knee", (0.0, -0.3644, -0.0256)), "Toe": ("Ankle", (0.0, -0.0986, 0.1566))}
TRUNK = {"Torso": ("Pelvis", (0.0, 0.0878, -0.0280)), "Spine": ("Torso", (0.0, 0.1061, 0.0))}
TRUNK |= {"Spine2": ("Spine", (0.0, 0.1061, 0.0)), "Chest": ("Spine2", (0.0, 0.1670, 0.0))}
TRUNK |= {"Neck": ("Chest", (0.0, 0.0842, 0.0146)), "Head": ("Neck", (0.0, 0.1097, 0.0))}
ARM = {"Thorax": ("Chest", (0.0183, -0.0295, 0.0366)), "Shoulder": ("Thorax", (0.1665, 0.0, 0.0))}
ARM |= {"Elbow": ("Shoulder", (0.2525, 0.0, 0.0)), "Wrist": ("Elbow", (0.2439, 0.0, 0.0))}
FINGERS = ("Index", "Middle", "Pinky", "Ring", "Thumb")

TO_MOTION = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rest frame X left, Y up, Z forward -> X forward, Y left, Z up."""


def _skeleton() -> dict[str, tuple[str | None, Offset | None]]:
    """name -> (parent, offset [m]) in body order; fingers have no published offset: None."""
    bones: dict[str, tuple[str | None, Offset | None]] = {"Pelvis": (None, (0.0, 0.0, 0.0))}

    def add(part: dict[str, tuple[str, Offset]], side: str, sign: float) -> None:
        for name, (parent, (x, y, z)) in part.items():
            parent = f"{side}_{parent}" if parent in part else parent
            bones[f"{side}_{name}"] = (parent, (sign * x, y, z))

    add(LEG, "L", 1.0)
    add(LEG, "R", -1.0)
    bones.update(TRUNK)
    for side, sign in (("L", 1.0), ("R", -1.0)):
        add(ARM, side, sign)
        for finger in FINGERS:
            for i in (1, 2, 3):
                before = f"{side}_Wrist" if i == 1 else f"{side}_{finger}{i - 1}"
                bones[f"{side}_{finger}{i}"] = (before, None)
    return bones


SKELETON = _skeleton()
NAMES = tuple(SKELETON)
PARENTS = np.array([-1 if p is None else NAMES.index(p) for p, _ in SKELETON.values()])


def read_ballplay(path: str | Path) -> tuple[Motion, list[str]]:
    """Read a BallPlay-M clip as a Motion with recorded positions, ball and hand contact, and notes.

    The root follows the recorded pelvis position. Raises ClipError when the file is missing, is no such
    archive, is cut short or damaged, or holds values that are no motion.
    """
    path = Path(path)
    rows = _tensor(path)
    frames = len(rows)
    places = rows[:, PLACES].reshape(frames, len(NAMES), 3)
    turns = np.concatenate([rows[:, ROOT_TURN], rows[:, TURNS]], axis=1).reshape(-1, 3)
    _check(path, places, turns, rows)

    turns = turns @ TO_MOTION.T
    rotations = Rotation.from_rotvec(turns).as_quat().reshape(frames, len(NAMES), 4)
    root = Rotation.from_quat(rotations[:, 0])
    # the root's turn ends in the file's world, which is Z up already
    root = Rotation.from_matrix(TO_MOTION.T) * root
    rotations[:, 0] = root.as_quat()
    motion = Motion(
        joint_names=NAMES,
        parents=PARENTS,
        offsets=_offsets(places, rotations),
        rotations=rotations,
        root_position=places[:, 0].copy(),
        rate=RATE,
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (len(NAMES), 1)),
        positions=places,
        ball=rows[:, BALL].copy(),
        ball_held=rows[:, HELD] > 0.5,
    )
    return motion, ["BallPlay-M: metres, Z up, 60 Hz, with recorded joint positions and ball"]


def _offsets(places: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Joint offsets (joints, 3) [m]: the published ones; fingers as they lie on average in their parent,
    with their recorded length."""
    offsets = np.zeros((len(NAMES), 3))
    frames: list[Rotation] = []
    for joint, (_, offset) in enumerate(SKELETON.values()):
        own, parent = Rotation.from_quat(rotations[:, joint]), PARENTS[joint]
        if parent >= 0:
            own = frames[parent] * own
        frames.append(own)
        if offset is not None:
            offsets[joint] = TO_MOTION @ offset
            continue
        apart = places[:, joint] - places[:, parent]
        mean = frames[parent].inv().apply(apart).mean(axis=0)
        length = np.linalg.norm(apart, axis=1).mean()
        offsets[joint] = mean * length / max(float(np.linalg.norm(mean)), 1e-9)
    return offsets


def _check(path: Path, places: np.ndarray, turns: np.ndarray, rows: np.ndarray) -> None:
    """Raise ClipError unless the numbers are those of this skeleton in motion."""
    if not np.isfinite(rows).all():
        raise ClipError(path, "the motion holds values that are not finite numbers")
    if np.abs(turns).max() > 100.0:
        raise ClipError(path, "the rotation columns hold values that are no angles")
    if max(np.abs(places).max(), np.abs(rows[:, BALL]).max()) > FAR:
        raise ClipError(path, f"the position columns hold values beyond {FAR:.0f} m")
    lengths = np.linalg.norm(places[:, 1:] - places[:, PARENTS[1:]], axis=2)
    for joint, (_, offset) in list(enumerate(SKELETON.values()))[1:]:
        seen = lengths[:, joint - 1]
        wanted = seen.mean() if offset is None else np.linalg.norm(offset)
        if np.abs(seen - wanted).max() > 0.005:
            raise ClipError(path, f"the position columns are not BallPlay-M's skeleton at {NAMES[joint]}")
    if not np.isin(rows[:, HELD], (0.0, 1.0)).all():
        raise ClipError(path, f"the contact flag (column {HELD}) is neither 0 nor 1")


def _tensor(path: Path) -> np.ndarray:
    """The archive's float32 tensor as float64 (frames, 337)."""
    if not path.exists():
        raise ClipError(path, "no such file")
    if path.is_dir():
        raise ClipError(path, "is a folder, not a BallPlay-M file")
    try:
        with zipfile.ZipFile(path) as archive:
            data = _entry(path, archive, "/data/0")
            kind = _entry(path, archive, "/data.pkl")
    except ClipError:
        raise
    except OSError as error:
        raise ClipError(path, error.strerror or "cannot be read") from None
    except (zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise ClipError(path, f"no sound PyTorch archive ({error})") from None
    except Exception as error:  # zipfile raises many kinds on bytes at random
        raise ClipError(path, f"no sound PyTorch archive ({type(error).__name__})") from None
    if b"FloatStorage" not in kind:
        raise ClipError(path, "the tensor is not float32")
    if not data or len(data) % (4 * COLUMNS):
        raise ClipError(path, f"the tensor is not (frames, {COLUMNS}) float32: {len(data)} bytes")
    return np.frombuffer(data, "<f4").reshape(-1, COLUMNS).astype(float)


def _entry(path: Path, archive: zipfile.ZipFile, end: str) -> bytes:
    """Bytes of the one entry whose name ends so; its checksum is compared."""
    entries = [e for e in archive.infolist() if e.filename.endswith(end)]
    if len(entries) != 1:
        raise ClipError(path, f"no BallPlay-M file: {len(entries)} entries end in {end[1:]}, not one")
    if entries[0].compress_type != zipfile.ZIP_STORED or entries[0].file_size > LARGEST:
        raise ClipError(path, f"the entry {entries[0].filename} is compressed or too large")
    return archive.read(entries[0])
