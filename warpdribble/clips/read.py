"""Clips in, of any format we read; the suffix says which."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..sims.recording.motion import Motion
from ..sims.recording.repair import REPAIRS, repair
from .amc import read_amc
from .ballplay import read_ballplay
from .bvh import read_bvh
from .errors import ClipError
from .rate import given_rate

__all__ = ["SUFFIXES", "ClipError", "read_clip", "read_part"]

SUFFIXES = (".bvh", ".amc", ".pt")
"""Of files that are clips."""


def read_clip(
    path: str | Path,
    units: str | float | None = None,
    up: str | None = None,
    asf: str | Path | None = None,
    rate: float | None = None,
    drop_positions: bool = False,
) -> tuple[Motion, list[str]]:
    """Read a clip as a Motion in metres, Z up, and notes on what was detected or repaired.

    units: "m", "cm", "mm", "inch", "foot", "cmu" or metres per unit; up: "x", "y" or "z"; None of either:
    told from the skeleton. asf: the skeleton of an .amc file, where it is not beside it. rate: [Hz], in place
    of the file's. drop_positions: of .bvh joints other than the root. Raises ClipError for a
    file that cannot be used, InputError for units, an axis or a rate that are none.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".bvh":
        return read_bvh(path, units, up, rate, drop_positions)
    if suffix == ".amc":
        return read_amc(path, units, up, asf, rate)
    if suffix == ".pt":
        if units not in (None, "m", 1, "1") or up not in (None, "z"):
            raise ClipError(path, "a BallPlay-M clip is in metres, Z up: say neither units nor up")
        motion, notes = read_ballplay(path)
        if rate is None:
            return motion, notes
        rate, said = given_rate(rate)
        return replace(motion, rate=rate), [*notes, said]
    if suffix == ".asf":
        raise ClipError(path, "is only a skeleton; give the .amc file beside it")
    raise ClipError(path, f"clips are {', '.join(SUFFIXES)}, not '{path.suffix or path.name}'")


def read_part(
    path: str | Path,
    frames: tuple[int, int] = (0, -1),
    repairs: str = "",
    units: str | float | None = None,
    up: str | None = None,
    asf: str | Path | None = None,
    rate: float | None = None,
    drop_positions: bool = False,
) -> tuple[Motion, list[str]]:
    """A part of a clip, repaired, and notes.

    frames: (first, last), both included; a last of -1 is the clip's. repairs: some of spikes, toes, lowpass,
    ground, joined by commas, or "all"; they are made on the whole clip. units to drop_positions: as in
    `read_clip`. Raises ClipError and ValueError.
    """
    motion, notes = read_clip(path, units, up, asf, rate, drop_positions)
    first, last = frames
    last = motion.frame_count - 1 if last == -1 else last
    if not 0 <= first < last < motion.frame_count:
        most = motion.frame_count - 1
        reason = f"frames {first} to {last} are no range in it: give two rising numbers from 0 to {most}"
        raise ClipError(path, reason if most else "it has one frame only", "frames")
    names = REPAIRS if repairs == "all" else [name.strip() for name in repairs.split(",") if name.strip()]
    motion, said = repair(motion, names)
    return motion.slice(first, last), notes + said
