"""What every command that reads a clip is told about it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

from tyro.conf import Positional

WHOLE = (0, -1)
"""Frames of a whole clip."""


def refuse_for_skill(command: Any, options: Iterable[str], skill: object) -> None:
    """Raise ValueError where options of a command were given that a skill's file says."""
    usual = {f.name: f.default for f in fields(command)}
    given = [f"--{name.replace('_', '-')}" for name in options if getattr(command, name) != usual[name]]
    if given:
        raise ValueError(f"{' and '.join(given)}: '{skill}' is a skill, whose file says it")


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

    frames: tuple[int, int] | None = None
    """First and last frame of the part to use, counted from 0; -1 is the clip's last. All when not given."""
    repair: str = ""
    """Repairs, joined by commas: spikes, toes, lowpass, ground; or all."""

    def reading(self) -> dict[str, Any]:
        """Arguments for `clips.read_part`."""
        return super().reading() | {"frames": self.frames or WHOLE, "repairs": self.repair}
