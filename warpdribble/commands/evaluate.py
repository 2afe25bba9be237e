"""`warpdribble evaluate`: what a learned policy stands."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from tyro.conf import Positional

from .console import bar, check_range, compiling, find_device, say, warmed, without_nan

if TYPE_CHECKING:
    from ..learning.evaluate.pushes import PushTable


@dataclass
class Evaluate:
    """Try a learned policy: how many trials survive, how well it tracks, which pushes it stands."""

    folder: Positional[Path]
    """The run, a folder that warpdribble learn wrote; or what ships (warpdribble demo --list)."""
    cycles: float = 200.0
    """Length of a trial."""
    seconds: float | None = None
    """The same in seconds, instead of cycles."""
    trials: int = 100
    """How many, each from a random state."""
    stage: str = ""
    """Which of the run's stages; the last that was learned when empty."""
    push: float = 0.0
    """[N] Largest force of random pushes of 0.2 s on the torso, every 3 s or so."""
    arms: float = 0.0
    """[rad] Standard deviation of random offsets of the arms' targets, drawn every 0.05 s."""
    hands: float = 0.0
    """[N] Largest random force on each hand; dribbling takes about 18 N."""
    noise: float = 0.15
    """[rad/s, m/s] Standard deviation of what is added to all joint speeds at the start."""
    seed: int = 1
    """Of the starts and the disturbances."""
    open_loop: bool = False
    """Try the targets alone, without the policy, for comparison."""
    pushes: bool = False
    """Also a table: which share survives a single push, by force and direction."""
    format: Literal["text", "json"] = "text"
    """A text to read, or one JSON object."""
    device: str = "cpu"
    """Where to simulate: cpu, cuda:0, ..."""

    def run(self) -> int:
        import numpy as np

        from ..learning import Disturbance, Run, run_trials
        from ..learning.evaluate.pushes import FORCES, PLAYERS, push_table
        from ..learning.methods import STAGES
        from ..learning.tasks.follow import OpenLoop

        check_range("--cycles", self.cycles, 0.1, 1e5)
        if self.seconds is not None:
            check_range("--seconds", self.seconds, 0.05, 1e6)
        check_range("--trials", self.trials, 1, 2**16)
        check_range("--push", self.push, 0.0, 1e4)
        check_range("--arms", self.arms, 0.0, 10.0)
        check_range("--hands", self.hands, 0.0, 1e4)
        check_range("--noise", self.noise, 0.0, 100.0)
        check_range("--seed", self.seed, 0, 2**32)
        one = Run.load(self.folder).learned(STAGES, self.stage)
        find_device(self.device)
        with compiling():
            task = warmed(one.task(self.trials, self.device))
        graph = task.graph
        cycles = self.cycles
        if self.seconds is not None:
            cycles = max(1, round(self.seconds / graph.period)) / graph.cycle
        controller = OpenLoop(task.actions) if self.open_loop else one.controller
        with bar(f"{self.trials} trials", max(1, round(cycles * graph.cycle))) as progress:
            trials = run_trials(
                task,
                controller,
                one.starts,
                cycles,
                self.seed,
                self.noise,
                Disturbance(push=self.push, arms=self.arms, hands=self.hands),
                progress,
            )
        report = {
            "run": str(self.folder),
            "skill": one.skill["name"],
            "stage": one.stage.name,
            "iterations": one.iteration,
            "open_loop": self.open_loop,
            "trials": self.trials,
            "cycles": cycles,
            "seconds": cycles * graph.cycle * graph.period,
            "noise": self.noise,
            "push": self.push,
            "arms": self.arms,
            "hands": self.hands,
            "seed": self.seed,
            "survived": int(trials.survived.sum()),
            "fell": int(trials.fell.sum()),
            "lost": int(np.sum(~trials.survived & ~trials.fell)),
            "lived": float(trials.lived.mean()),
            "cycles_lasted_median": cycles * float(np.median(trials.lived)),
            "cycles_lasted_most": cycles * float(trials.lived.max()),
            "cost": trials.cost,
            "angle_error_deg": math.degrees(trials.angle_error),
            "end_error_cm": 100.0 * trials.end_error,
            "drift_cm_per_cycle": 100.0 * trials.drift,
            "turn_deg_per_cycle": math.degrees(trials.turn),
            "pace_percent": 100.0 * trials.pace,
            "astray_deg": math.degrees(trials.astray),
        }
        if self.pushes:
            with bar("pushes", len(FORCES)) as progress:
                table = push_table(
                    one.task(PLAYERS, self.device), controller, one.starts, self.seed, progress
                )
            report["pushes"] = _table(table)
        report = without_nan(report)
        if self.format == "json":
            say(json.dumps(report, indent=2, allow_nan=False))
        else:
            for line in _text(report):
                say(line)
        return 0


