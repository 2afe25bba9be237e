"""`Probe`: named observations of every world, computed by one kernel.

    from warpdribble.sims.worlds import terms
    probe = Probe(sim, {"height": terms.height(), "way": terms.between("r_palm", "ball")})
    probe.read()                 # (world_count, 4)
    probe.columns["way"]         # slice(1, 4)

Vectors are in the facing frame: it stands on the ground below the player's root and turns with the root's
first axis, so that neither place nor heading in the world counts. What is judged against goals has a row of
their table for each world.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from .. import trees
from .places import Place, find_place, on_links
from .terms import Term

if TYPE_CHECKING:
    from .simulation import Simulation


@dataclass(frozen=True)
class Group:
    """Columns whose distance from what is wanted costs."""

    name: str
    """of the observation"""
    weight: float
    part: tuple[int, int] | None = None
    """first and end of its numbers that count; all of them"""


class Probe:
    """Observations of all worlds of a simulation, `(world_count, size)`.

    terms: by name, in the order of their columns. goals: (joint_q (rows, nq), joint_qd (rows, nv)) that
    `miss` compares with. groups: what `cost` adds up, once `wanted` is set."""

    def __init__(
        self,
        sim: Simulation,
        terms: Mapping[str, Term],
        goals: tuple[Any, Any] | None = None,
        groups: Sequence[Group] = (),
    ):
        self.sim, model = sim, sim.model
        self._program = sim.program("probe")
        self.columns: dict[str, slice] = {}
        self.size = 0
        for name, term in terms.items():
            self.columns[name] = slice(self.size, self.size + term.count)
            self.size += term.count
        if goals is None and any(term.judged for term in terms.values()):
            raise ValueError("what is judged needs goals")
        self._probe = probe = self._program.Probe()
        probe.root = int(model.joint_link[0])
        judged = [name for term in terms.values() for name in term.judged]
        for name in judged:
            if model.joint_type(name) == "free":
                raise ValueError(f"joint '{name}' is free: it has no goal here")
        whole = {"COM", "COM_VELOCITY", "ANGULAR_MOMENTUM", "FROM_COM"} & {t.kind for t in terms.values()}
        below = trees.below(model.tables["link_parent"], probe.root) if whole else []
        own = np.intersect1d(below, model.tables["body_link"]).astype(int)
        first = [find_place(model, t.places[0]) if t.places else None for t in terms.values()]
        last = [find_place(model, t.places[-1]) if t.places else None for t in terms.values()]
        nowhere = Place(model.body_names[0], (0.0, 0.0, 0.0))
        a, b = (on_links(model, [p or nowhere for p in ends]) for ends in (first, last))
        links, judges = np.stack([a[0], b[0]], axis=1), np.array([bool(t.judged) for t in terms.values()])
        ends = np.cumsum([0, *(len(t.judged) for t in terms.values())])
        links[judges] = np.stack([ends[:-1], ends[1:]], axis=1)[judges]
        values = [[*t.values, 0.0, 0.0, 0.0][:3] for t in terms.values()]
        column = [self.columns[group.name] for group in groups]
        spans = [range(c.start, c.stop)[slice(*(group.part or (None,)))] for c, group in zip(column, groups)]
        self._set("links", own, int)
        self._set("judged", [model.joint_link[model.joint(name)] for name in judged], int)
        self._set("kind", [int(getattr(self._program, t.kind)) for t in terms.values()], int)
        self._set("column", [c.start for c in self.columns.values()], int)
        self._set("link", links, int)
        self._set("point", np.stack([a[1], b[1]], axis=1), wp.vec3)
        self._set("value", np.reshape(values, (-1, 3)), float)
        self._set("first", [span.start for span in spans], int)
        self._set("count", [len(span) for span in spans], int)
        self._set("weight", [group.weight for group in groups], float)
        self._goals = None if goals is None else len(goals[0])
        self.rows = self._goals or 1
        if goals is not None:
            self._set_table("goal_q", goals[0], model.nq)
            self._set_table("goal_qd", goals[1], model.nv)
        self._row = sim.new_rows()
        self._out, self._cost = sim.new_port(self.size), sim.new_port(1)
        self.want(np.zeros((self.rows, self.size)))

    def _set(self, name: str, values: Any, dtype: Any) -> None:
        kind = np.int32 if dtype is int else np.float32
        array: wp.array[Any, Any] = wp.array(np.asarray(values, kind), dtype=dtype, device=self.sim.device)
        setattr(self._probe, name, array)

    def _set_table(self, name: str, values: Any, width: int) -> None:
        rows = self._goals or len(values)
        if np.shape(values) != (rows, width):
            raise ValueError(f"{name} must have shape ({rows}, {width}), not {np.shape(values)}")
        self._set(name, values, float)

    def want(self, wanted: Any) -> None:
        """Observations (rows, size) that cost nothing; a row for each of the goals, where there are any."""
        self._set_table("wanted", wanted, self.size)
        self.rows = len(wanted)
        inputs = [self._probe, self._row, self._out, self._cost]
        self._launch = self.sim.prepared(self._program, "observe", inputs)

    def read(self, rows: Any = 0) -> np.ndarray:
        """(world_count, size) of the present state, judged against the goals in `rows` (world_count,)."""
        return self.judge(rows)[0]

    def judge(self, rows: Any = 0) -> tuple[np.ndarray, np.ndarray]:
        """The same, and what it costs (world_count,)."""
        self.measure(rows)
        return np.array(self._out.numpy()), np.array(self._cost.numpy()[:, 0])

    def measure(self, rows: Any = 0) -> wp.array[Any, Any]:
        """The port `(world_count, size)` with the present observations; the next call writes to it."""
        rows = np.asarray(rows)
        if rows.min() < 0 or rows.max() >= self.rows:
            raise IndexError(f"rows must lie in 0 .. {self.rows - 1}")
        self.sim.set_rows(self._row, rows)
        self.sim._take_over()
        self._launch()
        return self._out
