"""`warpdribble bench reset`: what it takes to put some of many worlds into new states."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal
from unittest import mock

import numpy as np
import warp as wp

from ..sims import Simulation, State
from .scene import FRAGMENT, Scene, hold, mujoco_q


@dataclass
class Reset:
    """Reset some of many worlds of the player with a ball: launches and time, beside MuJoCo's mj_resetData
    and a fragment of all worlds."""

    worlds: int = 1024
    reset: int = 10
    """How many of them."""
    threads: int = 1
    device: str = "cpu"
    rounds: int = 200
    format: Literal["table", "json"] = "table"


def reset(options: Reset) -> dict[str, float]:
    """Medians [us], and the launches of one reset."""
    scene = hold(16, 1)
    sim = Simulation(scene.model, options.worlds, device=options.device, threads=options.threads)
    random = np.random.default_rng(0)
    which = random.choice(options.worlds, options.reset, replace=False)
    q = np.tile(scene.start, (options.reset, 1))
    pool = State.of(scene.model, q, device=sim.device)
    rows = np.full(options.worlds, -1)
    rows[which] = np.arange(options.reset)
    sim.reset(joint_q=scene.start)
    jobs = {
        "place_us": lambda: sim.place(pool, rows),
        "reset_us": lambda: sim.reset(which, q),
        "mujoco_us": _mujoco(scene, options.reset),
        "fragment_us": lambda: sim.step(FRAGMENT),
    }
    found = {"launches": float(_launches(jobs["place_us"]))}
    for name, job in jobs.items():
        spent = []
        for _ in range(options.rounds if name != "fragment_us" else 9):
            start = time.perf_counter()
            job()
            wp.synchronize_device(sim.device)
            spent.append(time.perf_counter() - start)
        found[name] = 1e6 * float(np.median(spent))
    return found


def _launches(job: Callable[[], object]) -> int:
    """How many kernel launches a job makes, a launch on several threads being several."""
    with mock.patch.object(wp.Launch, "launch", autospec=True, side_effect=wp.Launch.launch) as launch:
        job()
    return int(launch.call_count)


def _mujoco(scene: Scene, count: int) -> Callable[[], object]:
    """The same with MuJoCo: so many worlds back to the start."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(scene.model.path))
    worlds, qpos = [mujoco.MjData(model) for _ in range(count)], mujoco_q(scene.model, scene.start)

    def job() -> None:
        for data in worlds:
            mujoco.mj_resetData(model, data)
            data.qpos[:] = qpos

    return job


def print_reset(options: Reset, found: dict[str, float]) -> None:
    import mujoco

    print(f"{options.reset} of {options.worlds} worlds reset: {found['launches']:.0f} launch(es)")
    for name, label in (
        ("place_us", "placed from a pool of states"),
        ("reset_us", "reset from joint coordinates"),
        ("mujoco_us", f"MuJoCo {mujoco.__version__}, mj_resetData {options.reset} times"),
        ("fragment_us", f"{FRAGMENT} steps of all worlds"),
    ):
        print(f"{label:>38} {found[name]:10.1f} us")
