"""The tables of docs/retargeting.md, measured on a folder of recordings.

    python -m warpdribble.reports.fit FOLDER [docs/retargeting.md]

reads every clip below FOLDER, puts it on the player and writes the tables between the file's markers.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..clips.read import SUFFIXES, read_clip
from ..sims import Model
from ..sims.retarget.accuracy import LIMBS, accuracy
from ..sims.retarget.retarget import retargeted
from .markers import check_page, write_measured

GOALS = {"mean": 4.0, "hands": 3.0, "slide": 5.0, "slide all": 5.0, "deep": 5.0}
"""[cm], [cm], [mm/s], [mm]."""
Row = dict[str, Any]
"""Numbers of one clip by name, and the clip's name."""


def measure(model: Model, folder: Path, say: Callable[[str], None] = lambda line: None) -> list[Row]:
    """Rows of numbers, one per clip."""
    rows: list[Row] = []
    for path in sorted(p for p in folder.rglob("*") if p.suffix.lower() in SUFFIXES):
        motion, _ = read_clip(path)
        result = retargeted(model, motion)
        copied = accuracy(model, retargeted(model, motion, ik=False))
        fit = accuracy(model, result)
        row: Row = {
            "clip": path.relative_to(folder).as_posix(),
            "scale": result.scale,
            "copied": 100 * copied.mean,
            "mean": 100 * fit.mean,
            "slide": 1000 * fit.sliding,
            "slide all": 1000 * fit.sliding_all,
            "slide99": 1000 * fit.sliding_worst,
            "deep": 1000 * max(fit.penetration, fit.body_penetration),
            "stands": 100 * fit.standing,
        }
        row |= {limb: 100 * fit.limbs[limb][0] for limb in LIMBS if limb in fit.limbs}
        rows.append(row)
        say(f"{row['clip']}: mean {row['mean']:.1f} cm, slide {row['slide']:.1f} mm/s")
    return rows


def tables(rows: list[Row]) -> str:
    """Both tables as Markdown."""
    limbs = [limb for limb in LIMBS if limb in rows[0]]
    lines = ["### Joints, feet and ground", "", f"{len(rows)} clips; misses of the goals in bold.", ""]
    lines.append("| goal | clips that miss it | worst |\n|---|---|---|")
    for key, what in (
        ("mean", "mean joint error under 4 cm"),
        ("hands", "hands under 3 cm"),
        ("slide", "standing feet slide under 5 mm/s"),
        ("slide all", "the same, mean of all touching points"),
        ("deep", "under the ground by less than 5 mm"),
    ):
        worst = max(rows, key=lambda row: row[key])
        late = sum(row[key] >= GOALS[key] for row in rows)
        lines.append(f"| {what} | {late} of {len(rows)} | {worst[key]:.1f} ({worst['clip']}) |")
    heads = ["clip", "scale", "copied only", "with IK", *limbs]
    heads += ["slide", "99 %", "slide, all points", "deepest", "stands"]
    lines += ["", f"| {' | '.join(heads)} |"]
    lines.append("|---|" + "---:|" * (len(limbs) + 8))
    for row in rows:
        cells = [row["clip"], f"{row['scale']:.3f}", f"{row['copied']:.1f}", _cell(row, "mean")]
        cells += [_cell(row, limb) for limb in limbs]
        cells += [_cell(row, "slide"), f"{row['slide99']:.0f}", _cell(row, "slide all")]
        cells += [_cell(row, "deep"), f"{row['stands']:.0f}"]
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["", "Errors in cm, slide in mm/s, deepest point under the ground in mm, stands in % of frames."]
    return "\n".join(lines)


def _cell(row: Row, key: str) -> str:
    text = f"{row[key]:.1f}"
    return f"**{text}**" if key in GOALS and row[key] >= GOALS[key] else text


def main(folder: Path, page: Path) -> None:
    check_page(page)
    rows = measure(Model.load("player"), folder, lambda line: print(line, flush=True))
    write_measured(page, tables(rows))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit("usage: python -m warpdribble.reports.fit FOLDER [docs/retargeting.md]")
    main(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "docs/retargeting.md"))
