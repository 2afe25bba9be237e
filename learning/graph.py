"""Control graphs: reference motion cut into control fragments, and which may follow which (P1 3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..sims.reference.feedforward import leading_targets
from ..sims.reference.reference import Cycle, Reference, resample_q

if TYPE_CHECKING:
    from ..sims.ball import Ball
    from ..sims.model import Model

STEPS = 5
"""Time steps of a control fragment: 0.05 s (P1 3.2)."""
SHORTEST = 4
"""Fragments of a cycle that can be learned."""

Transition = tuple[tuple[int, int], tuple[int, int]]
"""(graph, fragment) and the (graph, fragment) that may follow it."""


@dataclass(frozen=True)
class Span:
    """Fragments in a row that belong together: a skill's cycle, a clip."""

    name: str
    first: int
    count: int


@dataclass(frozen=True)
class ControlGraph:
    """The motion halves m_k of control fragments C_k = (m_k, pi_k); `samcon` learns the policies pi_k.

    Fragment k has the rows k STEPS ... (k + 1) STEPS - 1 of `targets`.
    """

    targets: np.ndarray
    """(fragments * STEPS, nq) open-loop targets of the drives, a row per time step"""
    start_q: np.ndarray
    """(fragments, nq) where the reference begins each fragment"""
    start_qd: np.ndarray
    """(fragments, nv)"""
    goal_q: np.ndarray
    """(fragments, nq) where it ends each"""
    goal_qd: np.ndarray
    edges: np.ndarray
    """(edges, 2) fragments, of which the second may follow the first"""
    timestep: float
    """[s]"""
    stretch: float = 1.0
    """Its time was stretched by this factor, for whole fragments."""
    spans: tuple[Span, ...] = ()
    """What it is made of; one of all fragments where nothing is said."""
    motion: np.ndarray | None = None
    """(fragments * STEPS, nq) the reference after each time step; None in graphs of older files"""
    touch: np.ndarray | None = None
    """(fragments * STEPS, 2) bool: the left, the right hand should have the ball after each time step, H of
    P1 5.1; None where nobody plays with one"""
    checkpoints: np.ndarray | None = None
    """(n,) rows of `touch` after which a hand must have the ball, in order"""
    heights: np.ndarray | None = None
    """(n,) [m] that the ball must reach at each of them, h_ref of Eq. 8"""
    tracked: bool = False
    """Virtual forces hold the root to it: no legs are learned."""

    def __post_init__(self) -> None:
        edges = np.asarray(self.edges, int).reshape(-1, 2)
        if edges.size and not (edges.min() >= 0 and edges.max() < self.count):
            raise ValueError(f"edges lead outside the {self.count} fragments of the graph")
        ends = np.setdiff1d(np.arange(self.count), edges[:, 0])
        if len(ends):
            raise ValueError(f"no fragment follows fragment {ends[0]}: a random walk would end there")
        object.__setattr__(self, "edges", edges)
        object.__setattr__(self, "spans", tuple(self.spans) or (Span("", 0, self.count),))

    @property
    def count(self) -> int:
        """Fragments."""
        return len(self.start_q)

    @property
    def period(self) -> float:
        """[s] of a fragment"""
        return STEPS * self.timestep

    @property
    def cycle(self) -> int:
        """Fragments of a cycle, the longest where there are several."""
        return max(span.count for span in self.spans)

    @property
    def ends(self) -> bool:
        """Whether it has an end, where a fragment follows itself, as a clip's last does."""
        return bool((self.edges[:, 0] == self.edges[:, 1]).any())

    @property
    def branches(self) -> bool:
        """Whether any fragment has a choice of successors."""
        return len(self.edges) > self.count

    def rows(self, model: Model, k: int) -> np.ndarray:
        """The reference (STEPS + 1, nq) through fragment k, its start included."""
        if self.motion is None:
            ends = np.stack([self.start_q[k], self.goal_q[k]])
            return resample_q(model, ends, np.linspace(0.0, 1.0, STEPS + 1))
        return np.concatenate([self.start_q[k : k + 1], self.motion[k * STEPS : (k + 1) * STEPS]])

    @cached_property
    def _successors(self) -> tuple[np.ndarray, np.ndarray]:
        """Those of all fragments in a row, and where (fragments + 1,) each fragment's begin."""
        order = np.argsort(self.edges[:, 0], kind="stable")
        return self.edges[order, 1], np.searchsorted(self.edges[order, 0], np.arange(self.count + 1))

    def after(self, k: int) -> np.ndarray:
        """Fragments that may follow fragment k."""
        after, first = self._successors
        return np.asarray(after[first[k] : first[k + 1]])

    def follow(self, k: np.ndarray, where: np.ndarray | float = 0.0) -> np.ndarray:
        """For each fragment k (n,) one that follows it; where (n,): which of them, from 0 to 1."""
        after, begin = self._successors
        first, count = begin[k], begin[k + 1] - begin[k]
        return np.asarray(after[first + (where * count).astype(int)])

    def save(self, path: str | Path) -> None:
        """Write an .npz file."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "spans"}
        arrays = {name: value for name, value in arrays.items() if value is not None}
        spans = np.array([[s.name, str(s.first), str(s.count)] for s in self.spans])
        np.savez_compressed(path, **arrays, spans=spans)

    @staticmethod
    def load(path: str | Path) -> ControlGraph:
        """Read what `save` wrote."""
        with np.load(path) as file:
            values = {f.name: file[f.name] for f in fields(ControlGraph) if f.name in file}
        values |= {name: float(values[name]) for name in ("timestep", "stretch")}
        values["tracked"] = bool(values.get("tracked", False))
        spans = tuple(Span(str(n), int(a), int(b)) for n, a, b in values.pop("spans", ()))
        return ControlGraph(**values, spans=spans)

    def on(self, model: Model, other: Model) -> ControlGraph:
        """The same, made for another model, on this one, whose joints it has."""
        speed = np.concatenate([np.arange(other.nv)[other.dof_slice(name)] for name in model.joint_names])
        return replace(
            self,
            targets=model.convert_q(other, self.targets),
            motion=None if self.motion is None else model.convert_q(other, self.motion),
            start_q=model.convert_q(other, self.start_q),
            goal_q=model.convert_q(other, self.goal_q),
            start_qd=self.start_qd[:, speed],
            goal_qd=self.goal_qd[:, speed],
        )


def clip_graph(
    model: Model,
    reference: Reference,
    feet: Sequence[str],
    root_lead: float = 0.0,
    ball: Ball | None = None,
) -> ControlGraph:
    """A reference from its first row to its last, as fragments one after the other; the last follows itself.
    What is missing to a whole fragment is held still. feet, root_lead: see `leading_targets`. ball: who plays
    with it when."""
    rows = reference.frame_count - 1
    count = max(1, -(-rows // STEPS))
    held = np.minimum(np.arange(count * STEPS + 1), rows)
    speed = central_velocity(model, reference)[held]
    joint_q = reference.joint_q[held]
    targets = leading_targets(model, reference, feet, root_lead)[held]
    after = np.minimum(np.arange(count) + 1, count - 1)
    graph = cut(joint_q, speed, targets, reference.timestep, after)
    return graph if ball is None else _played(graph, ball, held[1:], rows)


def cyclic_graph(
    model: Model, cycle: Cycle, feet: Sequence[str], name: str = "", ball: Ball | None = None
) -> ControlGraph:
    """The smallest graph, a cycle whose last fragment leads to the first.

    The cycle's time is stretched to whole fragments. feet: bodies that carry it; see `leading_targets`.
    name: of its span. ball: who plays with it when.
    Raises ValueError for a cycle too short to be cut.
    """
    rows = cycle.reference.frame_count - 1
    count = round(rows / STEPS)
    if count < SHORTEST:
        least = SHORTEST * STEPS * cycle.reference.timestep
        duration = cycle.reference.duration
        raise ValueError(f"a cycle of {duration:.2f} s is too short: give {least:.2f} s or more")
    at = np.linspace(0.0, rows, count * STEPS + 1)
    fitted = Reference(resample_q(model, cycle.reference.joint_q, at), cycle.reference.timestep)
    several = Cycle(fitted, cycle.turn, cycle.travel).repeat(model, 3)
    middle = slice(count * STEPS, 2 * count * STEPS + 1)  # so that it has neighbours on both sides
    speed = central_velocity(model, several)[middle]
    targets = leading_targets(model, several, feet)[middle]
    graph = cut(
        several.joint_q[middle], speed, targets, fitted.timestep, (np.arange(count) + 1) % count, name
    )
    graph = replace(graph, stretch=count * STEPS / rows)
    return graph if ball is None else _played(graph, ball, at[1:], rows)


def _played(graph: ControlGraph, ball: Ball, at: np.ndarray, rows: int) -> ControlGraph:
    """The same with a ball, given at rows 0 to `rows` of the reference; at: where in it, in rows, the graph's
    time steps end. A checkpoint at the reference's first row is at the last time step of a cycle."""
    row = np.clip(np.searchsorted(at, ball.checkpoints), 0, len(at) - 1).astype(int)
    row[np.asarray(ball.checkpoints) == 0] = len(at) - 1
    touch = ball.touch[np.minimum(np.round(at).astype(int), rows)].copy()
    for checkpoint, place in zip(ball.checkpoints, row):
        touch[place] |= ball.touch[checkpoint]
    order = np.argsort(row, kind="stable")
    return replace(graph, touch=touch, checkpoints=row[order], heights=np.asarray(ball.heights, float)[order])


