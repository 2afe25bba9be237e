"""Worlds in which a model follows a control graph, each from fragment to fragment on its own."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import warp as wp

from ...sims.model import Model
from ...sims.worlds import NONFINITE, Course, Signal, Simulation, State, Watch
from ..graph import STEPS, ControlGraph
from ..starts import Starts


class Follow:
    """The open loop as a task: nothing is observed, nothing is offset, everything broken has failed.

    steered, pushed: as for `Course`. Other tasks add what is observed and what it costs.
    """

    actions = 0
    obs = 0

    def __init__(
        self,
        model: Model,
        graph: ControlGraph,
        worlds: int,
        device: str = "cpu",
        threads: int | None = None,
        steered: Sequence[str | Signal] = (),
        pushed: Sequence[str] = (),
    ):
        self.model, self.graph, self.worlds = model, graph, worlds
        self.sim = Simulation(model, worlds, device, threads)
        self.course = Course(self.sim, graph.targets, steered, pushed)
        self.watch: Watch | None = None
        """what looks into the fragments"""
        self.samples = 0
        """fragments simulated"""
        self.simulating = 0.0
        """[s] that this took"""

    def reset(self, starts: Starts, which: np.ndarray | None = None) -> None:
        """Put worlds into states, all of them or those of a mask (worlds,), a state for each."""
        which = np.ones(self.worlds, bool) if which is None else which
        rows = np.full(self.worlds, -1)
        rows[which] = np.arange(which.sum())
        self.sim.place(State.of(self.model, starts.joint_q, starts.joint_qd, self.sim.device), rows)

    def observe(self, k: np.ndarray) -> np.ndarray:
        """(worlds, 0)"""
        return np.zeros((self.worlds, 0))

    def advance(self, k: np.ndarray, action: np.ndarray, first: int = 0, count: int = STEPS) -> None:
        """Simulate steps first ... first + count - 1 of fragments k (worlds,)."""
        began = time.perf_counter()
        self.course.offset[:, : action.shape[1]] = action
        looks = (self.watch,) if self.watch else ()
        self.course.step(count, k * STEPS + first, *looks)
        wp.synchronize_device(self.sim.device)
        self.simulating += time.perf_counter() - began
        self.samples += self.worlds if first + count == STEPS else 0

    def judge(self, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nothing costs; who is broken has failed (worlds,)."""
        broken = self.sim.status & NONFINITE != 0
        return np.where(broken, np.inf, 0.0), broken

    def become(self, sources: np.ndarray) -> None:
        """Every world becomes a copy of another (worlds,)."""
        self.sim.copy_worlds(sources)

    def snapshot(self) -> dict[str, np.ndarray]:
        """All that the future of all worlds depends on, between two fragments, by name; for `recall`."""
        return {f"sim.{name}": values for name, values in self.sim.state().arrays.items()}

    def recall(self, snapshot: Mapping[str, np.ndarray]) -> None:
        """All worlds are again as they were."""
        arrays = {name[4:]: v for name, v in snapshot.items() if name.startswith("sim.")}
        self.sim.place(State.made(arrays, self.sim.device))

    def calm(self) -> None:
        """End all disturbances."""
        self.course.calm()
        self.others[:] = 0.0

    @property
    def others(self) -> np.ndarray:
        """(worlds, n) live offsets of what is steered, but not by this task's actions."""
        return self.course.offset[:, self.actions :]


class OpenLoop:
    """The controller that changes nothing."""

    def __init__(self, actions: int = 0):
        self.actions = actions

    def act(self, obs: Any, k: np.ndarray) -> np.ndarray:
        return np.zeros((len(k), self.actions))
