"""`Course`: worlds that step along a table of targets, each along rows of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

if TYPE_CHECKING:
    from .simulation import Simulation
    from .watch import Watch

Signal = Mapping[str, float | Sequence[float]]
"""Dofs that share a column of offsets: joint -> gain, for a ball joint of three numbers."""


class Course:
    """What acts on the worlds of a simulation while they step along a table.

    targets: (rows, nq) joint coordinates that the drives are given [m, rad, -]. steered: what offsets move,
    column after column: the name of a joint, each of whose dofs gets a column, or a `Signal`, one column that
    many dofs share with a gain each (P1 Eq. 1-3). pushed: bodies that forces act on.

    `offset` (worlds, columns) [rad] and `push` (worlds, bodies, 3) [N, world axes] are live: what is written
    to them acts from the next step on. An offset is an angle of a hinge, and of a ball joint the
    components of a rotation vector in the turned joint's axes.
    """

    def __init__(
        self, sim: Simulation, targets: Any, steered: Sequence[str | Signal] = (), pushed: Sequence[str] = ()
    ):
        self.sim, model = sim, sim.model
        column, gain = np.full(model.nv, -1, np.int32), np.zeros(model.nv, np.float32)
        self.columns = 0
        for one in steered:
            names = [one] if isinstance(one, str) else list(one)
            for name in names:
                if model.joint_type(name) == "free":
                    raise ValueError(f"joint '{name}' is free: it has no drive here")
                place = model.dof_slice(name)
                count = place.stop - place.start
                if (column[place] >= 0).any():
                    raise ValueError(f"joint '{name}' is steered twice")
                column[place] = self.columns + (np.arange(count) if isinstance(one, str) else 0)
                own = np.ones(count)
                if not isinstance(one, str):
                    own = np.atleast_1d(one[name])
                if own.shape != (count,):
                    raise ValueError(f"joint '{name}' takes a gain for each of {count} dofs, not {own}")
                gain[place] = own
            self.columns += count if isinstance(one, str) else 1
        self._course = course = sim.program("step").Course()
        self.rows = len(targets)
        if np.shape(targets) != (self.rows, model.nq):
            raise ValueError(f"targets must have shape (rows, {model.nq}), not {np.shape(targets)}")
        course.table = wp.array(np.asarray(targets, np.float32), dtype=float, device=sim.device)
        course.row = sim.new_rows()
        course.column = wp.array(column, dtype=int, device=sim.device)
        course.gain = wp.array(gain, dtype=float, device=sim.device)
        course.offset = sim.new_port(max(self.columns, 1))
        course.pushed = wp.array([model.body(b) for b in pushed], dtype=int, device=sim.device)
        course.push = sim.new_port(3 * max(len(pushed), 1))
        self.offset = np.zeros((sim.world_count, self.columns), np.float32)
        self.push = np.zeros((sim.world_count, len(pushed), 3), np.float32)
        self.pushed = tuple(pushed)
        if sim.device.is_cpu:
            self.offset = course.offset.numpy()[:, : self.columns]
            self.push = course.push.numpy()[:, : 3 * len(pushed)].reshape(sim.world_count, len(pushed), 3)
        self._nobody = sim.program("step").Watch()
        self._ready: dict[tuple[int, Any], Callable[[], None]] = {}

    def calm(self) -> None:
        """End all forces."""
        self.push[:] = 0.0

    def step(self, count: int, rows: Any, watch: Watch | None = None) -> None:
        """Advance all worlds by `count` steps, from `rows` (world_count,) of the table on."""
        rows = np.asarray(rows)
        if rows.min() < 0 or rows.max() > self.rows - count:
            raise IndexError(f"rows must lie in 0 .. {self.rows - count}")
        if watch and watch.rows != self.rows:
            raise ValueError(f"the watch is for a table of {watch.rows} rows, not of {self.rows}")
        sim, course = self.sim, self._course
        sim.set_rows(course.row, rows)
        if not sim.device.is_cpu:
            for port, values in ((course.offset, self.offset), (course.push, self.push)):
                if values.size:
                    port.assign(values.reshape(sim.world_count, -1))
        if not sim.forced and self.push.any():
            sim.forced = True
        struct = watch.struct if watch else self._nobody
        if (count, struct) not in self._ready:
            self._ready[count, struct] = sim.advancing(count, course, struct)
        self._ready[count, struct]()
