"""Control graphs: reference motion cut into control fragments, and which may follow which (P1 3.2)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ..sims.reference.feedforward import leading_targets
from ..sims.reference.reference import Cycle, Reference, resample_q

STEPS = 5
"""Time steps of a control fragment: 0.05 s (P1 3.2)."""
SHORTEST = 4
"""Fragments of a cycle that can be learned."""


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

    def __post_init__(self):
        edges = np.asarray(self.edges, int).reshape(-1, 2)
        if edges.size and not (edges.min() >= 0 and edges.max() < self.count):
            raise ValueError(f"edges lead outside the {self.count} fragments of the graph")
        ends = np.setdiff1d(np.arange(self.count), edges[:, 0])
        if len(ends):
            raise ValueError(f"no fragment follows fragment {ends[0]}: a random walk would end there")
        object.__setattr__(self, "edges", edges)
        order = np.argsort(edges[:, 0], kind="stable")
        object.__setattr__(self, "_after", edges[order, 1])
        object.__setattr__(self, "_first", np.searchsorted(edges[order, 0], np.arange(self.count + 1)))

    @property
    def count(self) -> int:
        """Fragments."""
        return len(self.start_q)

    @property
    def period(self) -> float:
        """[s] of a fragment"""
        return STEPS * self.timestep

    def follow(self, k: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """For each fragment k (n,) one that follows it, drawn evenly (n,)."""
        first = self._first[k]
        return self._after[first + (random.random(len(k)) * (self._first[k + 1] - first)).astype(int)]

    def save(self, path: str | Path) -> None:
        """Write an .npz file."""
        np.savez_compressed(path, **{f.name: getattr(self, f.name) for f in fields(self)})

    @staticmethod
    def load(path: str | Path) -> ControlGraph:
        """Read what `save` wrote."""
        with np.load(path) as file:
            values = {f.name: file[f.name] for f in fields(ControlGraph)}
        values |= {name: float(values[name]) for name in ("timestep", "stretch")}
        return ControlGraph(**values)


def cyclic_graph(model, cycle: Cycle, feet=("l_foot", "r_foot")) -> ControlGraph:
    """The smallest graph, a cycle whose last fragment leads to the first.

    The cycle's time is stretched to whole fragments. feet: bodies that carry it; see `leading_targets`.
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
    speed = _central_velocity(model, several)
    first = np.arange(count + 1) * STEPS + count * STEPS  # of the middle cycle, and of the one after
    begins, ends = first[:-1], first[1:]
    targets = leading_targets(model, several, feet)
    return ControlGraph(
        targets=targets[begins[0] + 1 : ends[-1] + 1],
        start_q=several.joint_q[begins],
        start_qd=speed[begins],
        goal_q=several.joint_q[ends],
        goal_qd=speed[ends],
        edges=np.stack([np.arange(count), (np.arange(count) + 1) % count], axis=1),
        timestep=fitted.timestep,
        stretch=count * STEPS / rows,
    )


def joined(graphs: list[ControlGraph], transitions) -> ControlGraph:
    """Several graphs as one. transitions: ((graph, fragment), (graph, fragment)) pairs, of which the second
    may follow the first; nothing is blended, so they should lead between similar states. Raises ValueError
    for a fragment that is not there, or graphs of different time steps."""
    if len({g.timestep for g in graphs}) != 1:
        raise ValueError(f"the graphs have different time steps: {[g.timestep for g in graphs]} s")
    for graph, fragment in (end for edge in transitions for end in edge):
        if not (0 <= graph < len(graphs) and 0 <= fragment < graphs[graph].count):
            raise ValueError(f"a transition names fragment {fragment} of graph {graph}: there is none")
    first = np.concatenate([[0], np.cumsum([g.count for g in graphs])[:-1]])
    between = [[first[a] + i, first[b] + j] for (a, i), (b, j) in transitions]
    edges = [g.edges + start for g, start in zip(graphs, first)]
    arrays = ("targets", "start_q", "start_qd", "goal_q", "goal_qd")
    return ControlGraph(
        **{name: np.concatenate([getattr(g, name) for g in graphs]) for name in arrays},
        edges=np.concatenate([*edges, np.array(between, int).reshape(-1, 2)]),
        timestep=graphs[0].timestep,
        stretch=float(np.mean([g.stretch for g in graphs])),
    )


def _central_velocity(model, reference: Reference) -> np.ndarray:
    """Joint velocities (frames, nv) by central differences."""
    ahead = reference.velocity(model)
    return 0.5 * (ahead + np.concatenate([ahead[:1], ahead[:-1]]))
