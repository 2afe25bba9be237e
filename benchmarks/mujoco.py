"""MuJoCo's C engine on the same MJCF file, one world on one core."""

from __future__ import annotations

import copy
import time

import numpy as np

from .scene import FRAGMENT, Scene, mujoco_q

SETTINGS = {
    # name: (solver, iterations); None keeps the file's, which is MuJoCo's default
    "default (Newton)": (None, None),
    "PGS, 10 iterations": (0, 10),
    "PGS, 5 iterations": (0, 5),
}


class MuJoCo:
    """The scene's first world."""

    def __init__(self, scene: Scene, setting: str) -> None:
        import mujoco

        self.mujoco = mujoco
        self.version = f"MuJoCo {mujoco.__version__}"
        self.scene = scene
        self.model = mujoco.MjModel.from_xml_path(str(scene.model.path))
        solver, iterations = SETTINGS[setting]
        if solver is not None:
            self.model.opt.solver = solver
        if iterations is not None:
            self.model.opt.iterations = iterations
        self.data = mujoco.MjData(self.model)
        self.contacts: list[int] = []
        self.restart()

    def restart(self) -> None:
        self.mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = mujoco_q(self.scene.model, self.scene.start)
        self.fragment = 0

    def advance(self) -> float:
        """Seconds per step, over one control fragment."""
        self.data.ctrl[:] = self.scene.controls[self.fragment % len(self.scene.controls)]
        self.fragment += 1
        start = time.perf_counter()
        self.mujoco.mj_step(self.model, self.data, nstep=FRAGMENT)
        seconds = (time.perf_counter() - start) / FRAGMENT
        self.contacts.append(self.data.ncon)
        return seconds

    def solver_error(self, fragments: int = 60) -> float:
        """As `ours.solver_error`: beside a Newton solve to a tolerance of zero, from the same state."""
        exact = copy.copy(self.model)
        exact.opt.solver, exact.opt.iterations, exact.opt.tolerance = 2, 200, 0.0
        errors = []
        for k in range(fragments):
            if k % 20 == 0:
                self.restart()
            self.advance()
            other = self.mujoco.MjData(exact)
            self.mujoco.mj_copyData(other, exact, self.data)
            self.mujoco.mj_step(exact, other)
            self.mujoco.mj_step(self.model, self.data)
            errors.append(np.abs(other.qvel - self.data.qvel).max())
        return float(np.median(errors))
