"""What every command that reads a clip is told about it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from tyro.conf import Positional


@dataclass
class ClipFile:
    """A recorded clip and how to read it."""

    clip: Positional[Path]
    """Recorded clip: a .bvh, .amc (with its .asf) or BallPlay-M .pt file."""
    units: str | None = None
    """Length unit of the file: m, cm, mm, inch, foot, cmu or metres per unit. Told from the skeleton if not
    given."""
    up: Literal["x", "y", "z"] | None = None
    """Axis of the file that points up. Told from the skeleton if not given."""
    asf: Path | None = None
    """Skeleton of an .amc clip, where it is not beside it."""
    rate: float | None = None
    """Frames a second, where the file says none or a wrong one."""
    drop_positions: bool = False
    """Leave positions that a .bvh file has at joints other than the root, and take the bones as its offsets
    have them."""

    def reading(self) -> dict[str, Any]:
        """Arguments for `clips.read_clip`."""
        return {
            "path": self.clip,
            "units": self.units,
            "up": self.up,
            "asf": self.asf,
            "rate": self.rate,
            "drop_positions": self.drop_positions,
        }


@dataclass
class ClipInput(ClipFile):
    """A part of a recorded clip."""

    frames: tuple[int, int] = (0, -1)
    """First and last frame of the part to use, counted from 0; -1 is the clip's last."""
    repair: str = ""
    """Repairs, joined by commas: spikes, toes, lowpass, ground; or all."""

    def reading(self) -> dict[str, Any]:
        """Arguments for `clips.read_part`."""
        return super().reading() | {"frames": self.frames, "repairs": self.repair}
