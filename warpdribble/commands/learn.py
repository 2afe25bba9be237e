"""`warpdribble learn`: a skill becomes a policy."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import Positional

from .clip_input import WHOLE, refuse_for_skill
from .console import bar, check_range, compiling, find_device, say, warmed

if TYPE_CHECKING:
    from ..learning import Run
    from ..learning.runs.stage import Learner, Report, Stage
    from ..learning.runs.train import Trained
    from ..skills import Skill


@dataclass
class Learn:
    """Learn a policy for a skill, on the CPU or a GPU. Stopped at any moment, the same command goes on."""

    skill: Positional[str]
    """Name of a skill (warpdribble skill list), its .toml file (warpdribble skill draft makes one), or a
    recorded clip, with --frames. What is not cyclic happens once, its root held by virtual forces; only the
    stage ball is for that."""
    out: Path
    """Folder of the run."""
    frames: tuple[int, int] | None = None
    """Of a clip: first and last frame of the part to use, counted from 0; -1 is the clip's last."""
    cyclic: bool = False
    """Of a clip: its ends are made to meet."""
    stage: str = ""
    """What to learn: locomotion, to stay up and follow the motion without the ball; ball, cycle after cycle
    of arms and fingers that keep it; policy, a network that keeps it for good, or one of the paper's, linear
    and ddpg. When empty, all that the skill needs: locomotion, and where there is a ball, ball and policy."""
    method: str = ""
    """How the stage ball finds its cycles: usual, newton, smc or paper (docs/dribbling.md)."""
    set: tuple[str, ...] = ()
    """Parameters of the stage that is named, other than the usual: NAME=VALUE as in its config.json, with
    dots for what lies deeper, as in cost.change=0.4."""
    seed: int = 0
    """Of everything random; the same seed gives the same policy."""
    iterations: int | None = None
    """How many in all, of the stage that is named; more than before extends it. By default as many as
    usual."""
    workers: int | None = None
    """How many simulate at once; one for each processor core by default. It changes nothing that is
    learned."""
    data: Path | None = None
    """Folder of recordings; else $WARPDRIBBLE_DATA, else the folder that `warpdribble fetch` fills."""
    device: str = "cpu"
    """Where to simulate: cpu, cuda:0, ..."""

    def run(self) -> int:
        from ..learning import Run
        from ..learning.methods import STAGES, needed
        from ..sims.errors import InputError
        from ..skills.graph import skill_fields, skill_text

        check_range("--seed", self.seed, 0, 2**32)
        if self.iterations is not None:
            check_range("--iterations", self.iterations, 1, 1e6)
        if self.workers is not None:
            check_range("--workers", self.workers, 1, 1024)
        if self.data is not None and not self.data.is_dir():
            raise ValueError(f"--data {self.data}: no such folder")
        if self.stage and self.stage not in STAGES:
            raise ValueError(f"--stage {self.stage}: give one of {', '.join(STAGES)}")
        if self.iterations is not None and not self.stage:
            raise ValueError(f"--iterations {self.iterations}: of which stage? name it with --stage")
        if self.method and self.stage not in ("", "ball"):
            raise ValueError(f"--method {self.method}: it is for the stage ball")
        if self.set and not self.stage:
            raise ValueError(f"--set {self.set[0]}: of which stage? name it with --stage")
        if self.stage:
            self._config(STAGES[self.stage])  # said before there is a folder
        one = self._skill()
        find_device(self.device)
        run = Run.begin(self.out, skill_fields(one), self.seed)
        say(f"skill     {one.name}: {one.description}")
        run.keep(skill_text(one), lambda: self._graph(one))
        graph = self._fits(run.graph, one)
        say(
            f"graph     {graph.count} fragments of {graph.period:g} s, "
            f"time stretched by {100.0 * (graph.stretch - 1.0):+.1f} %"
        )
        plays = graph.touch is not None and bool(graph.touch.any())
        stages = needed("policy" if plays else "locomotion")
        if graph.tracked:
            stages = [STAGES["ball"]]
        if self.stage:
            stages = [STAGES[self.stage]]
        elif not plays and one.ball:
            say("          nobody plays with a ball: locomotion only")
        for stage in stages:
            if stage.missing:
                lacks = f"the stage {stage.name} needs the package '{stage.missing[0]}'"
                raise InputError(f"{lacks}: pip install 'warpdribble[learn]'")
        for number, stage in enumerate(stages):
            if code := self._learn(run, stage):
                return code
            if number + 1 < len(stages) and not run.stage(stage).learned:
                raise InputError(
                    f"{stage.name} has found nothing that {stages[number + 1].name} could start from",
                    run.folder,
                    "seed",
                )
        self._next(run)
        return 0

    def _skill(self) -> Skill:
        """The skill, or the clip as one that has no file yet."""
        from ..skills import clip_skill, is_skill, read_skill

        if is_skill(self.skill):
            refuse_for_skill(self, ("frames", "cyclic"), self.skill)
            return read_skill(self.skill)
        if not (self.frames or self.cyclic) and Path(self.skill).is_file():
            raise ValueError(
                f"{self.skill}: is a recording; a skill says which part of it is learned: warpdribble skill "
                "draft CLIP --out SKILL.toml makes one; or give --frames, and --cyclic where they repeat"
            )
        return clip_skill(self.skill, self.frames or WHOLE, cyclic=self.cyclic)

    def _graph(self, one: Skill) -> Any:
        from ..skills import skill_graph

        graph, notes = skill_graph(one, self.data)
        for note in notes:
            say(f"          {note}")
        return self._fits(graph, one)

    def _fits(self, graph: Any, one: Skill) -> Any:
        """The graph. Raises InputError where the stage that is named needs cycles and it has none."""
        from ..sims.errors import InputError

        if graph.tracked and self.stage not in ("", "ball"):
            reason = f"'{one.name}' is not cyclic: only the stage ball is for what happens once"
            raise InputError(reason, hint="stage")
        return graph

    def _learn(self, run: Run, stage: Stage) -> int:
        from ..learning.runs.train import train
        from ..learning.workers import usual_workers

        at, shown = 0, Shown()
        say(f"stage     {stage.name}: {stage.about}")
        workers = self.workers or usual_workers(self.device)
        with compiling():
            warmed(stage.task(run.context(stage, stage.config(), self.device), 1))

        def made(learner: Learner, config: Any) -> None:
            nonlocal at
            at, shown.total = learner.iteration, config.iterations
            if at:
                say(f"goes on   after {at} iterations")

        def progress(report: Report) -> None:
            nonlocal at
            at = report.iteration
            shown.say(report)

        try:
            with bar("learning", 1) as shown.progress:
                trained = train(
                    run,
                    stage,
                    self._config(stage),
                    iterations=self.iterations,
                    device=self.device,
                    workers=workers,
                    made=made,
                    progress=progress,
                )
        except KeyboardInterrupt:
            kept = f"saved in {self.out}, the same command goes on" if at else "nothing to save yet"
            print(f"warpdribble: stopped after {at} iterations; {kept}", file=sys.stderr)
            return 130
        self._summary(run, stage, trained)
        return 0

    def _config(self, stage: Stage) -> Any:
        """The parameters that were asked for; None for the usual ones, or those that the stage was begun
        with."""
        from ..learning.runs.folder import changed

        asked = list(self.set)
        if self.method and stage.name == "ball":
            asked.append(f"method={self.method}")
        return changed(stage.config(), asked) if asked else None

    def _next(self, run: Run) -> None:
        """What may be done with it."""
        say(f"next      warpdribble evaluate {self.out} --cycles 200 --trials 100")
        say(f"          warpdribble export {self.out} --seconds 20 --out take.usdc")

    def _summary(self, run: Run, stage: Stage, trained: Trained) -> None:
        from ..learning.runs.log import read_rows

        folder = run.stage(stage).path
        if rows := read_rows(folder):
            found = ""
            if "cycles" in rows[-1]:
                known = [row["fingers"] for row in rows if math.isfinite(row["fingers"])]
                found = ": " + ", ".join(found_cycles(rows[-1]["cycles"], known[-1] if known else math.nan))
                if not math.isfinite(rows[-1]["fingers"]):
                    found += "; then no way on was found"
            say(f"learned   {trained.iterations} iterations in {rows[-1]['seconds']:.0f} s{found}")
            tried = [row for row in rows if math.isfinite(row.get("survived", math.nan))]
            if tried:
                how = f", in {stage.check(trained.config)}" if stage.check else ""
                say(f"tried     the last policy{how}: {100.0 * tried[-1]['survived']:.0f} % survived")
                score = f", score {tried[-1]['score']:.2f}{BEST}" if stage.check else ""
                say(f"kept      the best policy of all tries{score}")
            if "samples_per_second" in rows[-1]:
                rate = sum(row["samples_per_second"] for row in rows) / len(rows)
                mean = {key: sum(row[key] for row in rows) / len(rows) for key in BESIDE if key in rows[0]}
                said = [f"{100.0 * share:.0f} % of the time {BESIDE[key]}" for key, share in mean.items()]
                say(", ".join([f"speed     {rate:.0f} samples/s", *said]))
        if not trained.has_events:
            say("          no files for TensorBoard: pip install tensorboard, and the same again")


