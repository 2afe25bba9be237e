"""States to start from, and random numbers for worlds that are simulated side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .graph import ControlGraph


class Streams:
    """Random numbers for `count` units, each a `group` of worlds in a row that feel the same.

    A unit draws from a stream of its own, so that it does not matter which units are simulated together; or
    all from one.
    """

    def __init__(self, randoms: Sequence[np.random.Generator], count: int | None = None, group: int = 1):
        self.randoms, self.group = list(randoms), group
        self.count = len(self.randoms) if count is None else count
        if len(self.randoms) not in (1, self.count):
            raise ValueError(f"{len(self.randoms)} streams for {self.count} units: one each, or one for all")

    def _draw(self, kind: str, shape: tuple[int, ...]) -> np.ndarray:
        if len(self.randoms) != self.count or self.count == 1:
            return np.asarray(getattr(self.randoms[0], kind)((self.count, *shape)))
        drawn = np.empty((self.count, *shape))
        for random, own in zip(self.randoms, drawn.reshape(self.count, -1)):
            getattr(random, kind)(out=own)
        return drawn

    def only(self, units: np.ndarray) -> Streams:
        """The streams of some units, given by a mask (count,)."""
        if len(self.randoms) != self.count:
            raise ValueError("units that share a stream cannot draw alone")
        return Streams([r for r, own in zip(self.randoms, units) if own], group=self.group)

    def uniform(self, *shape: int) -> np.ndarray:
        """(count, *shape) from 0 to 1"""
        return self._draw("random", shape)

    def normal(self, *shape: int) -> np.ndarray:
        """(count, *shape) of variance 1"""
        return self._draw("standard_normal", shape)

    def worlds(self, values: np.ndarray) -> np.ndarray:
        """Values (count, ...) of units for their worlds (count * group, ...)."""
        return values if self.group == 1 else np.repeat(values, self.group, axis=0)


@dataclass
class Starts:
    """States from which trials and walks start."""

    k: np.ndarray
    """(n,) fragment that begins"""
    joint_q: np.ndarray
    """(n, nq) [m, rad, -]"""
    joint_qd: np.ndarray
    """(n, nv) [m/s, rad/s]"""

    def __len__(self) -> int:
        return len(self.k)

    def draw(self, streams: Streams, speed_noise: float = 0.0) -> Starts:
        """A random one for each world, with noise on all joint velocities [rad/s, m/s]; the same one for a
        unit's worlds."""
        pick = (streams.uniform() * len(self)).astype(int)
        noise = speed_noise * streams.normal(self.joint_qd.shape[1])
        each = Starts(self.k[pick], self.joint_q[pick], self.joint_qd[pick] + noise)
        return Starts(*(streams.worlds(part) for part in vars(each).values()))

    def __getitem__(self, which: np.ndarray | slice | list[int]) -> Starts:
        """Some of them: rows, a slice, or a mask (n,)."""
        return Starts(*(part[which] for part in vars(self).values()))

    @staticmethod
    def joined(parts: Sequence[Starts]) -> Starts:
        """All of them, one after the other."""
        return Starts(*(np.concatenate([vars(p)[name] for p in parts]) for name in vars(parts[0])))


def reference_starts(graph: ControlGraph) -> Starts:
    """The reference's own states."""
    return Starts(np.arange(graph.count), graph.start_q, graph.start_qd)
