"""The table of docs/dribbling.md on recovered balls: a recorded ball is hidden, and found again from the
motion of the hands by inference and simulation, the root held.

    python -m warpdribble.reports.recovered FOLDER [OUT.json] [SECONDS] [SHARE] [LOOSE]

tries every BallPlay-M clip in FOLDER whose ball bounces between hands, each for at most so many seconds of
one core. SHARE: of each contact that H has (P1 8), 1 where nothing is said. LOOSE: the cost at which a window
is done, where other than usual. What OUT.json has already is not measured again.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..clips.read import read_clip
from ..learning.ball.newton import NewtonConfig
from ..learning.ball.optimised import Optimised, Playback
from ..learning.ball.paper import PaperConfig
from ..learning.evaluate.attempts import tracked_graph
from ..learning.evaluate.record import record
from ..learning.graph import STEPS, ControlGraph
from ..learning.methods import ball as stage
from ..learning.runs.stage import Context
from ..learning.tasks.fingers import with_ready_hands
from ..sims import Model
from ..sims.ball.ball import BOUNCED, Ball, flights_of, inferred_ball, recorded_ball
from ..sims.ball.lead import led_once
from ..sims.retarget.retarget import retargeted
from ..sims.signals import runs
from .recorded import Physics, physics

NEAR = 0.25
"""[s] Bounces farther apart are not the same."""
WHOLE = "whole"
"""How a search ends: the clip is found;"""
LATE = "time"
"""its time is up;"""
LOST = "ball lost"
"""nothing that was tried keeps the ball."""


@dataclass(frozen=True)
class Recovered:
    """One clip."""

    clip: str
    ended: str
    """how, in a few words; WHOLE where it was found to its end"""
    seconds: float
    """[s] of a core that the search took"""
    covered: float = 0.0
    """share of the clip, from the first hold on, through which the ball was kept"""
    recorded: int = 0
    """bounces of the recorded ball, in all of the clip"""
    found: int = 0
    """of those, in the simulation"""
    time: float = np.nan
    """[ms] median difference of the bounces' times; NaN for none"""
    apex: float = np.nan
    """[cm] mean difference of the ball's greatest height in a contact after a bounce; NaN for none"""
    path: float = np.nan
    """[cm] mean distance over the ground"""
    fingers: float = np.nan
    """[cm] mean distance of the fingers from the ball in H"""
    e: float = np.nan
    """restitution of the recorded ball"""
    fall: float = np.nan
    """[m/s^2] its acceleration in flight, down"""

    @property
    def physical(self) -> bool:
        """Whether the recorded ball moves as a ball can."""
        return Physics(self.e, self.fall).possible


def bounces(height: np.ndarray, radius: float) -> np.ndarray:
    """Rows at which a ball (frames,) [m] is lowest on the ground."""
    low = [a + int(np.argmin(height[a : b + 1])) for a, b in runs(height < BOUNCED)]
    return np.array([row for row in low if 0 < row < len(height) - 1 and height[row] < radius + 0.05], int)


def apexes(height: np.ndarray, touch: np.ndarray, radius: float) -> list[tuple[int, int]]:
    """First and last rows of the contacts, touch (frames, 2), that a ball of height (frames,) [m] has come to
    from a bounce: there it is highest between two bounces, or after the last."""
    low = bounces(height, radius)
    held = runs(touch.any(axis=1))
    free = [0, *(b for _, b in held[:-1])]
    return [(a, b) for (a, b), since in zip(held, free) if np.any((low > since) & (low < a))]


def compared(seen: np.ndarray, true: Ball, first: int, model: Model) -> dict[str, Any]:
    """A simulated ball (rows, 3) [m], from row `first` of the recording on, beside the recorded one: the
    fields of `Recovered` that say so. An apex is compared once the recorded ball's is passed."""
    radius, step = model.ball_radius, model.timestep
    own = first + bounces(seen[:, 2], radius)
    other = bounces(true.path[:, 2], radius)
    last = first + len(seen)
    near = [own[np.argmin(np.abs(own - row))] if len(own) else -(10**6) for row in other]
    off = [abs(a - b) * step for a, b in zip(near, other) if abs(a - b) * step < NEAR]
    tops = []
    for a, b in apexes(true.path[:, 2], true.touch, radius):
        if first <= a and a + int(np.argmax(true.path[a : b + 1, 2])) < last:
            tops.append(seen[a - first : b + 1 - first, 2].max() - true.path[a : b + 1, 2].max())
    ground = np.linalg.norm((seen - true.path[first:last])[:, :2], axis=1)
    return {
        "recorded": len(other),
        "found": len(off),
        "time": 1000.0 * float(np.median(off)) if off else np.nan,
        "apex": 100.0 * float(np.mean(np.abs(tops))) if tops else np.nan,
        "path": 100.0 * float(ground.mean()) if len(ground) else np.nan,
    }


def fewer(graph: ControlGraph, share: float) -> ControlGraph:
    """A graph whose H has so much of each contact, round its middle, and the checkpoints (P1 8)."""
    assert graph.touch is not None and graph.checkpoints is not None
    touch = np.zeros_like(graph.touch)
    for hand in (0, 1):
        for a, b in runs(graph.touch[:, hand]):
            less = int((1.0 - share) * (b + 1 - a) / 2.0)
            touch[a + less : b + 1 - less, hand] = True
    touch[graph.checkpoints] = graph.touch[graph.checkpoints]
    return replace(graph, touch=touch)


