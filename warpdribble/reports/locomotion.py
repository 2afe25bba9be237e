"""The tables and the learning curves of docs/locomotion.md, measured on runs.

    python -m warpdribble.reports.locomotion FOLDER [docs/locomotion.md]

tries every run in FOLDER, writes the tables between the page's markers and the curves into pictures/ beside
it. Runs of one skill that differ in their seed share a row. Runs in folders of their own, FOLDER/NAME/RUN,
follow in tables of their own.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from ..learning.evaluate.landings import land
from ..learning.evaluate.pushes import DIRECTIONS, PLAYERS, push_table
from ..learning.evaluate.trials import Trials, run_trials
from ..learning.methods import STAGES
from ..learning.rollout import Controller
from ..learning.runs.folder import RUN, Run
from ..learning.runs.log import read_rows
from ..learning.tasks.disturbance import CALM, Disturbance
from ..learning.tasks.follow import OpenLoop
from .markers import check_page, write_measured

STAGE = "locomotion"
TRIALS, CYCLES, NOISE = 100, 200, 0.15
BUSY = Disturbance(arms=0.2, hands=18.0)
OPEN = ("open angle", "open ends", "open seconds")
LANDING = 240
"""Fragments of which the landings count."""
CURVES = "locomotion-curves.png"
MEASURED = "measured.json"
"""In a run's folder: what was measured once is not measured again."""
Measured = dict[str, Any]
"""One run in numbers, by name; and its skill's name and description."""


def measure(folder: Path) -> Measured:
    """One run in numbers."""
    run = Run.load(folder).learned(STAGES, STAGE)
    rows, kept = read_rows(folder / STAGE), folder / MEASURED
    if kept.exists() and json.loads(kept.read_text())["iterations"] == run.iteration:
        return dict(json.loads(kept.read_text()))
    task = run.task(TRIALS)
    blind = OpenLoop(task.actions)

    def tried(policy: Controller, cycles: float, disturbance: Disturbance = CALM) -> Trials:
        return run_trials(task, policy, run.starts, cycles, 1, NOISE, disturbance)

    learned = run.controller
    calm, busy, still = tried(learned, CYCLES), tried(learned, CYCLES, BUSY), tried(blind, 5)
    landings = land(run.task(1), learned, run.starts, LANDING)
    pushes = push_table(run.task(PLAYERS), learned, run.starts, seed=1)
    found = {
        "skill": run.skill["name"],
        "description": run.skill["description"],
        "seed": run.run.seed,
        "iterations": run.iteration,
        "fragments": run.graph.cycle,
        "seconds": rows[-1]["seconds"],
        "rate": np.mean([row["samples_per_second"] for row in rows]),
        "outside": 100 * np.mean([row["outside"] for row in rows]),
        "survived": int(calm.survived.sum()),
        "busy": int(busy.survived.sum()),
        "angle": math.degrees(calm.angle_error),
        "ends": 100 * calm.end_error,
        "drift": 100 * calm.drift,
        "turn": math.degrees(calm.turn),
        "pace": 100 * calm.pace,
        "astray": math.degrees(calm.astray),
        "landing": landings.peak,
        "open angle": math.degrees(still.angle_error),
        "open ends": 100 * still.end_error,
        "open seconds": 5 * run.graph.cycle * run.graph.period * still.lived.mean(),
        "open survived": int(still.survived.sum()),
        "pushes": pushes.largest().tolist(),
    }
    found = {key: float(v) if isinstance(v, np.floating) else v for key, v in found.items()}
    kept.write_text(json.dumps(found, indent=2))
    return found


def tables(runs: list[Measured]) -> str:
    """All tables as Markdown; nothing where there are no runs."""
    if not runs:
        return ""
    skills: dict[str, list[Measured]] = {run["skill"]: [] for run in runs}
    for run in runs:
        skills[run["skill"]].append(run)
    return "\n".join([*_survival(skills), "", *_tracking(skills), "", *_pushes(skills)])


