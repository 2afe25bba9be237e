"""`warpdribble learn`: a skill becomes a policy."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tyro.conf import Positional

from .console import bar, check_range, compiling, find_device, say, warmed


@dataclass
class Learn:
    """Learn a policy for a skill, on the CPU or a GPU. Stopped at any moment, the same command goes on."""

    skill: Positional[str]
    """Name of a skill (warpdribble skill list), or a skill's .toml file; a cyclic one."""
    out: Path
    """Folder of the run."""
    stage: Literal["locomotion"] = "locomotion"
    """locomotion: to stay up and follow the motion, without the ball."""
    seed: int = 0
    """Of everything random; the same seed gives the same policy."""
    iterations: int | None = None
    """How many in all; more than before extends a run. By default as many as usual."""
    data: Path | None = None
    """Folder of recordings; else $WARPDRIBBLE_DATA, else the folder that `warpdribble fetch` fills."""
    device: str = "cpu"
    """Where to simulate: cpu, cuda:0, ..."""

    def run(self) -> int:
        from ..learning.runs.folder import RunConfig, RunFolder
        from ..skills.graph import check_cyclic, skill_fields, skill_text
        from ..skills.skill import read_skill

        check_range("--seed", self.seed, 0, 2**32)
        if self.iterations is not None:
            check_range("--iterations", self.iterations, 1, 1e6)
        if self.data is not None and not self.data.is_dir():
            raise ValueError(f"--data {self.data}: no such folder")
        one = read_skill(self.skill)
        check_cyclic(one)
        find_device(self.device)
        config = RunConfig(skill=skill_fields(one), seed=self.seed, stage=self.stage)
        folder = RunFolder(self.out, config, self.iterations)
        say(f"skill     {one.name}: {one.description}")
        graph = folder.graph(skill_text(self.skill), lambda: self._graph(one))
        say(
            f"graph     {graph.count} fragments of {graph.period:g} s, "
            f"time stretched by {100.0 * (graph.stretch - 1.0):+.1f} %"
        )
        with compiling():
            samcon = folder.samcon(graph, self.device)
            warmed(samcon.task)
        if folder.saved:
            say(f"goes on   after {folder.saved} iterations")
        try:
            events = self._learn(folder, samcon)
        except KeyboardInterrupt:
            kept = f"saved in {self.out}, the same command goes on" if folder.saved else "nothing to save yet"
            print(f"warpdribble: stopped after {folder.saved} iterations; {kept}", file=sys.stderr)
            return 130
        self._summary(folder, events)
        return 0

    def _graph(self, one):
        from ..skills.graph import skill_graph

        graph, notes = skill_graph(one, self.data)
        for note in notes:
            say(f"          {note}")
        return graph

    def _learn(self, folder, samcon) -> bool:
        total, tried = samcon.config.iterations, math.nan
        with bar("learning", total) as progress:

            def show(report) -> None:
                nonlocal tried
                now = math.isfinite(report.survived)
                tried = report.survived if now else tried
                survived = f"{100.0 * tried:.0f} % survived, " if math.isfinite(tried) else ""
                progress(report.iteration, f": {survived}cost {report.cost:.2f}")
                if now and not sys.stderr.isatty():
                    line = f"iteration {report.iteration} of {total}: {survived}cost {report.cost:.2f}"
                    print(line, file=sys.stderr, flush=True)

            if samcon.iteration:
                progress(samcon.iteration)
            return folder.learn(samcon, show)

    def _summary(self, folder, events: bool) -> None:
        from ..learning.runs.folder import POLICY
        from ..learning.runs.log import read_rows

        if rows := read_rows(self.out):
            rate = sum(row["samples_per_second"] for row in rows) / len(rows)
            outside = sum(row["outside"] for row in rows) / len(rows)
            tried = [row["survived"] for row in rows if math.isfinite(row["survived"])]
            share = f"{100.0 * tried[-1]:.0f} % of the last trials survived" if tried else "not tried yet"
            say(f"learned   {folder.saved} iterations in {rows[-1]['seconds']:.0f} s, {share}")
            say(f"speed     {rate:.0f} samples/s, {100.0 * outside:.0f} % of the time outside the simulation")
        if not events:
            say("          no files for TensorBoard: pip install tensorboard, and the same again")
        if (self.out / POLICY).exists():
            say(f"next      warpdribble evaluate {self.out} --cycles 200 --trials 100")
            say(f"          warpdribble export {self.out} --seconds 20 --out take.usdc")
