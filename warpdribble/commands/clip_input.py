"""What every command that reads a clip is told about it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from tyro.conf import Positional


@dataclass
class ClipInput:
    """A recorded clip and how to read it."""

    clip: Positional[Path]
    """Recorded clip: a .bvh, .amc (with its .asf) or BallPlay-M .pt file."""
    frames: tuple[int, int] = (0, -1)
    """First and last frame of the part to use, counted from 0; -1 is the clip's last."""
    units: str | None = None
    """Length unit of the file: m, cm, mm, inch, foot, cmu or metres per unit. Told from the skeleton if not
    given."""
    up: Literal["x", "y", "z"] | None = None
    """Axis of the file that points up. Told from the skeleton if not given."""
    asf: Path | None = None
    """Skeleton of an .amc clip, where it is not beside it."""
    repair: str = ""
    """Repairs, joined by commas: spikes, toes, lowpass, ground; or all."""

    def reading(self) -> dict[str, Any]:
        """Arguments for `clips.read_part`."""
        return {
            "path": self.clip,
            "frames": self.frames,
            "repairs": self.repair,
            "units": self.units,
            "up": self.up,
            "asf": self.asf,
        }
