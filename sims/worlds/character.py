"""`Character`: which parts of a model are the player, what it feels of itself, and how it is steered.

The kernels behind it are `kernels.character` and `kernels.exchange`.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from ... import kernels
from ..model import gaps, pose
from ..reference.reference import root_joint

ENDS = 17
"""First column of `Character.sense` of the ends' places."""
LEAN, HEIGHT, COM, COM_VELOCITY, ANGULAR_MOMENTUM, SPIN, ANGLE, RATE = (
    slice(0, 2),
    slice(2, 3),
    slice(3, 6),
    slice(6, 9),
    slice(9, 12),
    slice(12, 15),
    15,
    16,
)
"""Columns of `Character.sense`."""


class Character:
    """The player of a simulation, steered along rows of tables.

    targets, goal_q: (rows, nq) joint coordinates [m, rad, -], what the drives are given and where the
    joints should be; goal_qd: (rows, nv) [m/s, rad/s]. ends: bodies whose ends (the middle of the first
    shape) are felt. judged: joints that count in ANGLE and RATE. steered: joints whose targets are offset, in
    the order of the offset's columns. Every world follows rows of its own.
    """

    def __init__(self, sim, targets, goal_q, goal_qd, ends, judged, steered):
        self.sim, model = sim, sim.model
        for name in (*judged, *steered):
            if model.joint_type(name) == "free":
                raise ValueError(f"joint '{name}' is free: it has no goal and no drive here")
        if not steered:
            raise ValueError("name the joints to be steered")
        self.ends = tuple(ends)
        self._program = kernels.program(sim.lanes, "character")
        self._goals = [self._upload(table) for table in (goal_q, goal_qd)]
        self._who = self._make(model, judged)
        self.columns = 0
        dofs = np.full(model.nv, -1, np.int32)
        for name in steered:
            place = model.dof_slice(name)
            dofs[place] = self.columns + np.arange(place.stop - place.start)
            self.columns += place.stop - place.start
        self._out = sim._allocate(ENDS + 3 * len(self.ends), sim._program.Real)
        self._row = wp.zeros((sim.groups, sim.lanes), dtype=int, device=sim.device)
        self._course = course = sim._program.Course()
        course.table = self._upload(targets)
        course.row = wp.zeros((sim.groups, sim.lanes), dtype=int, device=sim.device)
        course.offset = sim._allocate(self.columns, sim._program.Real)
        course.column = wp.array(dofs, dtype=int, device=sim.device)

    def _upload(self, table) -> wp.array:
        return wp.array(np.asarray(table, np.float32), dtype=float, device=self.sim.device)

    def _make(self, model, judged):
        who = self._program.Character()
        t = model.tables
        own = gaps.descendants(model, pose.joint_body(model, root_joint(model)))
        who.root = int(model.joint_link[0])
        arrays = {
            "links": np.unique(t["body_link"][own]),
            "judged": np.array([model.joint_link[model.joint(name)] for name in judged]),
            "end_link": np.array([t["body_link"][model.body(name)] for name in self.ends]),
        }
        for name, values in arrays.items():
            setattr(who, name, wp.array(values.astype(np.int32), dtype=int, device=self.sim.device))
        places = []
        for name in self.ends:
            shape = next((s for s in model.shapes if s.body == model.body(name)), None)
            if shape is None:
                raise ValueError(f"body '{name}' has no shape, so no end to be felt")
            at = pose.Rotation.from_quat(t["body_turn"][model.body(name)]).apply(shape.pos)
            places.append(t["body_offset"][model.body(name)] + at)
        who.end_point = wp.array(np.array(places, np.float32), dtype=wp.vec3, device=self.sim.device)
        return who

    def _choose(self, array: wp.array, rows, end: int) -> wp.array:
        rows = np.broadcast_to(np.asarray(rows, np.int32), (self.sim.world_count,))
        if rows.min() < 0 or rows.max() >= end:
            raise IndexError(f"rows must lie in 0 .. {end - 1}")
        array.assign(self.sim._padded(rows).reshape(array.shape))
        return array

    def sense(self, rows) -> np.ndarray:
        """(world_count, ENDS + 3 ends) of the present state, judged against the goals in `rows`
        (world_count,): columns LEAN ... RATE, then the place [m] of each end in the facing frame."""
        self.sim._run(
            self._program,
            "sense",
            [self._who, *self._goals, self._choose(self._row, rows, self._goals[0].shape[0]), self._out],
        )
        return self.sim._read(self._out)

    def step(self, count: int, rows, offset) -> None:
        """Advance all worlds by `count` steps, the drives' targets going along the table from `rows`
        (world_count,) on, those of the steered joints offset by (world_count, columns) [rad]: an angle for
        a hinge, a rotation vector in the turned joint's axes for a ball joint."""
        self._choose(self._course.row, rows, self._course.table.shape[0] - count + 1)
        if np.shape(offset) != (self.sim.world_count, self.columns):
            raise ValueError(f"offset must have shape ({self.sim.world_count}, {self.columns})")
        self.sim._fill(self._course.offset, offset)
        self.sim._run(self.sim._program, "step", [count, self._course])
