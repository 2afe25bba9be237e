"""The table of docs/policies.md, measured on runs: how long it takes from a clip to a policy, and how long
that keeps the ball.

    python -m warpdribble.reports.policies FOLDER [docs/policies.md]

looks at every run in FOLDER that has learned the stage `policy`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from ..learning.choose import Ahead
from ..learning.evaluate.trials import Trials, run_trials
from ..learning.methods import STAGES, needed
from ..learning.policies.em import select
from ..learning.policies.noisy import Noisy
from ..learning.rollout import Rollout
from ..learning.runs.folder import RESULT, RUN, Learned, Run, read_result
from ..learning.runs.log import read_rows
from ..learning.starts import Starts, Streams
from ..learning.tasks.arms import Arms
from .markers import check_page, write_measured

TRIALS = 64
CYCLES, FEW = 1000, 100
"""that a trial lasts: from the policy's own way, and from there with noise"""
NOISE = 0.15
"""[rad/s, m/s]"""
PARTICLES, SEEDS, KEEP, SIGMA = 1024, 3, 0.5, 0.15
"""of the search that a start is beyond rescue for: worlds, how often it is tried, the share that has
children, exploration [rad]"""
MEASURED = "measured-policy.json"
PUBLISHED = {
    "carry": 1.1 + 0.8,
    "dribble-right": 4.0 + 19.9,
    "dribble-right-authored": 4.0 + 19.9,
    "waist": 3.3 + 2.1,
    "switch-hands": 8.7 + 19.4,
    "run-dribble": 7.3 + 6.3,
}
"""[h] of P1's table 1, for a skill of the same kind: trajectory optimisation and the policy"""
Measured = dict[str, Any]


def measure(folder: Path) -> Measured:
    """One run in numbers."""
    run = Run.load(folder)
    kept, stamp = folder / MEASURED, int(read_result(folder / "policy")["iteration"])
    if kept.exists() and (found := json.loads(kept.read_text()))["stamp"] == stamp:
        return dict(found)
    one = run.learned(STAGES, "policy")
    task = one.task(TRIALS)
    calm = run_trials(task, one.controller, one.starts, CYCLES, 1)
    noisy = run_trials(task, one.controller, one.starts, FEW, 2, NOISE)
    starts = one.starts.draw(Streams([np.random.default_rng(2)], TRIALS), NOISE)  # those of `noisy`
    lost = starts[~noisy.survived]
    rows = read_rows(folder / "policy")
    seen: Measured = {
        "stamp": stamp,
        "skill": one.skill["name"],
        "description": one.skill["description"],
        "seed": run.seed,
        "cycle": task.graph.period * task.graph.cycle,
        "seconds": {stage.name: _seconds(folder / stage.name) for stage in needed("policy")},
        "iterations": len(rows),
        "hardness": rows[-1]["hardness"],
        "calm": _counts(calm, CYCLES),
        "noisy": _counts(noisy, FEW),
        "beyond": sum(not rescued(one, lost[[i]]) for i in range(len(lost))),
    }
    kept.write_text(json.dumps(seen, indent=2))
    return seen


def rescued(one: Learned, start: Starts) -> bool:
    """Whether a search keeps the ball from a state for two cycles: particles that do what the policy does and
    something beside it, of which the better have children after every fragment."""
    task = one.task(PARTICLES)
    assert isinstance(task, Arms)
    each = start[np.zeros(PARTICLES, int)]
    for seed in range(SEEDS):
        who = Noisy(one.controller, SIGMA, task.active, np.random.default_rng(seed))
        rollout = Rollout(task, who, Ahead(), each)
        for fragment in rollout.fragments(2 * task.graph.cycle):
            parent, lost = select(fragment.cost[None], KEEP)
            if lost[0]:
                break
            rollout.become(parent[0])
        else:
            return True
    return False


def _seconds(folder: Path) -> float:
    rows = read_rows(folder)
    return float(rows[-1]["seconds"]) if rows else float("nan")


def _counts(trials: Trials, cycles: int) -> dict[str, float]:
    lasted = cycles * trials.lived
    lost = ~trials.survived & ~trials.fell
    return {
        "survived": int(trials.survived.sum()),
        "fell": int(trials.fell.sum()),
        "lost": int(lost.sum()),
        "early": int(np.sum(~trials.survived & (lasted < 1.0))),
    }


def _whole(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.0f}"


def table(runs: list[Measured]) -> str:
    """As Markdown."""
    lines = [
        f"Of {TRIALS} trials, each from a random state on the policy's way: how many last {CYCLES} cycles; "
        f"and from starts with noise of {NOISE:g} rad/s on all joint speeds (root and ball: m/s), how many "
        f"last {FEW} cycles, how many of the rest are lost within the first, and from how many of them "
        f"a search with {PARTICLES} particles keeps the ball for two cycles in none of {SEEDS} tries.",
        "",
        "| skill | seed | legs [s] | ball [s] | policy [s] | together [min] | P1 [h] "
        "| last 1000 cycles | noisy | lost at once | beyond rescue |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for run in runs:
        seconds, skill = run["seconds"], run["skill"]
        cells = [
            f"{skill}: {run['description']}",
            str(run["seed"]),
            *(_whole(seconds[name]) for name in ("locomotion", "ball", "policy")),
            _whole(sum(seconds.values()) / 60.0),
            f"{PUBLISHED[skill]:.1f}" if skill in PUBLISHED else "-",
            str(run["calm"]["survived"]),
            str(run["noisy"]["survived"]),
            str(run["noisy"]["early"]),
            str(run["beyond"]),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main(folder: Path, page: Path) -> None:
    check_page(page)
    runs = []
    for path in sorted(folder.glob(f"*/{RUN}")):
        if (path.parent / "policy" / RESULT).exists():
            runs.append(measure(path.parent))
            print({k: v for k, v in runs[-1].items() if k != "description"}, flush=True)
    write_measured(page, table(runs))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit("usage: python -m warpdribble.reports.policies FOLDER [docs/policies.md]")
    main(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "docs/policies.md"))
