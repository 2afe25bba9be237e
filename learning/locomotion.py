"""Locomotion as a control problem: what a policy feels, what it changes, and what that costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..sims import Model, Simulation
from ..sims.character import (
    ANGULAR_MOMENTUM,
    COM,
    COM_VELOCITY,
    HEIGHT,
    LEAN,
    MISS,
    SPIN,
    WHOLE,
    Character,
)
from ..sims.simulation import FALL, NONFINITE
from .graph import STEPS, ControlGraph

RIGID = ("*_mcp", "*_pip", "*_dip")
STEERED = ("lower_back", "l_hip", "r_hip", "l_knee", "r_knee")
ARMS = ("l_shoulder", "r_shoulder", "l_elbow", "r_elbow", "l_wrist", "r_wrist")
LEGS_AND_TRUNK = (
    "lower_back", "torso", "neck",
    "l_hip", "l_knee", "l_ankle", "l_toes", "r_hip", "r_knee", "r_ankle", "r_toes",
)  # fmt: skip
ENDS = ("l_foot", "r_foot", "head")
AWAY = (30.0, 30.0)
SCALE = np.array([0.1, 0.1, 0.05] + [0.05] * 3 + [0.3] * 3 + [3.0] * 3 + [0.05] * 6)
FALLEN = 0.3
"""[m] a root this far below the reference's has fallen"""


def player() -> Model:
    return Model.load("player", rigid=RIGID)


class Locomotion:
    """Worlds in which the player follows a control graph."""

    def __init__(self, model: Model, graph: ControlGraph, world_count: int, device="cpu", threads=None):
        self.model, self.graph = model, graph
        self.sim = Simulation(model, world_count, device, threads)
        self.character = Character(
            self.sim, graph.targets, graph.goal_q, graph.goal_qd, ENDS, LEGS_AND_TRUNK, STEERED + ARMS
        )
        self.actions = sum(6 if False else model.dof_slice(n).stop - model.dof_slice(n).start for n in STEERED)
        self.size = len(SCALE)
        self.start, self.goal = self._features(graph.start_q, graph.start_qd), self._features(
            graph.goal_q, graph.goal_qd
        )
        self.offset = np.zeros((world_count, self.character.columns), np.float32)

    def parked(self, q):
        q = np.array(q, float)
        if "ball" in self.model.joint_names:
            q[..., self.model.q_slice("ball")] = [*AWAY, 0.1193, 0.0, 0.0, 0.0, 1.0]
        return q

    def _features(self, q, qd):
        out = []
        n = self.sim.world_count
        for first in range(0, len(q), n):
            part = slice(first, first + n)
            worlds = np.arange(len(q[part]))
            self.sim.reset(worlds, joint_q=self.parked(q[part]), joint_qd=self.still(qd[part]))
            out.append(self.character.sense(np.zeros(n, int))[worlds])
        return np.concatenate(out)

    def still(self, qd):
        qd = np.array(qd, float)
        if "ball" in self.model.joint_names:
            qd[..., self.model.dof_slice("ball")] = 0.0
        return qd

    def state(self, features, k):
        """Reduced state s (n, 18), as deviation from the reference in units of SCALE."""
        s = np.concatenate([features[:, 0:12], features[:, WHOLE : WHOLE + 6]], axis=1)
        r = np.concatenate([self.start[k, 0:12], self.start[k, WHOLE : WHOLE + 6]], axis=1)
        return (s - r) / SCALE

    def advance(self, k, action):
        """Simulate fragment k with the action; features at its end."""
        self.offset[:, : self.actions] = action
        self.character.step(STEPS, k * STEPS, self.offset)
        return self.character.sense(k)

    def cost(self, f, k):
        g = self.goal[k]
        norm = np.linalg.norm
        root = norm(f[:, LEAN] - g[:, LEAN], axis=1) + 0.1 * norm(f[:, SPIN] - g[:, SPIN], axis=1)
        e, eg = (x[:, WHOLE:].reshape(len(x), -1, 3) for x in (f, g))
        ends = np.abs(e[..., 2] - eg[..., 2]).mean(axis=1)
        lever, wanted = (x[:, None, COM][..., :2] - y[..., :2] for x, y in ((f, e), (g, eg)))
        balance = norm(lever - wanted, axis=2).mean(axis=1) / 1.6 + 0.1 * norm(f[:, COM_VELOCITY] - g[:, COM_VELOCITY], axis=1)
        E = 5.0 * f[:, MISS] + 3.0 * root + 30.0 * ends + 10.0 * balance
        return np.where(self.fallen(f, k), np.inf, E)

    def fallen(self, f, k):
        down = (self.sim.status & (FALL | NONFINITE)) > 0
        return down | ~(f[:, 2] > self.goal[k, 2] - FALLEN)
