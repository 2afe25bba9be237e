"""Locomotion as a control problem: what a policy feels, what it changes, and what that costs (P1 3.3, with
the state and the cost of Liu et al. 2016)."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import warp as wp

from ...sims import Model, Simulation
from ...sims.worlds.character import (
    ANGLE,
    ANGULAR_MOMENTUM,
    COM,
    COM_VELOCITY,
    ENDS,
    HEIGHT,
    LEAN,
    RATE,
    SPIN,
    Character,
)
from ...sims.worlds.simulation import FALL, NONFINITE
from ..graph import STEPS, ControlGraph
from ..policies.linear import LinearPolicy
from .disturbance import HANDS, PUSHED

FINGERS = ("*_mcp", "*_pip", "*_dip")
STEERED = ("lower_back", "l_hip", "r_hip", "l_knee", "r_knee")
"""Joints that a policy offsets: 11 numbers."""
ARMS = ("l_shoulder", "r_shoulder", "l_elbow", "r_elbow", "l_wrist", "r_wrist")
LEGS = ("l_hip", "l_knee", "l_ankle", "l_toes", "r_hip", "r_knee", "r_ankle", "r_toes")
JUDGED = ("lower_back", "torso", "neck", *LEGS)
"""Joints in the pose cost; the arms belong to another policy."""
FELT = ("l_foot", "r_foot", "head")
"""Ends: the feet are in the state, all are in the cost."""
STATE = (
    (LEAN, 0.1),
    (HEIGHT, 0.05),
    (COM, 0.05),
    (COM_VELOCITY, 0.3),
    (ANGULAR_MOMENTUM, 3.0),
    (slice(ENDS, ENDS + 6), 0.05),
)
"""Parts of the 18-number reduced state, and the deviation that counts as one."""
FALLEN = 0.3
"""[m] A root this far below, or above, the reference's is out of control."""
HEIGHT_UNIT = 1.6
"""[m] of the balance cost"""


@dataclass(frozen=True)
class CostWeights:
    """Weights of the cost's terms."""

    pose: float = 5.0
    """of the mean over the joints of angle [rad] + 0.1 rate [rad/s]"""
    root: float = 3.0
    """of the root's lean [-] + 0.1 angular velocity [rad/s]"""
    ends: float = 30.0
    """of the mean height of feet and head [m]"""
    balance: float = 10.0
    """of where the centre of mass is over feet and head [1.6 m]"""
    travel: float = 3.0
    """of its velocity [m/s]"""


WEIGHTS = CostWeights()


def locomotion_model() -> Model:
    """The player with stiff hands and without the ball: 45 + 6 degrees of freedom (P1 3.3)."""
    return Model.load("player", rigid=FINGERS, without=("ball",))


class Locomotion:
    """Worlds in which the player follows a control graph, each from fragment to fragment on its own."""

    def __init__(
        self,
        model: Model,
        graph: ControlGraph,
        world_count: int,
        device: str = "cpu",
        threads: int | None = None,
        weights: CostWeights = WEIGHTS,
    ):
        self.model, self.graph, self.weights = model, graph, weights
        self.sim = Simulation(model, world_count, device, threads)
        self.character = Character(
            self.sim, graph.targets, graph.goal_q, graph.goal_qd, FELT, JUDGED, STEERED + ARMS
        )
        self.action_size = sum(dof.stop - dof.start for dof in map(model.dof_slice, STEERED))
        self.arm_columns = self.character.columns - self.action_size
        self.offset = np.zeros((world_count, self.character.columns), np.float32)
        self.scale = np.concatenate([np.full(part.stop - part.start, unit) for part, unit in STATE])
        self.start = self._reference(graph.start_q, graph.start_qd)
        self.goal = self._reference(graph.goal_q, graph.goal_qd)
        self.samples = 0
        self.simulating = 0.0

    def open_loop(self, sigma: float = 0.0) -> LinearPolicy:
        """The policy that changes nothing, whatever the state; sigma: exploration about it [rad]."""
        return LinearPolicy.zero(self.graph.count, self.action_size, len(self.scale), sigma)

    def _reference(self, joint_q, joint_qd) -> np.ndarray:
        """What the character feels in given states."""
        count, felt = self.sim.world_count, []
        for first in range(0, len(joint_q), count):
            q, qd = (x[first : first + count] for x in (joint_q, joint_qd))
            worlds = np.arange(len(q))
            self.sim.reset(worlds, q, qd)
            felt.append(self.character.sense(0)[worlds])
        return np.concatenate(felt)

    def reset(self, k, joint_q, joint_qd) -> np.ndarray:
        """Put every world into a state at the start of its fragment k (world_count,); what is felt there,
        `Character.sense`."""
        self.sim.reset(joint_q=joint_q, joint_qd=joint_qd)
        return self.character.sense(k)

    def calm(self) -> None:
        """End all disturbances."""
        self.offset[:, self.action_size :] = 0.0
        if self.sim.forced:
            for body in (PUSHED, *HANDS):
                self.sim.apply_force(body, np.zeros(3))

    def state(self, felt: np.ndarray, k) -> np.ndarray:
        """Reduced state s (world_count, 18): the deviation from the reference at the start of fragments k."""
        reference = self.start[k]
        parts = [felt[:, part] - reference[:, part] for part, _ in STATE]
        return np.concatenate(parts, axis=1) / self.scale

    def advance(self, k, action) -> np.ndarray:
        """Simulate fragments k (world_count,) under actions (world_count, actions) [rad]; what is felt at
        their end."""
        began = time.perf_counter()
        self.offset[:, : self.action_size] = action
        self.character.step(STEPS, k * STEPS, self.offset)
        wp.synchronize_device(self.sim.device)
        self.simulating += time.perf_counter() - began
        self.samples += len(self.offset)
        return self.character.sense(k)

    def cost(self, felt: np.ndarray, k) -> np.ndarray:
        """E (world_count,) at the end of fragments k; infinite for who has fallen."""
        w, goal = self.weights, self.goal[k]

        def off(part) -> np.ndarray:
            return np.linalg.norm(felt[:, part] - goal[:, part], axis=-1)

        ends, wanted = (x[:, ENDS:].reshape(len(x), -1, 3) for x in (felt, goal))
        height = np.abs(ends[..., 2] - wanted[..., 2]).mean(axis=1)
        over = felt[:, None, COM] - ends - (goal[:, None, COM] - wanted)
        over = np.linalg.norm(over[..., :2], axis=-1).mean(axis=1)
        E = w.pose * (felt[:, ANGLE] + 0.1 * felt[:, RATE])
        E = E + w.root * (off(LEAN) + 0.1 * off(SPIN))
        E = E + w.ends * height
        E = E + w.balance * over / HEIGHT_UNIT
        E = E + w.travel * off(COM_VELOCITY)
        return np.where(self.fallen(felt, k), np.inf, E)

    def fallen(self, felt: np.ndarray, k) -> np.ndarray:
        """Who (world_count,) lies on the ground or is about to; or has left it, flung by something absurd."""
        off = felt[:, HEIGHT][:, 0] - self.goal[k, HEIGHT][:, 0]
        return (self.sim.status & (FALL | NONFINITE) != 0) | ~(np.abs(off) < FALLEN)
