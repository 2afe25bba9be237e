"""The table of docs/dribbling.md on recovered balls: a recorded ball is hidden, and found again from the
motion of the hands by inference and simulation, the root held.

    python -m warpdribble.reports.recovered FOLDER [OUT.json] [SECONDS]

tries every BallPlay-M clip in FOLDER whose ball bounces between hands, each for at most so many seconds.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..clips.read import read_clip
from ..learning.ball.newton import NewtonConfig
from ..learning.ball.optimised import Optimised, Playback
from ..learning.ball.paper import PaperConfig
from ..learning.evaluate.attempts import tracked_graph
from ..learning.evaluate.record import record
from ..learning.graph import STEPS
from ..learning.methods import ball as stage
from ..learning.runs.stage import Context
from ..learning.tasks.fingers import with_ready_hands
from ..sims import Model
from ..sims.ball.ball import BOUNCED, Ball, flights_of, inferred_ball, recorded_ball
from ..sims.retarget.retarget import retargeted
from ..sims.signals import runs

NEAR = 0.25
"""[s] Bounces farther apart are not the same."""


@dataclass(frozen=True)
class Recovered:
    """One clip."""

    clip: str
    seconds: float
    """[s] that the search took"""
    covered: float
    """share of the clip, from the first hold on, through which the ball was kept"""
    recorded: int
    """bounces that were recorded while it was"""
    found: int
    """of those, in the simulation"""
    time: float
    """[ms] median difference of the bounces' times; NaN for none"""
    apex: float
    """[cm] mean difference of the ball's height where it is highest between two bounces"""
    path: float
    """[cm] mean distance over the ground"""


def bounces(height: np.ndarray, radius: float) -> np.ndarray:
    """Rows at which a ball (frames,) [m] is lowest on the ground."""
    low = [a + int(np.argmin(height[a : b + 1])) for a, b in runs(height < BOUNCED)]
    return np.array([row for row in low if 0 < row < len(height) - 1 and height[row] < radius + 0.05], int)


def compared(
    clip: str, seconds: float, covered: float, seen: np.ndarray, true: np.ndarray, model: Model
) -> Recovered:
    """Paths (frames, 3) [m] of the simulated and of the recorded ball."""
    radius, step = model.ball_radius, model.timestep
    own, other = bounces(seen[:, 2], radius), bounces(true[:, 2], radius)
    near = [own[np.argmin(np.abs(own - row))] if len(own) else -(10**6) for row in other]
    off = [abs(a - b) * step for a, b in zip(near, other) if abs(a - b) * step < NEAR]
    tops = [
        seen[a:b, 2].max() - true[a:b, 2].max() for a, b in pairwise(other) if true[a:b, 2].max() > BOUNCED
    ]
    ground = np.linalg.norm((seen - true)[:, :2], axis=1)
    return Recovered(
        clip,
        seconds,
        min(1.0, covered),
        len(other),
        len(off),
        1000.0 * float(np.median(off)) if off else np.nan,
        100.0 * float(np.mean(np.abs(tops))) if tops else np.nan,
        100.0 * float(ground.mean()) if len(ground) else np.nan,
    )


def recover(model: Model, path: Path, limit: float) -> Recovered | None:
    """A clip; None where no ball was recorded, or it does not bounce between hands."""
    motion, _ = read_clip(path)
    result = retargeted(model, motion)
    true = recorded_ball(model, result, motion)
    if true is None or not any(
        true.path[f.release : f.catch, 2].min() < BOUNCED for f in flights_of(true.touch)
    ):
        return None
    ball, began = inferred_ball(model, result.reference, result.scale), time.perf_counter()
    if ball is None or not ball.checkpoints:
        return compared(path.name, 0.0, 0.0, true.path[:0], true.path[:0], model)
    learner, found = searched(model, result.reference, ball, limit)
    seconds = time.perf_counter() - began
    first = int(found.k[0]) * STEPS if found is not None else 0
    rows = STEPS * (len(found) if found is not None else 0)
    covered = rows / max(1, len(true.path) - 1 - first)
    if found is None:
        return compared(path.name, seconds, 0.0, true.path[:0], true.path[:0], model)
    task = stage.task(learner, 1)
    seen = record(task, Playback(found), found.starts(1), len(found))[0]
    moved = seen.joint_q[:, model.q_slice(model.roles.one("ball_joint"))][:, :3]
    wanted = true.path[first : first + len(moved)]
    return compared(path.name, seconds, covered, moved[: len(wanted)], wanted, model)


def searched(model: Model, reference: Any, ball: Ball, limit: float) -> tuple[Context, Optimised | None]:
    """What the usual method finds for a reference whose root is held, in at most so many seconds."""
    plays = np.asarray(ball.touch.any(axis=0))
    joint_q = with_ready_hands(model, reference.joint_q, plays)
    joint_q[:, model.q_slice(model.roles.one("ball_joint"))][:, :3] = ball.path
    graph = tracked_graph(model, replace(reference, joint_q=joint_q), ball=ball)
    search = NewtonConfig(search=PaperConfig(generations=60))  # rather an end than a long search
    context = Context(graph, stage.BallConfig(newton=search))
    learner, began = stage.make(context), time.perf_counter()
    while not learner.done and time.perf_counter() - began < limit:
        learner.iterate()
    result = learner.result
    return context, None if result is None else Optimised.of(result)


def table(rows: list[Recovered]) -> str:
    """As Markdown, medians last."""
    lines = [
        "| clip | kept [%] | bounces found | time off [ms] | apex off [cm] | path off [cm] | search [s] |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]

    def cell(value: float, text: str) -> str:
        return text.format(value) if np.isfinite(value) else "-"

    for r in rows:
        cells = [
            r.clip,
            f"{100 * r.covered:.0f}",
            f"{r.found} of {r.recorded}",
            cell(r.time, "{:.0f}"),
            cell(r.apex, "{:.1f}"),
            cell(r.path, "{:.1f}"),
            f"{r.seconds:.0f}",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    known = {}
    for name in ("covered", "time", "apex", "path", "seconds"):
        values = [value for r in rows if np.isfinite(value := getattr(r, name))]
        known[name] = float(np.median(values)) if values else np.nan
    cells = [
        f"median of {len(rows)}",
        f"{100 * known['covered']:.0f}",
        f"{sum(r.found for r in rows)} of {sum(r.recorded for r in rows)}",
        cell(known["time"], "{:.0f}"),
        cell(known["apex"], "{:.1f}"),
        cell(known["path"], "{:.1f}"),
        f"{known['seconds']:.0f}",
    ]
    lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main(folder: Path, out: Path, limit: float) -> None:
    model, rows = Model.load("player"), []
    done = {row["clip"]: row for row in json.loads(out.read_text())} if out.exists() else {}
    for path in sorted(folder.rglob("*.pt")):
        if path.name in done:
            rows.append(Recovered(**done[path.name]))
            continue
        if (row := recover(model, path, limit)) is not None:
            rows.append(row)
            print(row, flush=True)
            out.write_text(json.dumps([vars(r) for r in rows]))
    print(table(rows))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit("usage: python -m warpdribble.reports.recovered FOLDER [OUT.json] [SECONDS]")
    where = Path(sys.argv[2] if len(sys.argv) > 2 else "recovered.json")
    main(Path(sys.argv[1]), where, float(sys.argv[3]) if len(sys.argv) > 3 else 120.0)
