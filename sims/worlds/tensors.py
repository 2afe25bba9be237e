"""A simulation's state as torch tensors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

if TYPE_CHECKING:
    import torch

    from .simulation import Simulation


class Tensors:
    """State of a simulation, `(world_count, n)` torch tensors on its device.

    They are live memory: what the next step changes they show, and writing to them sets the state; see
    `Simulation.port`. Quaternions (xyzw) that are written should have unit length.
    """

    def __init__(self, sim: Simulation):
        self._sim = sim

    @property
    def joint_q(self) -> torch.Tensor:
        """(world_count, nq) [m, rad, -]"""
        return self._tensor("joint_q")

    @property
    def joint_qd(self) -> torch.Tensor:
        """(world_count, nv) [m/s, rad/s]"""
        return self._tensor("joint_qd")

    @property
    def joint_target_q(self) -> torch.Tensor:
        """(world_count, nq) [m, rad, -]"""
        return self._tensor("joint_target_q")

    @property
    def joint_f(self) -> torch.Tensor:
        """(world_count, nv) generalised forces [N, N m]"""
        return self._tensor("joint_f")

    def _tensor(self, name: str) -> torch.Tensor:
        tensor: torch.Tensor = wp.to_torch(self._sim.port(name), requires_grad=False)
        return tensor


def as_array(values: Any) -> np.ndarray:
    """A torch tensor, on any device, or anything array-like, as float32 NumPy."""
    if hasattr(values, "detach"):
        values = values.detach().cpu().numpy()
    return np.asarray(values, np.float32)
