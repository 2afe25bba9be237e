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

    def put(self, task: Arms, share: float, drawn: np.ndarray) -> None:
        """Give each world of a task its ball. share: of the differences, from 0 to 1; drawn: (worlds, 2) from
        -1 to 1, where in its range each ball's restitution and mass are."""
        ball = task.model.roles.one("ball")
        usual = float(task.model.body_mass[task.model.body(ball)])
        off = share * drawn * [self.restitution, self.mass]
        if self.restitution:
            task.sim.set_contact(ball, "ground", restitution=np.maximum(0.0, RESTITUTION + off[:, 0]))
        if self.mass:
            task.sim.set_mass(ball, usual * (1.0 + off[:, 1]))
