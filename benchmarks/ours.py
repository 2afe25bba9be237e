"""Our side: steps per second, parts of a step, how far the contact solve is from its limit."""

from __future__ import annotations

import time

import numpy as np

from ..sims import Simulation
from .scene import FRAGMENT, Scene

PARTS = {
    "kinematics": "run_kinematics",
    "inertia": "run_inertias",
    "factor": "run_factorize",
    "effort limits": "run_judge_drives",
    "contact rows": "run_find",
    "contact solve": "run_solve",
    "velocities": "run_velocities",
}


class Ours:
    """The scene in `worlds` worlds, advanced a fragment at a time."""

    def __init__(
        self, scene: Scene, worlds: int, device: str, threads: int | None, lanes: int | None
    ) -> None:
        self.scene = scene
        self.sim = Simulation(scene.model, worlds, device=device, threads=threads, lanes=lanes)
        self.restart()

    def restart(self) -> None:
        self.sim.reset(joint_q=self.scene.start)
        self.fragment = 0

    def advance(self) -> float:
        """Seconds per step of one world, over one control fragment; setting targets not counted."""
        targets = self.scene.targets[self.fragment % len(self.scene.targets)]
        self.sim.set_targets(targets[: self.sim.world_count])
        self.fragment += 1
        start = time.perf_counter()
        self.sim.step(FRAGMENT)
        self._wait()
        return (time.perf_counter() - start) / (FRAGMENT * self.sim.world_count)

    def _wait(self) -> None:
        if not self.sim.device.is_cpu:
            import warp

            warp.synchronize_device(self.sim.device)

    def parts(self, rounds: int = 9) -> dict[str, float]:
        """Microseconds per world of each part of a step, timed alone on the state of one step."""
        found: dict[str, float] = {}
        for name, kernel in PARTS.items():
            self.sim.step(1)
            seconds = []
            for _ in range(rounds):
                start = time.perf_counter()
                self.sim.launch(kernel, 10)
                self._wait()
                seconds.append(time.perf_counter() - start)
            found[name] = 1e6 * float(np.median(seconds)) / (10 * self.sim.world_count)
            self.sim.step(1)
        return found

    def contacts(self) -> float:
        """Touching slots per world."""
        return float((self.sim.contacts().impulse[:, :, 0] > 0).sum(1).mean())


def solver_error(scene: Scene, sweeps: int, fragments: int = 12) -> float:
    """Largest joint velocity error [rad/s] that `sweeps` leave in a step, beside a solve of 400 sweeps
    from the same state and warm start; median over worlds and the last steps of fragments."""
    worlds = min(64, scene.targets.shape[1])
    usual = Simulation(scene.model, worlds, sweeps=sweeps)
    exact = Simulation(scene.model, worlds, sweeps=400)
    usual.reset(joint_q=scene.start)
    errors = []
    for fragment in range(fragments):
        targets = scene.targets[fragment % len(scene.targets), :worlds]
        usual.set_targets(targets)
        exact.set_targets(targets)
        usual.step(FRAGMENT - 1)
        exact.reset(joint_q=usual.joint_q, joint_qd=usual.joint_qd)
        exact.copy_contact_history(usual)
        usual.step()
        exact.step()
        errors.append(np.abs(usual.joint_qd - exact.joint_qd).max(1))
    return float(np.median(errors))
