"""`warpdribble evaluate`: what a learned policy stands."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tyro.conf import Positional

from .console import bar, check_range, compiling, find_device, say, warmed

DIRECTIONS = (
    "forward",
    "forward left",
    "left",
    "back left",
    "back",
    "back right",
    "right",
    "forward right",
)
"""Of pushes, from the way the player faces; as `push_survival` has them."""
PUSHED = 64
"""Players pushed in each direction."""
FORCES = tuple(range(50, 1001, 50))
"""[N] tried in turn, until all directions are lost."""
ENOUGH = 0.95
"""Share that has to survive a push that counts as survived."""


@dataclass
class Evaluate:
    """Try a learned policy: how many trials survive, how well it tracks, which pushes it stands."""

    folder: Positional[Path]
    """The run, a folder that warpdribble learn wrote."""
    cycles: float = 200.0
    """Length of a trial."""
    trials: int = 100
    """How many, each from a random state."""
    push: float = 0.0
    """[N] Largest force of random pushes of 0.2 s on the torso, every 3 s or so."""
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
        from ..learning.disturbance import Disturbance
        from ..learning.policy import LinearPolicy
        from ..learning.run import Run
        from ..learning.trials import run_trials

        check_range("--cycles", self.cycles, 0.1, 1e5)
        check_range("--trials", self.trials, 1, 2**16)
        check_range("--push", self.push, 0.0, 1e4)
        check_range("--noise", self.noise, 0.0, 100.0)
        check_range("--seed", self.seed, 0, 2**32)
        run = Run.load(self.folder)
        find_device(self.device)
        with compiling():
            task = warmed(run.task(self.trials, self.device))
        policy = run.policy
        if self.open_loop:
            policy = LinearPolicy.zero(task.graph.count, task.actions, task.states)
        with bar(f"{self.trials} trials", max(1, round(self.cycles * task.graph.count))) as progress:
            trials = run_trials(
                task,
                policy,
                run.states,
                self.cycles,
                self.seed,
                self.noise,
                Disturbance(push=self.push),
                progress,
            )
        report = {
            "run": str(self.folder),
            "skill": run.config["skill"]["name"],
            "iterations": run.iteration,
            "open_loop": self.open_loop,
            "trials": self.trials,
            "cycles": self.cycles,
            "seconds": self.cycles * task.graph.count * task.graph.period,
            "noise": self.noise,
            "push": self.push,
            "seed": self.seed,
            "survived": int(trials.survived.sum()),
            "lived": float(trials.lived.mean()),
            "cost": _number(trials.cost),
            "angle_error_deg": _number(math.degrees(trials.angle_error)),
            "end_error_cm": _number(100.0 * trials.end_error),
            "drift_cm_per_cycle": _number(100.0 * trials.drift),
            "turn_deg_per_cycle": _number(math.degrees(trials.turn)),
        }
        if self.pushes:
            report["pushes"] = self._push_table(run, policy)
        if self.format == "json":
            say(json.dumps(report, indent=2, allow_nan=False))
        else:
            for line in _text(report):
                say(line)
        return 0

    def _push_table(self, run, policy) -> dict:
        """Shares that survive a push, a row per force, and the largest that ENOUGH survive (0 for none)."""
        import numpy as np

        from ..learning.trials import push_survival

        task = run.task(PUSHED * len(DIRECTIONS), self.device)
        rows, holds = [], np.ones(len(DIRECTIONS), bool)
        largest = np.zeros(len(DIRECTIONS))
        with bar("pushes", len(FORCES)) as progress:
            for force in FORCES:
                shares = push_survival(task, policy, run.states, force, seed=self.seed)
                rows.append([_number(share) for share in shares])
                holds &= shares >= ENOUGH
                largest[holds] = force
                progress(len(rows), f" of {force} N")
                if not holds.any():
                    break
        return {
            "seconds": 0.2,
            "per_direction": PUSHED,
            "forces": list(FORCES[: len(rows)]),
            "directions": list(DIRECTIONS),
            "survived": rows,
            "largest": dict(zip(DIRECTIONS, largest.tolist())),
            "largest_in_every_direction": float(largest.min()),
        }


def _number(value: float) -> float | None:
    """JSON has no NaN."""
    return float(value) if math.isfinite(value) else None


def _text(report: dict) -> list[str]:
    def shown(key: str, unit: str) -> str:
        return "-" if report[key] is None else f"{report[key]:.2f} {unit}"

    policy = "targets alone" if report["open_loop"] else f"best policy of {report['iterations']} iterations"
    lines = [
        f"run       {report['run']}: {report['skill']}, {policy}",
        f"trials    {report['trials']} of {report['cycles']:g} cycles ({report['seconds']:.0f} s), "
        f"speed noise {report['noise']:g}, pushes up to {report['push']:g} N, seed {report['seed']}",
        f"survived  {report['survived']} of {report['trials']}, "
        f"{100.0 * report['lived']:.1f} % of the time lived",
        f"tracking  joints {shown('angle_error_deg', 'degrees')}, "
        f"feet and head {shown('end_error_cm', 'cm')}, while standing",
        f"drift     {shown('drift_cm_per_cycle', 'cm')} and {shown('turn_deg_per_cycle', 'degrees')} a cycle",
    ]
    return lines + (_push_text(report["pushes"]) if "pushes" in report else [])


def _push_text(table: dict) -> list[str]:
    lines = [f"pushes    of {table['seconds']:g} s on the torso; % that stand 4 s later, by direction"]
    heads = ["".join(word[0] for word in name.split()) for name in table["directions"]]
    lines.append(f"{'N':>9} " + "".join(f"{head:>5}" for head in heads))
    for force, shares in zip(table["forces"], table["survived"]):
        cells = "".join(f"{'-' if share is None else round(100.0 * share):>5}" for share in shares)
        lines.append(f"{force:9} {cells}")
    lines.append(f"{'largest':>9} " + "".join(f"{table['largest'][d]:5.0f}" for d in table["directions"]))
    lines.append(
        f"          {100.0 * ENOUGH:.0f} % survive {table['largest_in_every_direction']:g} N in every "
        "direction (f forward, b back, l left, r right)"
    )
    return lines
