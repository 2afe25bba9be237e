"""What a learned policy stands, as a picture: balls that bounce, weigh or slip otherwise, pushes, faster
starts, noisy and late senses.

    python -m warpdribble.reports.robust RUN [RUN ...] docs/pictures/robust.png

Each point is the share of TRIALS trials, from states on the policy's own way, that last SECONDS.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..learning.evaluate.trials import run_trials
from ..learning.methods import STAGES
from ..learning.rollout import Controller
from ..learning.runs.folder import Learned, Run
from ..learning.tasks.arms import RESTITUTION, Arms
from ..learning.tasks.disturbance import CALM
from ..sims import Model

TRIALS = 64
SECONDS = 20.0
RESTITUTIONS = (0.6, 0.65, 0.7, 0.75, 0.78, 0.8, 0.82, 0.85, 0.9, 0.95)
MASSES = (0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3)
PUSHES = (0.0, 50.0, 100.0, 150.0, 200.0, 300.0, 400.0)
NOISES = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3)
FRICTIONS = (0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
SENSORS = (0.0, 0.05, 0.1, 0.2, 0.4)
DELAYS = (0, 1, 2)
"""[fragments]"""
Curve = list[tuple[float, float]]


class Senses:
    """A policy that feels late and with noise. noise: standard deviation in units of the state; late: in
    fragments."""

    def __init__(self, policy: Controller, noise: float = 0.0, late: int = 0):
        self.policy, self.noise, self.late = policy, noise, late
        self.random = np.random.default_rng(0)
        self._before: list[np.ndarray] = []

    def act(self, s: np.ndarray, k: np.ndarray) -> np.ndarray:
        self._before = [*self._before, s][-self.late - 1 :]
        felt = self._before[0]
        return self.policy.act(felt + self.noise * self.random.standard_normal(felt.shape), k)


def pairs(model: Model) -> str:
    """Restitution and friction of all that the ball can touch, as Markdown."""
    ball = model.body(model.roles.one("ball"))
    kinds: dict[tuple[str, float, float], int] = {}
    for pair in model.pairs:
        shapes = [model.shapes[i] for i in pair["shapes"]]
        others = [s for s in shapes if s.body != ball]
        if len(others) == 1:
            what = others[0].name if others[0].body < 0 else "player"
            kind = (what, float(pair["restitution"]), float(pair["friction"]))
            kinds[kind] = kinds.get(kind, 0) + 1
    lines = ["| the ball and | shapes | restitution | friction |", "|---|---:|---:|---:|"]
    lines += [f"| {what} | {n} | {e:.2f} | {mu:.2f} |" for (what, e, mu), n in kinds.items()]
    return "\n".join(lines)


def measure(one: Learned) -> dict[str, Curve]:
    """Shares that last, by what is changed and how much."""
    task = one.task(TRIALS)
    assert isinstance(task, Arms)
    ball = task.model.roles.one("ball")
    mass = float(task.model.body_mass[task.model.body(ball)])
    fingers = {
        body for hand in task.model.roles.hands for body in task.model.descendants(task.model.body(hand))
    }
    hands = sorted({task.model.body_names[s.body] for s in task.model.shapes if s.body in fingers})

    def share(noise: float = 0.0, push: float = 0.0, senses: Controller = one.controller) -> float:
        cycles = SECONDS / (task.graph.cycle * task.graph.period)
        what = replace(CALM, push=push)
        return float(run_trials(task, senses, one.starts, cycles, 1, noise, what).survived.mean())

    def swept(values: tuple[float, ...], change: Callable[[float], object], usual: float) -> Curve:
        seen = []
        for value in values:
            change(value)
            seen.append((value, share()))
        change(usual)
        return seen

    touching = [
        (float(pair["friction"]), {task.model.shapes[i].body for i in pair["shapes"]})
        for pair in task.model.pairs
    ]
    usual = next(mu for mu, both in touching if task.model.body(ball) in both and both & fingers)

    def slips(friction: float) -> None:
        for body in hands:
            task.sim.set_contact(ball, body, friction=friction)

    return {
        "restitution of ball and ground": swept(
            RESTITUTIONS, lambda e: task.sim.set_contact(ball, "ground", restitution=e), RESTITUTION
        ),
        "mass of the ball, times": swept(MASSES, lambda m: task.sim.set_mass(ball, m * mass), 1.0),
        "largest pushes of 0.2 s, every 3 s [N]": [(force, share(push=force)) for force in PUSHES],
        "joint speed noise at the start [rad/s]": [(noise, share(noise)) for noise in NOISES],
        "friction of ball and hands": swept(FRICTIONS, slips, usual),
        "noise of the senses [units of the state]": [
            (noise, share(senses=Senses(one.controller, noise))) for noise in SENSORS
        ],
        "senses late by [s]": [
            (late * task.graph.period, share(senses=Senses(one.controller, late=late))) for late in DELAYS
        ],
    }


def draw(found: dict[str, dict[str, Curve]], out: Path) -> None:
    """A panel for each kind of change, a line for each skill."""
    from matplotlib.figure import Figure

    from ..takes.sheet import save

    kinds = list(next(iter(found.values())))
    figure = Figure(figsize=(12.0, 5.2), dpi=110, layout="constrained")
    axes = figure.subplots(2, 4, sharey=True).flat
    axes[len(kinds)].axis("off")
    for ax, kind in zip(axes, kinds):
        for skill, curves in found.items():
            x, y = np.array(curves[kind]).T
            ax.plot(x, 100.0 * y, "o-", ms=3, lw=1, label=skill)
        ax.set_xlabel(kind)
        ax.set_ylim(-3.0, 103.0)
        ax.grid(alpha=0.3)
        if kind == kinds[0]:
            ax.axvspan(0.78, 0.82, color="0.9", zorder=0)  # P1 8
            ax.legend(fontsize=7)
    figure.supylabel(f"% of {TRIALS} trials that last {SECONDS:g} s")
    save(figure, "What learned policies stand", out)


def main(runs: list[Path], out: Path) -> None:
    found: dict[str, dict[str, Curve]] = {}
    for path in runs:
        one = Run.load(path).learned(STAGES, "policy")
        if not found:
            print(pairs(one.task(1).model), flush=True)
        found[one.skill["name"]] = measure(one)
        print(json.dumps({one.skill["name"]: found[one.skill["name"]]}), flush=True)
    draw(found, out)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit("usage: python -m warpdribble.reports.robust RUN [RUN ...] OUT.png")
    main([Path(name) for name in sys.argv[1:-1]], Path(sys.argv[-1]))
