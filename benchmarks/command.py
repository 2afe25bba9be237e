"""`warpdribble bench step`: steps per second beside a peer, as a table or as JSON."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import tyro

from ..commands.console import quiet_warp
from ..commands.info import processor
from ..sims import Simulation
from ..sims.worlds.simulation import SWEEPS
from .mjwarp import MuJoCoWarp
from .mujoco import SETTINGS, MuJoCo
from .ours import Ours, solver_error
from .reset import Reset, print_reset, reset
from .scene import hold

HELD = 20
"""Fragments before every side starts again, so that the ball stays in the hand."""


class Side(Protocol):
    """One of those that are timed in turn."""

    def restart(self) -> None: ...

    def advance(self) -> float:
        """Seconds per step of one world, over one control fragment."""


@dataclass
class Step:
    """Time the whole step and its parts: the player with both feet down and the ball in one hand,
    random targets, h = 0.01 s."""

    worlds: tuple[int, ...] = (256,)
    """How many worlds; several numbers make a table."""
    against: Literal["mujoco", "mujoco_warp", "none"] = "mujoco"
    """The peer, on the same MJCF file in the same run: MuJoCo's C engine on one core, or MuJoCo Warp on
    the same device with as many worlds (needs mujoco_warp)."""
    format: Literal["table", "json"] = "table"
    device: str = "cpu"
    threads: int = 1
    """Threads of ours; MuJoCo runs on one."""
    lanes: int | None = None
    rounds: int = 60
    """Control fragments of 5 steps, ours and the peer's in turn; medians are reported."""
    out: Path | None = None
    """Append the result as a line of JSON."""


@dataclass
class Solve:
    """What the contact solver's sweeps cost and what they leave: the table behind its default."""

    sweeps: tuple[int, ...] = (1, 2, 4, 6, 8, 10, 15, 20, 40)
    worlds: int = 256
    format: Literal["table", "json"] = "table"


@dataclass
class Result:
    processor: str
    device: str
    threads: int
    lanes: int
    rows: list[dict[str, float]] = field(default_factory=list)
    """one per number of worlds: worlds, steps_per_second, us_per_world"""
    parts_us: dict[str, float] = field(default_factory=dict)
    """[us] per world of each part of a step"""
    first_step_s: float = 0.0
    kib_per_world: float = 0.0
    contacts: float = 0.0
    velocity_error: float = 0.0
    """[rad/s], see `ours.solver_error`"""
    against: str = ""
    """the peer and its version, as "MuJoCo 4.0.1\""""
    peers: dict[str, dict[str, float | None]] = field(default_factory=dict)
    """setting -> steps_per_second, contacts, velocity_error, ratio"""


COMMANDS: dict[str, Any] = {"step": Step, "solve": Solve, "reset": Reset}


def step(options: Step) -> Result:
    quiet_warp()
    scene = hold(max(options.worlds), options.rounds)
    start = time.perf_counter()
    sides = [Ours(scene, n, options.device, options.threads, options.lanes) for n in options.worlds]
    sides[0].advance()
    first = time.perf_counter() - start
    peers: dict[str, MuJoCo | MuJoCoWarp] = {}
    if options.against == "mujoco":
        peers = {name: MuJoCo(scene, name) for name in SETTINGS}
    elif options.against == "mujoco_warp":
        peers = {f"{n} worlds": MuJoCoWarp(scene, n, options.device) for n in options.worlds}
    times: dict[Side, list[float]] = {side: [] for side in (*sides, *peers.values())}
    for round_ in range(options.rounds):
        for side, seconds in times.items():
            if round_ % HELD == 0:
                side.restart()
            seconds.append(side.advance())
    sim = sides[0].sim
    result = Result(processor(), str(sim.device), sim.threads, sim.lanes)
    for n, side in zip(options.worlds, sides, strict=True):
        per_step = float(np.median(times[side]))
        result.rows.append(dict(worlds=n, steps_per_second=round(1 / per_step), us_per_world=1e6 * per_step))
    result.first_step_s = first
    result.kib_per_world = sim.memory_per_world / 1024
    result.contacts = sides[0].contacts()
    result.parts_us = sides[-1].parts()
    result.velocity_error = solver_error(scene, SWEEPS)
    best = max(row["steps_per_second"] for row in result.rows)
    result.against = next((peer.version for peer in peers.values()), "")
    for name, peer in peers.items():
        speed = 1 / float(np.median(times[peer]))
        contacts = float(np.mean(peer.contacts))
        error = peer.solver_error() if isinstance(peer, MuJoCo) else None
        result.peers[name] = dict(
            steps_per_second=round(speed),
            contacts=contacts,
            velocity_error=error,
            ratio=round(best / speed, 1),
        )
    return result


