"""Clips in, of any format we read; the suffix says which."""

from __future__ import annotations

from pathlib import Path

from .ballplay import read_ballplay
from .bvh import read_bvh
from .clip_error import ClipError
from .sims.motion import Motion

__all__ = ["SUFFIXES", "ClipError", "read_clip"]

SUFFIXES = (".bvh", ".pt")


def read_clip(path: str | Path, units=None, up=None) -> tuple[Motion, list[str]]:
    """Read a clip as a Motion in metres, Z up, and notes on what was detected or repaired."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".bvh":
        return read_bvh(path)
    if suffix == ".pt":
        return read_ballplay(path)
    raise ClipError(path, f"clips are {', '.join(SUFFIXES)}, not '{path.suffix or path.name}'")
