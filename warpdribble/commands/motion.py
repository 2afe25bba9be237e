"""`warpdribble motion ...`: what a recorded clip holds."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import subcommand

from .clip_input import ClipInput
from .console import say, without_nan
from .retarget import Cycles, Retarget

if TYPE_CHECKING:
    from ..sims.recording.defects import Event
    from ..sims.recording.quality import Quality

MOST = 12
"""Events of a kind that a table lists; JSON has them all."""


@dataclass
class Info(ClipInput):
    """Quality report of a clip: speeds, strokes of the hands, stances, and what is broken, with frames."""

    format: Literal["table", "json"] = "table"
    """A table to read, or JSON with everything."""

    def run(self) -> int:
        from ..clips.read import read_part
        from ..sims.recording.quality import examine

        reading = self.reading()
        motion, notes = read_part(**reading)
        quality = examine(motion, reading["frames"][0])
        if self.format == "json":
            report = {"clip": str(self.clip), "notes": notes} | asdict(quality)
            say(json.dumps(without_nan(report), indent=2, allow_nan=False))
        else:
            for line in _table(self, notes, quality):
                say(line)
        return 0


@dataclass
class Joints(ClipInput):
    """The skeleton of a clip: joints, parents, bone lengths, and which part of a person each is taken for."""

    def run(self) -> int:
        import numpy as np

        from ..clips.read import read_part
        from ..sims.recording import anatomy

        motion, notes = read_part(**self.reading())
        parts = {j: part for part, j in anatomy.parts(motion.joint_names, motion.parents).items()}
        width = max(map(len, motion.joint_names))
        for note in notes:
            say(note)
        for joint, name in enumerate(motion.joint_names):
            parent = "-" if joint == 0 else motion.joint_names[motion.parents[joint]]
            length = 100.0 * float(np.linalg.norm(motion.offsets[joint])) if joint else 0.0
            part = parts.get(joint, "").replace("_", " ")
            say(f"{name:{width}}  {parent:{width}}  {length:5.1f} cm  {part}".rstrip())
        return 0


@dataclass
class MotionGroup:
    """Look at a recorded clip: motion info, joints, retarget, cycles CLIP."""

    do: (
        Annotated[Info, subcommand("info")]
        | Annotated[Joints, subcommand("joints")]
        | Annotated[Retarget, subcommand("retarget")]
        | Annotated[Cycles, subcommand("cycles")]
    )

    def run(self) -> int:
        return self.do.run()


def _table(command: Info, notes: list[str], quality: Quality) -> list[str]:
    first = command.reading()["frames"][0]
    part = f"frames {first} to {first + quality.frames - 1}"
    lines = [f"clip        {command.clip}, {part}, {quality.duration:.2f} s at {quality.rate:.4g} Hz"]
    lines += [f"            {note}" for note in notes]
    lines.append(f"root        {quality.root_speed_mean:.2f} m/s over the ground, at most "
                 f"{quality.root_speed_max:.2f}")  # fmt: skip
    stands = "no foot stands" if math.isnan(quality.ground) else f"feet stand at {quality.ground:.3f} m"
    lines.append(f"ground      {stands}")
    for side, hand in quality.hands.items():
        rate = f" at {hand.rate:.2f} Hz" if hand.rate else ""
        where = f": lowest at {_list(hand.strokes)}" if hand.strokes else ""
        lines.append(f"{side + ' hand':10}  {hand.low:.2f} to {hand.top:.2f} m, "
                     f"{len(hand.strokes)} strokes{rate}{where}")  # fmt: skip
    for side, foot in quality.feet.items():
        stances = _list(f"{a}-{b}" for a, b in foot.contacts)
        slide = f", slides {100.0 * foot.slide:.1f} cm/s: {stances}" if stances else ""
        lines.append(f"{side + ' foot':10}  {len(foot.contacts)} stances{slide}")
    if quality.ball_bounces is not None:
        line = f"ball        bounces at {_list(quality.ball_bounces) or 'no frame'}"
        if quality.ball_held is not None:
            line += f"; in hand {_list(f'{a}-{b}' for a, b in quality.ball_held) or 'never'}"
        lines.append(line)
    for what, events, scale, unit in (
        ("jumps", quality.jumps, 1000.0, "mm"),
        ("frozen", quality.frozen, 1.0, "s"),
        ("under", quality.under_ground, 100.0, "cm"),
    ):
        shown = [f"{_span(e):>11}  {e.what}, {scale * e.size:.3g} {unit}" for e in events[:MOST]]
        if len(events) > MOST:
            shown.append(f"and {len(events) - MOST} more: --format json")
        lines += [f"{what if i == 0 else '':10}  {line}" for i, line in enumerate(shown or ["none"])]
    return lines


def _list(items: Iterable[object]) -> str:
    words = [str(item) for item in items]
    more = f" and {len(words) - MOST} more" if len(words) > MOST else ""
    return ", ".join(words[:MOST]) + more


def _span(event: Event) -> str:
    return str(event.first) if event.first == event.last else f"{event.first}-{event.last}"
