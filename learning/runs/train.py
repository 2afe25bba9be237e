"""`train`: a stage learned in its folder, from where it was stopped to its end."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

from ...sims.files import sweep
from .files import held
from .folder import SECONDS, Run, StageFolder
from .log import Log, read_rows
from .stage import Learner, Report, Stage


@dataclass(frozen=True)
class Trained:
    """How it went."""

    iterations: int
    """in the checkpoint"""
    has_events: bool
    """TensorBoard's files are there too."""
    config: Any
    """parameters of the learner"""


def train(
    run: Run,
    stage: Stage,
    config: Any = None,
    *,
    iterations: int | None = None,
    device: str = "cpu",
    workers: int = 1,
    made: Callable[[Learner, Any], object] | None = None,
    progress: Callable[[Report], object] | None = None,
) -> Trained:
    """Learn a stage of a run to its end. config, iterations: as in `StageFolder.config`. made: called with
    the learner, where its checkpoint has it, and its parameters, before anything is learned; progress: with
    every iteration's report. The checkpoint, and the best result, are written by iterations and by time,
    and when it is interrupted. Raises InputError for a folder that another process holds."""
    folder = run.stage(stage)
    with held(run.folder):
        config = folder.config(config, iterations)
        context = run.context(stage, config, device, workers)
        sweep(run.folder)
        folder.make()
        learner = stage.make(context)
        seconds = folder.restore(learner)
        if made:
            made(learner, config)
        config = replace(config, iterations=max(config.iterations, learner.iteration))
        folder.begin(config, context.needs)
        return _train(folder, stage, learner, config, seconds, progress)


def _train(
    folder: StageFolder,
    stage: Stage,
    learner: Learner,
    config: Any,
    seconds: float,
    progress: Callable[[Report], object] | None,
) -> Trained:
    began = time.perf_counter() - seconds
    state, at, saved, when = learner.state, learner.iteration, learner.iteration, time.perf_counter()
    log: Log | None = None
    if learner.done and (rows := read_rows(folder.path)):
        log = folder.log(list(rows[0]), at)  # for TensorBoard, if its package came later
    try:
        while not learner.done:
            report = learner.iterate()
            state, at, seconds = learner.state, learner.iteration, time.perf_counter() - began
            names = [f.name for f in fields(report) if f.name != "fresh"]
            log = log or folder.log([*names, SECONDS], at - 1)
            log.add({name: getattr(report, name) for name in names} | {SECONDS: seconds})
            if report.fresh and (result := learner.result) is not None:
                folder.save_result(result, learner.iteration)
            late = time.perf_counter() - when >= stage.save_seconds
            if report.fresh or late or learner.done or learner.iteration - saved >= stage.save_iterations:
                folder.save(state, seconds)
                saved, when = at, time.perf_counter()
            if progress:
                progress(report)
    finally:
        if at > saved:  # interrupted: the last whole iteration
            folder.save(state, seconds)
            saved = at
        if log is not None:
            with contextlib.suppress(OSError):
                log.close()
    return Trained(saved, log is None or log.has_events, config)