def _survival(skills: dict[str, list[Measured]]) -> list[str]:
    lines = [
        f"**Survival**: of {TRIALS} trials of {CYCLES} cycles, each from a random recorded state with joint "
        f"speed noise of {NOISE} rad/s (root: m/s too), friction 0.8, root free; a seed each. Disturbed: "
        f"arm targets off by {BUSY.arms} rad, forces up to {BUSY.hands:g} N on each hand, all the time. "
        "Learning time, median of the seeds; share of it outside the simulation.",
        "",
        "| skill | cycle [s] | survived | disturbed | learned in [s] | samples/s | outside |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for name, runs in skills.items():
        cells = [
            f"{name}: {runs[0]['description']}",
            f"{0.05 * runs[0]['fragments']:.2f}",
            " ".join(str(run["survived"]) for run in runs),
            " ".join(str(run["busy"]) for run in runs),
            f"{np.median([run['seconds'] for run in runs]):.0f}",
            f"{np.median([run['rate'] for run in runs]) / 1000:.0f} k",
            f"{np.median([run['outside'] for run in runs]):.0f} %",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _tracking(skills: dict[str, list[Measured]]) -> list[str]:
    lines = [
        "**Tracking**, mean while standing, median of the seeds: angle per joint of legs and trunk; feet and "
        "head in the facing frame; the root's drift from the reference's way in a cycle, and the share of "
        "that way that it covers; how far 95 % of those that survive face away from the reference's heading "
        "at worst in all cycles; ground force on both feet, 99 % of the time below this many body weights. "
        "Beside it the open loop, the targets alone, and how long it stands of five cycles.",
        "",
        "| skill | joints [deg] | ends [cm] | drift [cm] | pace [%] | heading [deg] | force [BW] "
        "| open: joints | ends | stands [s] |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for name, runs in skills.items():
        keys = ("angle", "ends", "drift", "pace", "astray", "landing", *OPEN)
        cells = [_median([run[key] for run in runs]) for key in keys]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def _median(values: list[float]) -> str:
    """Of those that are known."""
    known = [v for v in values if math.isfinite(v)]
    return f"{np.median(known):.1f}" if known else "-"


def _pushes(skills: dict[str, list[Measured]]) -> list[str]:
    lines = [
        "**Pushes**: the largest force [N] on the torso for 0.2 s, by direction, that 95 % of 64 players "
        "survive at a random moment (as they do all smaller ones, in steps of 50 N); the least of the seeds.",
        "",
        f"| skill | {' | '.join(DIRECTIONS)} |",
        "|---|" + "---:|" * len(DIRECTIONS),
    ]
    for name, runs in skills.items():
        least = np.min([run["pushes"] for run in runs], axis=0)
        lines.append(f"| {name} | {' | '.join(f'{force:.0f}' for force in least)} |")
    return lines


def draw_curves(folders: list[Path], out: Path) -> None:
    """Share of trials under training disturbances that survive, over the time spent, a panel per skill."""
    from matplotlib.figure import Figure

    from ..takes.sheet import save

    skills: dict[str, list[Path]] = {}
    for folder in folders:
        skills.setdefault(Run.load(folder).info["skill"]["name"], []).append(folder)
    columns = min(3, len(skills))
    shape = (-(-len(skills) // columns), columns)
    figure = Figure(figsize=(3.4 * columns, 2.4 * shape[0]), dpi=110, layout="constrained")
    axes = figure.subplots(*shape, squeeze=False, sharey=True)
    for ax, (name, runs) in zip(axes.flat, skills.items()):
        for folder in runs:
            rows = [row for row in read_rows(folder / STAGE) if math.isfinite(row["survived"])]
            ax.plot([row["seconds"] for row in rows], [100 * row["survived"] for row in rows], ".-", lw=1)
        ax.set_title(name, fontsize=9)
        ax.set_ylim(0, 100)
        ax.grid(alpha=0.3)
    for ax in axes[-1]:
        ax.set_xlabel("seconds")
    for ax in axes[:, 0]:
        ax.set_ylabel("% survive")
    for ax in list(axes.flat)[len(skills) :]:
        ax.axis("off")
    save(figure, "Trials under training disturbances that survive, by seed", out)


def main(folder: Path, page: Path) -> None:
    check_page(page)
    parts = []
    below = sorted(path for path in folder.iterdir() if path.is_dir() and not (path / RUN).exists())
    for place in (folder, *below):
        folders = sorted(path.parent for path in place.glob(f"*/{RUN}"))
        runs = []
        for one in folders:
            runs.append(measure(one))
            print({key: value for key, value in runs[-1].items() if key != "description"}, flush=True)
        if place == folder:
            (page.parent / "pictures").mkdir(exist_ok=True)
            draw_curves(folders, page.parent / "pictures" / CURVES)
        elif runs:
            parts.append(f"### {place.name.replace('-', ' ').capitalize()}")
        parts.append(tables(runs))
    write_measured(page, "\n\n".join(part for part in parts if part))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit("usage: python -m warpdribble.reports.locomotion FOLDER [docs/locomotion.md]")
    main(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "docs/locomotion.md"))
