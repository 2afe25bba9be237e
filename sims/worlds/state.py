"""`State`: what a step hands to the next, of any number of worlds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

if TYPE_CHECKING:
    from ..model import Model

QUANTITIES = {
    "joint_q": "q",
    "joint_qd": "qd",
    "impulse": "impulse",
    "knock": "knock",
    "full": "full",
    "torque": "asked",
    "broken": "broken",
    "fallen": "fallen",
    "fumbled": "fumbled",
    "hurried": "hurried",
    "strayed": "strayed",
}
"""Public name -> array of the kernels' `World`: coordinates, velocities, what the contacts and drives at
their limits start the next step from, and the status."""


@dataclass(frozen=True)
class Block:
    """A quantity within a stretch of floats; see `kernels.place.Block`."""

    start: int
    n: int
    parts: int
    lanes: int
    group_stride: int
    stride: int


@dataclass(frozen=True)
class Layout:
    """Where the quantities of `count` states lie."""

    count: int
    size: int
    """floats in all"""
    blocks: Mapping[str, Block]

    @staticmethod
    def plain(count: int, counts: Mapping[str, tuple[int, int]]) -> Layout:
        """State after state. counts: quantity -> (n, parts)."""
        width = sum(n * parts for n, parts in counts.values())
        blocks, start = {}, 0
        for name, (n, parts) in counts.items():
            blocks[name] = Block(start, n, parts, 1, width, parts)
            start += n * parts
        return Layout(count, width * count, blocks)

    def unlike(self, other: Layout) -> list[str]:
        """Quantities that two layouts have in different sizes."""
        both = [(name, b, other.blocks[name]) for name, b in self.blocks.items() if name in other.blocks]
        return [name for name, a, b in both if (a.n, a.parts) != (b.n, b.parts)]


class State:
    """States of `count` worlds, by name: `joint_q`, `joint_qd`, contact history, status.

    A `Simulation` gives its own with `state()` and takes any with `place`, of whatever device, lanes or
    number of worlds they came from. What a state lacks is zero. They can be cloned, picked from and pickled.
    """

    def __init__(self, data: wp.array[Any, Any], layout: Layout):
        self.data, self.layout = data, layout

    @staticmethod
    def of(model: Model, joint_q: Any, joint_qd: Any = None, device: Any = "cpu") -> State:
        """Fresh ones: joint_q (count, nq) [m, rad, -], joint_qd (count, nv) [m/s, rad/s] or at rest."""
        q = np.atleast_2d(np.asarray(joint_q, np.float32))
        qd = np.zeros((len(q), model.nv)) if joint_qd is None else joint_qd
        qd = np.broadcast_to(np.asarray(qd, np.float32), (len(q), model.nv))
        if q.shape[1] != model.nq:
            raise ValueError(f"joint_q must have shape (count, {model.nq}), not {q.shape}")
        layout = Layout.plain(len(q), {"joint_q": (model.nq, 1), "joint_qd": (model.nv, 1)})
        rows = np.concatenate([q, qd], axis=1).ravel()
        return State(wp.array(rows, dtype=float, device=device), layout)

    def __len__(self) -> int:
        return self.layout.count

    @property
    def names(self) -> list[str]:
        return list(self.layout.blocks)

    def __getitem__(self, name: str) -> np.ndarray:
        """A quantity (count, n) or (count, n, parts), a copy."""
        b = self.layout.blocks[name]
        groups = -(-len(self) // b.lanes)
        flat = self.data.numpy()[b.start :]
        strides = [4 * s for s in (b.group_stride, 1, b.stride, b.lanes)]
        rows = np.lib.stride_tricks.as_strided(flat, (groups, b.lanes, b.n, b.parts), strides)
        rows = rows.reshape(-1, b.n, b.parts)[: len(self)].copy()
        return rows[..., 0] if b.parts == 1 else rows

    @property
    def joint_q(self) -> np.ndarray:
        """(count, nq) [m, rad, -]"""
        return self["joint_q"]

    @property
    def joint_qd(self) -> np.ndarray:
        """(count, nv) [m/s, rad/s]"""
        return self["joint_qd"]

    def clone(self) -> State:
        return State(wp.clone(self.data), self.layout)

    def select(self, rows: Any) -> State:
        """The states of some rows, in their order, one after the other."""
        values = {name: self[name][np.asarray(rows)] for name in self.names}
        return _plain(values, self.data.device)

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """All of it by name, for a file; see `made`."""
        return {name: self[name] for name in self.names}

    @staticmethod
    def made(arrays: Mapping[str, np.ndarray], device: Any = "cpu") -> State:
        """States of what `arrays` were."""
        return _plain(dict(arrays), device)

    def __getstate__(self) -> dict[str, np.ndarray]:
        return self.arrays

    def __setstate__(self, values: dict[str, np.ndarray]) -> None:
        made = State.made(values)
        self.data, self.layout = made.data, made.layout


def _plain(values: dict[str, np.ndarray], device: Any) -> State:
    count = len(next(iter(values.values())))
    counts = {name: (v.shape[1], v.shape[2] if v.ndim == 3 else 1) for name, v in values.items()}
    flat = [v.reshape(count, n * parts) for v, (n, parts) in zip(values.values(), counts.values())]
    rows = np.concatenate(flat, axis=1).astype(np.float32).ravel()
    return State(wp.array(rows, dtype=float, device=device), Layout.plain(count, counts))
