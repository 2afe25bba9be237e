"""The tables of docs/ball.md: which hand has the ball, inferred beside recorded, on a folder of recordings.

    python -m warpdribble.reports.ball FOLDER [docs/ball.md]

Clips with a recorded ball are parted by a rule, so that costs chosen on one half are judged on the other:
in the order of their paths, without copies, the first, third, ... are chosen on.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from pathlib import Path

import numpy as np

from ..clips.read import SUFFIXES, read_clip
from ..sims import Model
from ..sims.ball.ball import BOUNCED, Ball, flights_of, inferred_ball, recorded_ball
from ..sims.ball.contact_score import ContactScore, score_contacts
from ..sims.retarget.retarget import retargeted
from .markers import check_page, write_measured

SIDES = ("left", "right")
HALVES = ("chosen on", "judged on")
BASKETBALL, WITHOUT = "06_", ("06_01",)
"""CMU's subject that plays with a ball that was not recorded, and its trials in which it does not."""
GOOD = 0.9


@dataclass(frozen=True)
class Row:
    """One clip."""

    clip: str
    scores: tuple[ContactScore, ContactScore] | None
    """Of the left and the right hand; None where no ball was recorded."""
    ball: Ball | None
    """The inferred one."""
    half: int = 0
    """In HALVES."""
    dribbled: bool = False
    """The recorded ball goes over the ground from hand to hand."""

    @property
    def worst(self) -> float:
        """The least of its precisions and recalls."""
        return min(min(s.precision, s.recall) for s in self.scores) if self.scores else 1.0


def measure(model: Model, folder: Path, say: Callable[[str], None] = lambda line: None) -> list[Row]:
    """Every clip below a folder, in the order of their paths."""
    rows: list[Row] = []
    seen: set[bytes] = set()
    halved = 0
    for path in sorted(p for p in folder.rglob("*") if p.suffix.lower() in SUFFIXES):
        motion, _ = read_clip(path)
        copy = motion.places().tobytes()
        if copy in seen:
            continue
        seen.add(copy)
        result = retargeted(model, motion)
        ball = inferred_ball(model, result.reference, result.scale)
        true = recorded_ball(model, result, motion)
        scores, dribbled = None, False
        if true is not None:
            touch = ball.touch if ball is not None else np.zeros_like(true.touch)
            left, right = (score_contacts(touch[:, i], true.touch[:, i], model.timestep) for i in (0, 1))
            scores, halved = (left, right), halved + 1
            low = [true.path[f.release : f.catch, 2].min() for f in flights_of(true.touch)]
            dribbled = any(height < BOUNCED for height in low)
        rows.append(Row(path.relative_to(folder).as_posix(), scores, ball, (halved - 1) % 2, dribbled))
        say(f"{rows[-1].clip}: {'no ball' if ball is None else f'{len(ball.flights)} flights'}")
    return rows


def tables(rows: Sequence[Row]) -> str:
    """All tables as Markdown."""
    scored = [row for row in rows if row.scores]
    other = [row for row in rows if not row.scores]
    played = [row for row in other if Path(row.clip).stem.startswith(BASKETBALL)]
    played = [row for row in played if Path(row.clip).stem not in WITHOUT]
    return "\n".join(
        [*_halves(scored), "", *_misses(scored), "", *_without([r for r in other if r not in played])]
        + ["", *_played(played)]
    )


def _halves(rows: Sequence[Row]) -> list[str]:
    lines = ["### Which hand has the ball", ""]
    lines.append("| clips | hand | precision | recall | edges off by ms | edges missed | worst clip |")
    lines.append("|---|---|---:|---:|---:|---:|---|")
    for half, name in enumerate(HALVES):
        part = [row for row in rows if row.half == half]
        lines += _hands(part, name) + _hands([row for row in part if row.dribbled], f"{name}, dribbling")
    return lines


def _hands(rows: Sequence[Row], name: str) -> list[str]:
    """A line for each hand."""
    lines = []
    for hand, side in enumerate(SIDES):
        each = [row.scores[hand] for row in rows if row.scores]
        if not each:
            return []
        s = reduce(add, each)
        worst = min(zip(each, rows), key=lambda pair: min(pair[0].precision, pair[0].recall))
        off = 1000 * np.mean(np.abs(s.timing)) if s.timing else 0.0
        lines.append(
            f"| {len(rows)} {name} | {side} | {s.precision:.3f} | {s.recall:.3f} | {off:.0f} "
            f"| {s.missed} of {s.missed + len(s.timing)} "
            f"| {worst[1].clip} ({worst[0].precision:.2f}, {worst[0].recall:.2f}) |"
        )
    return lines


def _misses(rows: Sequence[Row]) -> list[str]:
    bad = sorted((row for row in rows if row.worst < GOOD), key=lambda row: row.worst)
    lines = [f"Clips with a precision or recall below {GOOD}: {len(bad)} of {len(rows)}.", ""]
    lines.append("| clip | half | left: precision | recall | right: precision | recall |")
    lines.append("|---|---|---:|---:|---:|---:|")
    for row in bad:
        values = [v for s in row.scores or () for v in (s.precision, s.recall)]
        cells = [f"{v:.2f}" if v >= GOOD else f"**{v:.2f}**" for v in values]
        lines.append(f"| {row.clip} | {HALVES[row.half]} | {' | '.join(cells)} |")
    return lines


def _without(rows: Sequence[Row]) -> list[str]:
    false = [row for row in rows if row.ball is not None]
    named = f": {', '.join(row.clip for row in false)}" if false else ""
    return ["### Clips without a ball", "", f"A ball in {len(false)} of {len(rows)} that have none{named}."]


def _played(rows: Sequence[Row]) -> list[str]:
    lines = ["### Basketball whose ball was not recorded", ""]
    lines.append(
        "| clip | pushes with the left | with the right | of them to the other hand | held by both, s |"
    )
    lines.append("|---|---:|---:|---:|---:|")
    for row in rows:
        if row.ball is None:
            lines.append(f"| {row.clip} | no ball found | | | |")
            continue
        pushes = [sum(f.hand == hand for f in row.ball.flights) for hand in (0, 1)]
        over = sum(f.hand != f.next_hand for f in row.ball.flights)
        both = 0.01 * int(row.ball.touch.all(axis=1).sum())
        lines.append(f"| {row.clip} | {pushes[0]} | {pushes[1]} | {over} | {both:.1f} |")
    return lines


def main(folder: Path, page: Path) -> None:
    check_page(page)
    rows = measure(Model.load("player"), folder, lambda line: print(line, flush=True))
    text = tables(rows)
    write_measured(page, text)
    print(text)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit("usage: python -m warpdribble.reports.ball FOLDER [docs/ball.md]")
    main(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "docs/ball.md"))
