"""The tables and the curve of docs/dribbling.md, measured on runs: what trajectory optimisation finds, how
long that takes, and how long linear policies keep the ball.

    python -m warpdribble.reports.dribbling FOLDER [docs/dribbling.md]

looks at every run in FOLDER that has learned the stage `ball`. Runs of one skill and method that differ in
their seed share a row.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from ..learning.ball.optimised import Optimised, played
from ..learning.evaluate.trials import run_trials
from ..learning.methods import STAGES
from ..learning.runs.folder import RESULT, RUN, Run, read_result
from ..learning.runs.log import read_rows
from ..learning.tasks.arms import Arms
from .markers import check_page, write_measured

TRIALS = 100
CYCLES = 200
"""that a trial lasts at most"""
CURVE = "offsets.png"
MEASURED = "measured-ball.json"
PUBLISHED = {
    "carry": (1.1, 571),
    "dribble-right": (4.0, 99),
    "dribble-right-authored": (4.0, 99),
    "waist": (3.3, 4),
    "switch-hands": (8.7, 6),
    "run-dribble": (7.3, 6),
}
"""T_opt [h], N_linear of P1's table 1, for a skill of the same kind."""
Measured = dict[str, Any]


def measure(folder: Path) -> Measured:
    """One run in numbers."""
    run = Run.load(folder)
    kept = folder / MEASURED
    stages = [name for name in ("ball", "linear") if (folder / name / RESULT).exists()]
    stamp = {name: int(read_result(folder / name)["iteration"]) for name in stages}
    if kept.exists() and (found := json.loads(kept.read_text()))["stamp"] == stamp:
        return dict(found)
    ball = run.learned(STAGES, "ball")
    found = Optimised.of(read_result(folder / "ball"))
    task = ball.task(4)
    assert isinstance(task, Arms)
    count = task.graph.cycle
    rows, last = read_rows(folder / "ball"), found.last(100 * count)
    lived, _ = played(task, found)
    offsets, curve = last.offsets(task.active[last.k]), found.offsets(task.active[found.k])
    seen: Measured = {
        "stamp": stamp,
        "skill": ball.skill["name"],
        "description": ball.skill["description"],
        "seed": run.seed,
        "method": ball.context.config.method,
        "cycle": task.graph.period * count,
        "cycles": len(found) // count,
        "played": int(lived.min()) // count,
        "seconds": rows[-1]["seconds"],
        "rate": float(np.mean([row["samples_per_second"] for row in rows])),
        "fingers": 100.0 * float(last.distance(count).mean()),
        "worst": 100.0 * float(last.distance(count).max()),
        "offset": float(offsets.mean()),
        "largest": float(offsets.max()),
        "curve": curve[: len(curve) // count * count].reshape(-1, count).mean(axis=1).tolist(),
    }
    if "linear" in stages:
        linear = run.learned(STAGES, "linear")
        trials = run_trials(linear.task(TRIALS), linear.controller, linear.starts, CYCLES, 1)
        lasted = CYCLES * trials.lived
        noisy = run_trials(linear.task(TRIALS), linear.controller, linear.starts, 100, 1, 0.1)
        seen |= {
            "linear": float(lasted.max()),
            "median": float(np.median(lasted)),
            "stayed": int(trials.survived.sum()),
            "noisy": int(noisy.survived.sum()),
            "linear seconds": read_rows(folder / "linear")[-1]["seconds"],
        }
    kept.write_text(json.dumps(seen, indent=2))
    return seen


def tables(runs: list[Measured]) -> str:
    """Both tables as Markdown."""
    groups: dict[tuple[str, str], list[Measured]] = {}
    for run in runs:
        groups.setdefault((run["skill"], run["method"]), []).append(run)
    lines = [
        "**Trajectories**: consecutive cycles that were found, and that play back without a miss in fresh "
        "worlds; time until then (T_opt), beside that of P1's table 1 for a skill of the same kind; mean "
        "distance of the fingers from the ball in H over the last hundred cycles, and in the worst of them; "
        "length of the corrective offsets of an arm that acts, mean and largest. Medians of the seeds.",
        "",
        "| skill | method | seeds | cycle [s] | cycles | played back | T_opt [s] | P1 [h] | fingers [cm] "
        "| worst [cm] | offsets | largest |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for (skill, method), some in groups.items():
        middle = {k: float(np.median([run[k] for run in some])) for k in NUMBERS}
        hours = f"{PUBLISHED[skill][0]:.1f}" if skill in PUBLISHED else "-"
        cells = [
            f"{skill}: {some[0]['description']}",
            method,
            str(len(some)),
            f"{some[0]['cycle']:.2f}",
            " ".join(str(run["cycles"]) for run in some),
            " ".join(str(run["played"]) for run in some),
            f"{middle['seconds']:.0f}",
            hours,
            f"{middle['fingers']:.1f}",
            f"{middle['worst']:.1f}",
            f"{middle['offset']:.2f}",
            f"{middle['largest']:.2f}",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    lines += [
        "",
        f"**Linear policies**: of {TRIALS} trials, each from a random state on its way, the most "
        f"cycles that one lasted (N_linear of P1 7.1; {CYCLES} at most), the median, how many lasted all, "
        "and how many 100 cycles from a start with joint speed noise of 0.1 rad/s (root and ball: m/s).",
        "",
        "| skill | method | seed | N_linear | P1 | median | all | of 100, noisy | learned in [s] |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for run in runs:
        if "linear" in run:
            known = str(PUBLISHED[run["skill"]][1]) if run["skill"] in PUBLISHED else "-"
            lines.append(
                f"| {run['skill']} | {run['method']} | {run['seed']} | {run['linear']:.0f} | {known} "
                f"| {run['median']:.0f} | {run['stayed']} | {run['noisy']} | {run['linear seconds']:.0f} |"
            )
    return "\n".join(lines)


NUMBERS = ("seconds", "fingers", "worst", "offset", "largest")


def draw_curve(runs: list[Measured], out: Path) -> None:
    """Mean length of the offsets by cycle (Fig. 11), a line for each run."""
    from matplotlib.figure import Figure

    from ..takes.sheet import save

    figure = Figure(figsize=(7.0, 3.0), dpi=110, layout="constrained")
    ax = figure.subplots()
    for run in runs:
        cycles = np.arange(1, len(run["curve"]) + 1)
        ax.plot(cycles, run["curve"], lw=1, label=f"{run['skill']}, {run['method']}")
    ax.set_xlabel("cycle")
    ax.set_ylabel("mean length of offsets [rad]")
    ax.set_ylim(0.0)
    ax.grid(alpha=0.3)
    ax.legend(fontsize=7, ncols=2)
    save(figure, "Corrective offsets of the arms that act, by cycle", out)


def main(folder: Path, page: Path) -> None:
    check_page(page)
    runs = []
    for path in sorted(folder.glob(f"*/{RUN}")):
        if (path.parent / "ball" / RESULT).exists():
            runs.append(measure(path.parent))
            print({k: v for k, v in runs[-1].items() if k not in ("curve", "description")}, flush=True)
    (page.parent / "pictures").mkdir(exist_ok=True)
    draw_curve([run for run in runs if run["seed"] == 0], page.parent / "pictures" / CURVE)
    write_measured(page, tables(runs))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit("usage: python -m warpdribble.reports.dribbling FOLDER [docs/dribbling.md]")
    main(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "docs/dribbling.md"))
