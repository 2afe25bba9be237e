"""Balls that bounce and weigh otherwise than the model's, one for each world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arms import RESTITUTION, Arms


@dataclass(frozen=True)
class Balls:
    """How far balls differ from the model's, evenly up to so much."""

    restitution: float = 0.0
    """[-] of ball and ground"""
    mass: float = 0.0
    """[-] share of the model's"""

    def put(self, task: Arms, share: np.ndarray | float, drawn: np.ndarray) -> None:
        """Give each world of a task its ball. share: of the differences, from 0 to 1; (2, 2) for less and
        more restitution, less and more mass. drawn: (worlds, 2) from -1 to 1, where in its range each ball's
        restitution and mass are."""
        ball = task.model.roles.one("ball")
        usual = float(task.model.body_mass[task.model.body(ball)])
        less, more = np.broadcast_to(share, (2, 2)).T
        off = np.where(drawn < 0.0, less, more) * drawn * [self.restitution, self.mass]
        if self.restitution:
            task.sim.set_contact(ball, "ground", restitution=np.maximum(0.0, RESTITUTION + off[:, 0]))
        if self.mass:
            task.sim.set_mass(ball, usual * (1.0 + off[:, 1]))


NEAR, LEAST = 0.8, 0.1
"""Of the way to an end of a range: balls from there on tell whether it may go farther. The least share of a
range."""


def widened(share: np.ndarray, drawn: np.ndarray, lost: np.ndarray, few: float, by: float) -> np.ndarray:
    """Shares (2, 2) of the ranges, as `Balls.put` takes them, after some play with balls `drawn`: each end
    goes out by the factor `by` where balls near it were lost in fewer than `few` of the fragments, and back
    where it was more than twice that (automatic domain randomisation, Akkaya et al. 2019). lost: (worlds,)
    share of the fragments."""
    near = np.stack([-drawn, drawn], axis=2) > NEAR  # (worlds, kinds, ends)
    counts = near.sum(axis=0)
    often = np.einsum("w,wke->ke", lost, near) / np.maximum(counts, 1)
    factor = np.where(often < few, by, np.where(often > 2.0 * few, 1.0 / by, 1.0))
    return np.clip(share * np.where(counts > 0, factor, 1.0), LEAST, 1.0)
