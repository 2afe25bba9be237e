"""The most recent transitions of many worlds, in a file that is as large as they are many."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..runs.files import mapped


@dataclass(frozen=True)
class Transitions:
    """Some transitions, arrays (n, ...)."""

    x: np.ndarray
    """(n, obs) state"""
    k: np.ndarray
    """(n,) fragment"""
    action: np.ndarray
    """(n, actions)"""
    reward: np.ndarray
    """(n,)"""
    over: np.ndarray
    """(n,) bool: what followed was terminal"""
    after: np.ndarray
    """(n, obs) the state that followed; of no meaning where it was terminal"""
    k_after: np.ndarray
    """(n,) and its fragment"""


class Replay:
    """A ring of rows, one for every time that all worlds have gone through a fragment. size: transitions that
    are drawn from. spare: rows that may be written after a state to go on from was taken, without what was
    drawn from then being lost. path: of the file; None to keep it in memory."""

    def __init__(self, path: Path | None, worlds: int, obs: int, actions: int, size: int, spare: int):
        self.size = max(2, -(-size // worlds))
        shape = (self.size + spare, worlds, obs + actions + 3)
        self._data = np.zeros(shape, np.float32) if path is None else mapped(path, shape)
        self._obs, self._actions = obs, actions
        self.rows = 0
        """written so far, whether they are still there or not"""

    def __len__(self) -> int:
        """Transitions that can be drawn: what followed the newest row is not known yet."""
        return max(0, min(self.rows, self.size) - 1) * self._data.shape[1]

    def add(
        self, x: np.ndarray, k: np.ndarray, action: np.ndarray, reward: np.ndarray, over: np.ndarray
    ) -> None:
        """A row: all worlds went through fragments k (worlds,). Where it was not over, the next row goes on
        from there."""
        row = self._data[self.rows % len(self._data)]
        row[:, : self._obs], row[:, self._obs : -3] = x, action
        row[:, -3], row[:, -2], row[:, -1] = k, reward, over
        self.rows += 1

    def states(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (obs,) and standard deviation of all states in it."""
        x = self._data[: min(self.rows, len(self._data)), :, : self._obs]
        return x.mean(axis=(0, 1), dtype=float), x.std(axis=(0, 1), dtype=float)

    def draw(self, random: np.random.Generator, count: int) -> Transitions:
        """Any of them, drawn with replacement."""
        some = random.integers(0, len(self), count)
        row, world = np.divmod(some, self._data.shape[1])
        row += self.rows - min(self.rows, self.size)
        here, then = (self._data[at % len(self._data), world] for at in (row, row + 1))
        return Transitions(
            x=here[:, : self._obs],
            k=here[:, -3].astype(int),
            action=here[:, self._obs : -3],
            reward=here[:, -2],
            over=here[:, -1] > 0,
            after=then[:, : self._obs],
            k_after=then[:, -3].astype(int),
        )
