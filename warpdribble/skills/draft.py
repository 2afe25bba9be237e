"""A first version of a skill's file, from what its clip shows."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from ..clips.data import data_folder
from ..clips.read import read_clip
from ..sims import Model
from ..sims.ball.ball import inferred_ball, recorded_ball
from ..sims.files import whole as whole_file
from ..sims.retarget.cycles import find_cycles, pose_gap
from ..sims.retarget.mapping import find_mapping, read_mapping
from ..sims.retarget.retarget import retargeted
from .staged import closed, cycle_ball

GOOD = 0.06
"""[m] of pose gap up to which a cycle is proposed unasked."""


def draft(
    model: Model,
    clip: Path,
    frames: tuple[int, int] | None = None,
    name: str = "",
    mapping: str = "",
    whole: bool = False,
    **reading: Any,
) -> str:
    """The text of a skill's file. frames: None takes the best cycle of the clip, or all of it (always when
    `whole`); others are a cycle where their ends are alike. reading: how the clip is read, as
    `clips.read_clip` takes it. Raises ClipError and MappingError (ValueErrors)."""
    motion, _ = read_clip(clip, **reading)
    wanted = read_mapping(mapping) if mapping else find_mapping(motion)
    cyclic, others, searched = False, [], frames is None and not whole
    if frames is None:
        found = [c for c in find_cycles(motion, wanted) if c.pose_gap < GOOD] if searched else []
        frames = (found[0].first, found[0].last) if found else (0, motion.frame_count - 1)
        cyclic, others = bool(found), found[1:5]
    first, last = frames[0], motion.frame_count - 1 if frames[1] == -1 else frames[1]
    part = motion.slice(first, last)
    apart = np.nan if searched else pose_gap(part, wanted, 0, part.frame_count - 1)
    if not (searched or whole):
        cyclic = apart < GOOD
    result = retargeted(model, part, wanted)
    ball = recorded_ball(model, result, part)
    if ball is None and cyclic:
        ball = cycle_ball(model, closed(model, result.reference), result.scale)
    elif ball is None:
        ball = inferred_ball(model, result.reference, result.scale)
    elif not ball.touch.any():
        ball = None
    lines = [
        f'name = "{_quoted(name or clip.stem)}"',
        f'description = "{_quoted(f"first draft, {part.duration:.2f} s at {part.rate:.4g} Hz")}"',
        f'clip = "{_quoted(_relative(clip))}"',
        f"frames = [{first}, {last}]",
        f"cyclic = {'true' if cyclic else 'false'}",
        "mirror = false",
    ]
    if mapping:
        lines.append(f'mapping = "{_quoted(mapping)}"')
    lines += _as_read(reading)
    if searched and not cyclic:
        lines.append(f"# all of it, once: no part ends within {100 * GOOD:.0f} cm of how it begins")
    elif not searched:
        once = f"once; cyclic = true bends them to meet, as is done unasked below {100 * GOOD:.0f} cm"
        lines.append(f"# its ends are {100 * apart:.1f} cm apart: {'a cycle' if cyclic else once}")
    for c in others:
        lines.append(f"# also a cycle: frames = [{c.first}, {c.last}], ends {100 * c.pose_gap:.1f} cm apart")
    if ball is None:
        lines += ["", "# No ball shows in the hands' motion, or nobody touches the recorded one."]
    else:
        said = "recorded" if ball.recorded else "inferred from the hands' motion: check it"
        lines += ["", f"# Seconds from the first frame; {said}.", "[contact]"]
        step = model.timestep
        for hand, spans in ball.contact(step).items():
            lines.append(f"{hand} = [{', '.join(f'[{a:.2f}, {max(b, a + step):.2f}]' for a, b in spans)}]")
        lines.append(f"checkpoints = [{', '.join(f'{row * step:.2f}' for row in ball.checkpoints)}]")
        lines.append(f"heights = [{', '.join(f'{height:.3f}' for height in ball.heights)}]")
    return "\n".join(lines) + "\n"


def write_draft(path: Path, text: str) -> None:
    """Write a draft; the file appears whole or not at all. Raises OSError, ValueError for a wrong suffix."""
    if path.suffix.lower() != ".toml":
        raise ValueError(f"{path}: a skill is a .toml file")
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")


def _as_read(reading: dict[str, Any]) -> list[str]:
    """The keys of a skill that say how its clip is read, where that was said."""
    lines = [f'{key} = "{_quoted(str(reading[key]))}"' for key in ("units", "up") if reading.get(key)]
    if reading.get("asf"):
        lines.append(f'asf = "{_quoted(_relative(Path(reading["asf"])))}"')
    if reading.get("rate"):
        lines.append(f"rate = {float(reading['rate'])}")
    if reading.get("drop_positions"):
        lines.append("drop_positions = true")
    return lines


def _relative(clip: Path) -> str:
    folder = data_folder()
    if clip.resolve().is_relative_to(folder.resolve()):
        return clip.resolve().relative_to(folder.resolve()).as_posix()
    return Path(os.path.abspath(clip)).as_posix()


def _quoted(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
