"""A controller at work, recorded at every time step beside its reference."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from ...sims.model import Model
from ...sims.planar import composed, over_ground, planar, relative
from ...sims.trajectory import Trajectory
from ...sims.worlds import NONFINITE
from ..choose import Ahead, Chooser
from ..graph import STEPS, ControlGraph
from ..rollout import Controller, Disturbs, Rollout
from ..starts import Starts
from ..tasks.follow import Follow


def record(
    task: Follow,
    controller: Controller,
    starts: Starts,
    fragments: int,
    *,
    worlds: Sequence[int] = (0,),
    chooser: Chooser | None = None,
    disturber: Disturbs | None = None,
    progress: Callable[[int], object] | None = None,
) -> list[Trajectory]:
    """Let all worlds of a task go through so many fragments, each from its state of `starts`; what some of
    them did, with their references, which walk on from the place where they began. progress: called with the
    fragments done. A world whose state has become non-finite is left out."""
    sim, graph, model, chosen = task.sim, task.graph, task.model, list(worlds)
    rollout = Rollout(task, controller, chooser or Ahead(), starts, disturber)
    joint_q, body_q = [sim.joint_q[chosen]], [sim.body_q[chosen]]
    wanted: list[np.ndarray] = []
    begins = graph.start_q[starts.k[chosen]]
    at = np.concatenate([starts.joint_q[chosen, :2], planar(begins)[:, 2:]], axis=1)
    spent, began, lost = 0.0, time.perf_counter(), np.full(len(chosen), np.nan)
    for step in rollout.steps(fragments):
        spent += time.perf_counter() - began
        joint_q.append(sim.joint_q[chosen])
        body_q.append(sim.body_q[chosen])
        if step == 0 and len(wanted):
            lost[rollout.failed[chosen] & np.isnan(lost)] = len(wanted) * graph.period
        if step == STEPS - 1:
            rows, at = _reference(model, graph, rollout.k[chosen], at)
            wanted.append(rows if len(wanted) == fragments - 1 else rows[:-1])
            if progress:
                progress(len(wanted))
        began = time.perf_counter()
    lost[rollout.failed[chosen] & np.isnan(lost)] = fragments * graph.period
    sound = sim.status[chosen] & NONFINITE == 0
    moved, seen, reference = np.array(joint_q), np.array(body_q), np.concatenate(wanted)
    return [
        Trajectory(moved[:, w], seen[:, w], graph.timestep, reference[:, w], spent, float(lost[w]))
        for w in np.flatnonzero(sound)
    ]


def _reference(
    model: Model, graph: ControlGraph, k: np.ndarray, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (STEPS + 1, worlds, nq) of fragments k (worlds,) begun from the planar poses `at` (worlds, 3), and
    where they lead."""
    out = []
    start, goal = planar(graph.start_q[k]), planar(graph.goal_q[k])
    for w, fragment in enumerate(k):
        rows = graph.rows(model, fragment)
        rows[:, :7] = over_ground(rows[:, :7], start[w, :2], at[w, :2], at[w, 2] - start[w, 2])
        out.append(rows)
    return np.stack(out, axis=1), composed(at, relative(start, goal))
