"""A simulation's state as torch tensors."""

from __future__ import annotations

import numpy as np
import warp as wp


class Tensors:
    """State of a simulation, `(world_count, n)` torch tensors on its device.

    On CUDA, and on a CPU with one lane, they are the simulation's own memory: what the next step
    changes they show, and writing to them sets the state. With several lanes the worlds of a group lie
    interleaved, no tensor can describe that, and they are copies.
    """

    def __init__(self, sim):
        self._sim = sim

    @property
    def joint_q(self):
        """(world_count, nq) [m, rad, -]"""
        return self._tensor("q")

    @property
    def joint_qd(self):
        """(world_count, nv) [m/s, rad/s]"""
        return self._tensor("qd")

    @property
    def joint_target_q(self):
        """(world_count, nq) [m, rad, -]"""
        return self._tensor("target")

    def _tensor(self, name: str):
        import torch

        array = getattr(self._sim._world, name)
        if self._sim.lanes == 1:
            return wp.to_torch(array, requires_grad=False)[: self._sim.world_count]
        return torch.from_numpy(self._sim._read(array))


def as_array(values) -> np.ndarray:
    """A torch tensor, on any device, or anything array-like, as float32 NumPy."""
    if hasattr(values, "detach"):
        values = values.detach().cpu().numpy()
    return np.asarray(values, np.float32)