def solve(options: Solve) -> list[dict[str, float]]:
    quiet_warp()
    scene = hold(options.worlds, 40)
    rows = []
    for sweeps in options.sweeps:
        side = Ours(scene, options.worlds, "cpu", 1, None)
        side.sim = Simulation(scene.model, options.worlds, threads=1, sweeps=sweeps)
        side.restart()
        seconds, residuals = [], []
        for _ in range(40):
            seconds.append(side.advance())
            residuals.append(side.sim.contact_residual())
        rows.append(
            dict(
                sweeps=sweeps,
                steps_per_second=round(1 / float(np.median(seconds))),
                residual_median=float(np.median(residuals)),
                residual_p95=float(np.quantile(residuals, 0.95)),
                velocity_error=solver_error(scene, sweeps),
                held=float(np.mean(side.sim.status == 0)),
            )
        )
    return rows


def print_step(result: Result) -> None:
    print(f"{result.processor}; {result.device}, {result.lanes} lanes, {result.threads} thread(s)")
    print(
        f"first step after {result.first_step_s:.1f} s; {result.kib_per_world:.1f} KiB per world; "
        f"{result.contacts:.1f} contacts; velocity error {result.velocity_error:.1e} rad/s"
    )
    print(f"{'worlds':>10} {'steps/s':>12} {'us per world-step':>18}")
    for row in result.rows:
        print(f"{row['worlds']:>10} {row['steps_per_second']:>12,} {row['us_per_world']:>18.2f}")
    total = sum(result.parts_us.values())
    for name, us in result.parts_us.items():
        print(f"{name:>16} {us:8.3f} us {100 * us / total:5.1f} %")
    for name, peer in result.peers.items():
        error = peer["velocity_error"]
        off = "" if error is None else f"velocity error {error:.1e} rad/s, "
        print(
            f"{result.against}, {name}: {peer['steps_per_second']:,} steps/s, "
            f"{peer['contacts']:.1f} contacts, {off}ours is {peer['ratio']} x"
        )


def print_solve(rows: list[dict[str, float]]) -> None:
    print("sweeps      steps/s   residual m/s (median, 95 %)   velocity error rad/s   held")
    for r in rows:
        print(
            f"{r['sweeps']:>6} {r['steps_per_second']:>12,} {r['residual_median']:>14.2e} "
            f"{r['residual_p95']:>12.2e} {r['velocity_error']:>22.2e} {r['held']:>7.3f}"
        )


def main(arguments: list[str] | None = None) -> int:
    options: Step | Solve | Reset = tyro.extras.subcommand_cli_from_dict(
        COMMANDS, args=arguments, prog="warpdribble bench"
    )
    if isinstance(options, Step):
        result = step(options)
        line = json.dumps(asdict(result))
        if options.format == "json":
            print(line)
        else:
            print_step(result)
        if options.out:
            with options.out.open("a") as file:
                file.write(line + "\n")
    elif isinstance(options, Reset):
        quiet_warp()
        found = reset(options)
        if options.format == "json":
            print(json.dumps(found))
        else:
            print_reset(options, found)
    else:
        rows = solve(options)
        if options.format == "json":
            print(json.dumps(rows))
        else:
            print_solve(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