def recover(model: Model, path: Path, limit: float, share: float, loose: float | None) -> Recovered | None:
    """A clip; None where no ball was recorded, or it does not bounce between hands."""
    motion, _ = read_clip(path)
    result = retargeted(model, motion)
    true = recorded_ball(model, result, motion)
    if true is None or not any(
        true.path[f.release : f.catch, 2].min() < BOUNCED for f in flights_of(true.touch)
    ):
        return None
    assert motion.ball is not None and motion.ball_held is not None
    own = vars(physics(motion.ball, motion.ball_held, motion.rate))
    own["recorded"] = len(bounces(true.path[:, 2], model.ball_radius))
    ball = inferred_ball(model, result.reference, result.scale)
    if ball is None or not ball.checkpoints:
        return Recovered(path.name, "no ball inferred", 0.0, **own)
    reference, ball, _ = led_once(model, result.reference, ball) or (result.reference, ball, "")
    context, began = _context(model, reference, ball, share, loose), time.process_time()
    try:
        learner: Any = stage.make(context)
    except ValueError as error:
        return Recovered(path.name, str(error), time.process_time() - began, **own)
    learner.until(lambda: time.process_time() - began > limit)
    while not learner.done:
        learner.iterate()
    seconds = time.process_time() - began
    ended = LATE if learner.late else LOST if learner.stuck else WHOLE
    if learner.result is None:
        return Recovered(path.name, ended, seconds, **own)
    found = Optimised.of(learner.result)
    seen = record(stage.task(context, 1), Playback(found), found.starts(1), len(found))[0]
    moved = seen.joint_q[:, model.q_slice(model.roles.one("ball_joint"))][:, :3]
    first = int(found.k[0]) * STEPS
    rows = len(true.path) - first
    own |= compared(moved[:rows], true, first, model)
    covered = min(1.0, STEPS * len(found) / max(1, rows - 1))
    fingers = 100.0 * float(np.nanmean(found.fingers))
    return Recovered(path.name, ended, seconds, covered, fingers=fingers, **own)


def _context(model: Model, reference: Any, ball: Ball, share: float, loose: float | None) -> Context:
    """What the usual method finds the ball of a reference from whose root is held."""
    plays = np.asarray(ball.touch.any(axis=0))
    joint_q = with_ready_hands(model, reference.joint_q, plays)
    joint_q[:, model.q_slice(model.roles.one("ball_joint"))][:, :3] = ball.path
    graph = fewer(tracked_graph(model, replace(reference, joint_q=joint_q), ball=ball), share)
    search = NewtonConfig(search=PaperConfig(generations=60))  # rather an end than a long search
    return Context(graph, stage.BallConfig(newton=search if loose is None else replace(search, loose=loose)))


NUMBERS = {
    "covered": "{:.0f}",
    "time": "{:.0f}",
    "apex": "{:.1f}",
    "path": "{:.1f}",
    "fingers": "{:.1f}",
    "seconds": "{:.0f}",
}
"""Columns that have a median, and how they are written."""


def _cells(values: dict[str, float]) -> dict[str, str]:
    shown = values | {"covered": 100.0 * values["covered"]}
    return {n: text.format(shown[n]) if np.isfinite(shown[n]) else "-" for n, text in NUMBERS.items()}


def table(rows: list[Recovered]) -> str:
    """As Markdown, (*) at clips whose recorded ball moves as no ball can; last medians of all, of those that
    were found to their ends, and of those without the mark."""
    lines = [
        "| clip | kept [%] | bounces found | time off [ms] | apex off [cm] | path off [cm] | fingers [cm] "
        "| search [s] | ended by | recorded e | fall [m/s²] |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---|---:|---:|",
    ]

    def line(name: str, found: str, of: dict[str, float], *rest: str) -> str:
        c = _cells(of)
        cells = [
            name,
            c["covered"],
            found,
            c["time"],
            c["apex"],
            c["path"],
            c["fingers"],
            c["seconds"],
            *rest,
        ]
        return f"| {' | '.join(cells)} |"

    for r in rows:
        recorded = [f"{value:.2f}" if np.isfinite(value) else "-" for value in (r.e, r.fall)]
        name = r.clip if r.physical else f"{r.clip} (*)"
        lines.append(line(name, f"{r.found} of {r.recorded}", vars(r), r.ended, *recorded))
    medians = {"all": rows, "found to the end": [r for r in rows if r.ended == WHOLE]}
    if not all(r.physical for r in rows):
        medians["as a ball can move"] = [r for r in rows if r.physical]
    for name, some in medians.items():
        middle = {}
        for number in NUMBERS:
            values = [value for r in some if np.isfinite(value := getattr(r, number))]
            middle[number] = float(np.median(values)) if values else np.nan
        found = f"{sum(r.found for r in some)} of {sum(r.recorded for r in some)}"
        lines.append(line(f"median of {len(some)}, {name}", found, middle, "", "", ""))
    return "\n".join(lines)


def main(folder: Path, out: Path, limit: float, share: float, loose: float | None) -> None:
    model, rows, seen = Model.load("player"), [], set()
    done = {row["clip"]: row for row in json.loads(out.read_text())} if out.exists() else {}
    for path in sorted(folder.rglob("*.pt")):
        copy = read_clip(path)[0].places().tobytes()
        if copy in seen:
            continue
        seen.add(copy)
        if path.name in done:
            rows.append(Recovered(**done[path.name]))
        elif (row := recover(model, path, limit, share, loose)) is not None:
            rows.append(row)
            print(row, flush=True)
            out.write_text(json.dumps([vars(r) for r in rows]))
    print(table(rows))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(
            "usage: python -m warpdribble.reports.recovered FOLDER [OUT.json] [SECONDS] [SHARE] [LOOSE]"
        )
    given = dict(enumerate(sys.argv))
    main(
        Path(given[1]),
        Path(given.get(2, "recovered.json")),
        float(given.get(3, 120.0)),
        float(given.get(4, 1.0)),
        float(given[5]) if 5 in given else None,
    )
