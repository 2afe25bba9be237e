"""Control graphs: reference motion cut into control fragments, and which may follow which (P1 3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..sims.feedforward import leading_targets
from ..sims.reference import Cycle, Reference, resample_q

STEPS = 5
"""Time steps of a control fragment, 0.05 s (P1 3.2)."""


@dataclass(frozen=True)
class ControlGraph:
    """Control fragments C_k = (m_k, pi_k), the motion halves m_k; the policies are learned.

    The motion of fragment k are the rows k STEPS ... k STEPS + STEPS - 1 of `targets`.
    """

    targets: np.ndarray
    """(fragments * STEPS, nq) open-loop targets of the drives, a row per time step"""
    start_q: np.ndarray
    """(fragments, nq) reference pose at the start of each fragment"""
    start_qd: np.ndarray
    """(fragments, nv)"""
    goal_q: np.ndarray
    """(fragments, nq) reference pose at the end"""
    goal_qd: np.ndarray
    successors: tuple[tuple[int, ...], ...]
    """fragments that may follow each one"""
    timestep: float
    """[s]"""
    stretch: float = 1.0
    """by which the motion's time was stretched for whole fragments"""

    @property
    def count(self) -> int:
        return len(self.start_q)

    def follow(self, k: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """A random successor (n,) of each fragment."""
        counts = self._counts[k]
        return self._table[k, (random.random(len(k)) * counts).astype(int)]

    def __post_init__(self):
        counts = np.array([len(s) for s in self.successors])
        if len(counts) != self.count or (counts == 0).any():
            raise ValueError("every fragment of a control graph needs a successor")
        table = np.zeros((self.count, counts.max()), int)
        for k, after in enumerate(self.successors):
            table[k, : len(after)] = after
        object.__setattr__(self, "_counts", counts)
        object.__setattr__(self, "_table", table)


def cyclic_graph(model, cycle: Cycle, feet=("l_foot", "r_foot")) -> ControlGraph:
    """The smallest graph: a cycle whose last fragment leads to the first. Its time is stretched to a whole
    number of fragments. Raises ValueError for a cycle shorter than two fragments."""
    reference = cycle.reference
    rows = reference.frame_count - 1
    count = round(rows / STEPS)
    if count < 2:
        raise ValueError(f"a cycle of {reference.duration:.2f} s is too short to be learned")
    at = np.linspace(0.0, rows, count * STEPS + 1)
    fitted = Cycle(
        Reference(resample_q(model, reference.joint_q, at), reference.timestep), cycle.turn, cycle.travel
    )
    several = fitted.repeat(model, 3)
    middle = slice(count * STEPS, 2 * count * STEPS)
    targets = leading_targets(model, several, feet)[middle.start + 1 : middle.stop + 1]
    speed = _central_velocity(model, several)
    q, qd = several.joint_q[middle], speed[middle]
    first = np.arange(count) * STEPS
    later = (first + STEPS) % (count * STEPS)
    return ControlGraph(
        targets=targets,
        start_q=q[first],
        start_qd=qd[first],
        goal_q=q[later],
        goal_qd=qd[later],
        successors=tuple(((k + 1) % count,) for k in range(count)),
        timestep=reference.timestep,
        stretch=count * STEPS / rows,
    )


def _central_velocity(model, reference: Reference) -> np.ndarray:
    """Joint velocities (frames, nv) by central differences."""
    ahead = reference.velocity(model)
    return 0.5 * (ahead + np.concatenate([ahead[:1], ahead[:-1]]))