def _table(table: PushTable) -> dict[str, Any]:
    from ..learning.evaluate.pushes import DIRECTIONS, ENOUGH, PUSH_TIME

    largest = table.largest()
    return {
        "seconds": PUSH_TIME,
        "enough": ENOUGH,
        "forces": table.forces,
        "directions": list(DIRECTIONS),
        "survived": table.survived.tolist(),
        "largest": dict(zip(DIRECTIONS, largest.tolist())),
        "largest_in_every_direction": float(largest.min()),
    }


def _text(report: dict[str, Any]) -> list[str]:
    def shown(key: str, unit: str) -> str:
        return "-" if report[key] is None else f"{report[key]:.2f} {unit}"

    if report["stage"] == "ball" and report["noise"] > 0.0:
        say("          what was found is an open loop: --noise 0 plays it back from where it began")
    policy = "targets alone" if report["open_loop"] else f"best policy of {report['iterations']} iterations"
    lines = [
        f"run       {report['run']}: {report['skill']}, {policy}",
        f"trials    {report['trials']} of {report['cycles']:g} cycles ({report['seconds']:.0f} s), "
        f"speed noise {report['noise']:g}, pushes up to {report['push']:g} N, "
        f"arms {report['arms']:g} rad, hands {report['hands']:g} N, seed {report['seed']}",
        f"survived  {report['survived']} of {report['trials']}, {report['fell']} fell, "
        f"{report['lost']} lost the ball; "
        f"{100.0 * report['lived']:.1f} % of the time lived; the median lasted "
        f"{report['cycles_lasted_median']:.4g} cycles, the longest {report['cycles_lasted_most']:.4g}",
        f"tracking  joints {shown('angle_error_deg', 'degrees')}, "
        f"feet and head {shown('end_error_cm', 'cm')}, while standing",
        f"way       {shown('pace_percent', '%')} of the reference's pace, "
        f"{shown('drift_cm_per_cycle', 'cm')} off it in a cycle",
        f"heading   {shown('astray_deg', 'degrees')} off the reference's at worst (95 % of the trials), "
        f"{shown('turn_deg_per_cycle', 'degrees')} in a cycle",
    ]
    return lines + (_push_text(report["pushes"]) if "pushes" in report else [])


def _push_text(table: dict[str, Any]) -> list[str]:
    lines = [f"pushes    of {table['seconds']:g} s on the torso; % that stand 4 s later, by direction"]
    heads = ["".join(word[0] for word in name.split()) for name in table["directions"]]
    lines.append(f"{'N':>9} " + "".join(f"{head:>5}" for head in heads))
    for force, shares in zip(table["forces"], table["survived"]):
        cells = "".join(f"{'-' if share is None else round(100.0 * share):>5}" for share in shares)
        lines.append(f"{force:9} {cells}")
    lines.append(f"{'largest':>9} " + "".join(f"{table['largest'][d]:5.0f}" for d in table["directions"]))
    lines.append(
        f"          {100.0 * table['enough']:.0f} % survive {table['largest_in_every_direction']:g} N "
        "in every direction (f forward, b back, l left, r right)"
    )
    return lines
