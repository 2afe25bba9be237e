"""How well inferred contacts agree with recorded ones: precision and recall of frames, timing of edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation

from ..signals import runs

TOLERANCE = 0.05
"""[s] A frame of contact is right when the other side has contact this near."""
REACH = 0.3
"""[s] Edges farther apart than this do not belong together."""


@dataclass(frozen=True)
class ContactScore:
    """Counts, so that scores of clips add up."""

    inferred: int
    """Frames of inferred contact."""
    right: int
    """Those of them near recorded contact."""
    recorded: int
    """Frames of recorded contact."""
    found: int
    """Those of them near inferred contact."""
    timing: tuple[float, ...]
    """[s] inferred less recorded, for every edge of a recorded contact that has an inferred one near."""
    missed: int
    """Edges of recorded contacts that have none."""

    @property
    def precision(self) -> float:
        """1 when nothing was inferred: nothing was wrong."""
        return self.right / self.inferred if self.inferred else 1.0

    @property
    def recall(self) -> float:
        """1 when nothing was recorded: nothing was missed."""
        return self.found / self.recorded if self.recorded else 1.0

    def __add__(self, other: ContactScore) -> ContactScore:
        return ContactScore(
            self.inferred + other.inferred,
            self.right + other.right,
            self.recorded + other.recorded,
            self.found + other.found,
            self.timing + other.timing,
            self.missed + other.missed,
        )


def score_contacts(inferred: np.ndarray, recorded: np.ndarray, timestep: float) -> ContactScore:
    """Compare two (frames,) bool arrays, a row per `timestep` [s]. Edges at the clip's ends do not count."""
    rows = round(TOLERANCE / timestep)
    timing, missed = [], 0
    for end in (0, 1):
        own = _edges(inferred, end)
        for edge in _edges(recorded, end):
            near = [e for e in own if abs(e - edge) * timestep <= REACH]
            if near:
                timing.append((min(near, key=lambda e: abs(e - edge)) - edge) * timestep)
            else:
                missed += 1
    return ContactScore(
        int(inferred.sum()),
        int((inferred & _near(recorded, rows)).sum()),
        int(recorded.sum()),
        int((recorded & _near(inferred, rows)).sum()),
        tuple(timing),
        missed,
    )


def _edges(touch: np.ndarray, end: int) -> list[int]:
    """Rows at which contacts begin (end 0) or finish (end 1), without those at the clip's ends."""
    return [pair[end] for pair in runs(touch) if 0 < pair[end] < len(touch) - 1]


def _near(touch: np.ndarray, rows: int) -> np.ndarray:
    return binary_dilation(touch, iterations=rows) if rows else touch