def cut(
    joint_q: np.ndarray,
    speed: np.ndarray,
    targets: np.ndarray,
    timestep: float,
    after: np.ndarray,
    name: str = "",
) -> ControlGraph:
    """Rows (fragments * STEPS + 1) cut into fragments, of which `after` (fragments,) follow."""
    begins = np.arange(len(after)) * STEPS
    return ControlGraph(
        targets=targets[1:],
        motion=joint_q[1:],
        start_q=joint_q[begins],
        start_qd=speed[begins],
        goal_q=joint_q[begins + STEPS],
        goal_qd=speed[begins + STEPS],
        edges=np.stack([np.arange(len(after)), after], axis=1),
        timestep=timestep,
        spans=(Span(name, 0, len(after)),),
    )


def joined(graphs: Sequence[ControlGraph], transitions: Sequence[Transition]) -> ControlGraph:
    """Several graphs as one, with the spans of all. transitions: ((graph, fragment), (graph, fragment))
    pairs, of which the second may follow the first; nothing is blended, so they should lead between similar
    states. Raises ValueError for a fragment that is not there, or graphs of different time steps."""
    if len({g.timestep for g in graphs}) != 1:
        raise ValueError(f"the graphs have different time steps: {[g.timestep for g in graphs]} s")
    for graph, fragment in (end for edge in transitions for end in edge):
        if not (0 <= graph < len(graphs) and 0 <= fragment < graphs[graph].count):
            raise ValueError(f"a transition names fragment {fragment} of graph {graph}: there is none")
    first = np.concatenate([[0], np.cumsum([g.count for g in graphs])[:-1]])
    between = [[first[a] + i, first[b] + j] for (a, i), (b, j) in transitions]
    edges = [g.edges + start for g, start in zip(graphs, first)]
    arrays = ["targets", "start_q", "start_qd", "goal_q", "goal_qd"]
    if all(g.motion is not None for g in graphs):
        arrays.append("motion")
    joint = {name: np.concatenate([getattr(g, name) for g in graphs]) for name in arrays}
    if all(g.touch is not None for g in graphs):
        joint |= {name: np.concatenate([getattr(g, name) for g in graphs]) for name in ("touch", "heights")}
        marks = [np.asarray(g.checkpoints) + STEPS * at for g, at in zip(graphs, first)]
        joint["checkpoints"] = np.concatenate(marks)
    return ControlGraph(
        **joint,  # type: ignore[arg-type]
        edges=np.concatenate([*edges, np.array(between, int).reshape(-1, 2)]),
        timestep=graphs[0].timestep,
        stretch=float(np.mean([g.stretch for g in graphs])),
        spans=tuple(replace(s, first=s.first + int(at)) for g, at in zip(graphs, first) for s in g.spans),
    )


def central_velocity(model: Model, reference: Reference) -> np.ndarray:
    """Joint velocities (frames, nv) by central differences."""
    ahead = reference.velocity(model)
    return 0.5 * (ahead + np.concatenate([ahead[:1], ahead[:-1]]))
