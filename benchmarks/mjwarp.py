"""MuJoCo Warp on the same MJCF file, on the same device and with as many worlds: the peer on a GPU.

It steps through a captured graph on CUDA; on a CPU, where it is meant for development, launch by launch.
"""

from __future__ import annotations

import time
from importlib.metadata import version

import numpy as np
import warp as wp

from .scene import FRAGMENT, Scene, mujoco_q

CONTACTS, ROWS = 60, 240
"""Room per world for contacts and constraint rows; more than the scene ever has."""


class MuJoCoWarp:
    """The scene in `worlds` worlds, all with the first world's targets."""

    def __init__(self, scene: Scene, worlds: int, device: str) -> None:
        import mujoco
        import mujoco_warp as mjw

        self.mjw, self.scene, self.worlds = mjw, scene, worlds
        self.version = f"MuJoCo Warp {version('mujoco-warp')} (MuJoCo {mujoco.__version__})"
        self.device = wp.get_device(device)
        model = mujoco.MjModel.from_xml_path(str(scene.model.path))
        data = mujoco.MjData(model)
        data.qpos[:] = mujoco_q(scene.model, scene.start)
        mujoco.mj_forward(model, data)
        with wp.ScopedDevice(self.device):
            self.model = mjw.put_model(model)
            self.data = mjw.put_data(model, data, nworld=worlds, nconmax=CONTACTS, njmax=ROWS)
            self.start = [wp.clone(a) for a in (self.data.qpos, self.data.qvel)]
            mjw.step(self.model, self.data)  # compiles
            self.graph = None
            if not self.device.is_cpu:
                with wp.ScopedCapture() as capture:
                    for _ in range(FRAGMENT):
                        mjw.step(self.model, self.data)
                self.graph = capture.graph
        self.contacts: list[float] = []
        self.restart()

    def restart(self) -> None:
        for array, value in zip((self.data.qpos, self.data.qvel), self.start, strict=True):
            wp.copy(array, value)
        self.data.qacc_warmstart.zero_()
        self.fragment = 0

    def advance(self) -> float:
        """Seconds per step of one world, over one control fragment."""
        control = self.scene.controls[self.fragment % len(self.scene.controls)]
        self.data.ctrl.assign(np.tile(control, (self.worlds, 1)).astype(np.float32))
        self.fragment += 1
        wp.synchronize_device(self.device)
        start = time.perf_counter()
        if self.graph is not None:
            wp.capture_launch(self.graph)
        else:
            for _ in range(FRAGMENT):
                self.mjw.step(self.model, self.data)
        wp.synchronize_device(self.device)
        seconds = time.perf_counter() - start
        self.contacts.append(float(self.data.nacon.numpy()[0]) / self.worlds)
        return seconds / (FRAGMENT * self.worlds)