BEST = " (1: all of the time survived, at no cost)"
"""What a score, as `Samcon.check` gives it, means to a person."""
BESIDE = {"outside": "outside the simulation", "learning": "learning beside the simulation"}


def found_cycles(cycles: float, fingers: float) -> list[str]:
    """How far a trajectory goes, and how well the fingers [cm] hold the ball, where that is known."""
    near = [f"fingers {fingers:.1f} cm from the ball"] if math.isfinite(fingers) else []
    return [f"{cycles:.0f} cycles", *near]


class Shown:
    """Progress of learning, as a bar, and as a line where there is no terminal."""

    def __init__(self) -> None:
        self.total, self.tried = 0, math.nan
        self.progress: Any = None

    def say(self, report: Report) -> None:
        """Show an iteration."""
        survived, cost = getattr(report, "survived", math.nan), getattr(report, "cost", math.nan)
        self.tried = survived if math.isfinite(survived) else self.tried
        parts = [f"{100.0 * self.tried:.0f} % of the trials survived"] if math.isfinite(self.tried) else []
        if (cycles := getattr(report, "cycles", None)) is not None:
            parts = found_cycles(cycles, getattr(report, "fingers", math.nan))
        if math.isfinite(lost := getattr(report, "lost", math.nan)) and hasattr(report, "reward"):
            parts += [f"{lost:.1f} of 1000 fragments lost the ball"]
        text = ", ".join([*parts, f"cost {cost:.2f}"] if math.isfinite(cost) or not parts else parts)
        self.progress(report.iteration, f": {text}", self.total)
        if report.fresh and not sys.stderr.isatty():
            print(f"iteration {report.iteration} of {self.total}: {text}", file=sys.stderr, flush=True)
