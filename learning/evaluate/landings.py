"""How a learned player comes down on its feet: ground forces and touchdowns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..choose import Ahead
from ..rollout import Controller, Rollout
from ..starts import Starts
from ..tasks.follow import Follow

PRESSED = 0.05
"""[body weights] Below this a foot is in the air."""
SETTLE = 2.0
"""[s] from the start on that do not count."""


@dataclass(frozen=True)
class Landings:
    """Of one player, step by step."""

    force: np.ndarray
    """(steps, feet) [body weights] vertical force of the ground on each foot, left before right"""
    timestep: float
    """[s]"""

    @property
    def peak(self) -> float:
        """[body weights] 99th percentile of the force on all."""
        return float(np.quantile(self.force.sum(axis=1), 0.99))

    @property
    def touchdowns(self) -> np.ndarray:
        """(feet,) how often each comes down."""
        down = self.force > PRESSED
        return np.asarray(np.sum(down[1:] & ~down[:-1], axis=0))


def land(task: Follow, controller: Controller, starts: Starts, fragments: int) -> Landings:
    """Let the first world of a task go through so many fragments, from the first of `starts`, and weigh
    it."""
    model, sim = task.model, task.sim
    sides = [model.descendants(model.body(foot)) for foot in model.roles.feet]
    begin = Starts(*(np.repeat(part[:1], task.worlds, axis=0) for part in vars(starts).values()))
    of = {shape.name: shape.body for shape in model.shapes}
    slots = [{of[a], of[b]} for a, b in sim.contacts().shapes]
    mine = np.array([[bool(bodies & set(side)) for bodies in slots] for side in sides])
    weight = model.body_mass.sum() * np.linalg.norm(model.gravity) * model.timestep
    forces = []
    for _ in Rollout(task, controller, Ahead(), begin).steps(fragments):
        seen = sim.contacts()
        forces.append(mine @ (seen.impulse[0, :, 0] * seen.normal[0, :, 2] / weight))
    settled = int(SETTLE / model.timestep)
    return Landings(np.array(forces)[settled:], model.timestep)
