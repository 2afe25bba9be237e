"""One player under a policy, recorded at every time step beside its reference."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...sims.reference.reference import over_ground, resample_q
from ...sims.worlds.simulation import NONFINITE
from ..graph import STEPS, ControlGraph
from ..policies.linear import LinearPolicy
from ..tasks.disturbance import CALM, Disturbance
from ..tasks.locomotion import Locomotion
from .steer import Steered
from .trials import States, composed, planar, relative


@dataclass(frozen=True)
class Recording:
    """A row per time step, the start included."""

    joint_q: np.ndarray
    """(frames, nq) [m, rad, -]"""
    body_q: np.ndarray
    """(frames, nbody, 7) [m, -]"""
    reference_q: np.ndarray
    """(frames, nq) of the reference, which walks on from where the player began"""
    wall_time: float
    """[s] spent in stepping"""


def record(
    task: Locomotion,
    policy: LinearPolicy,
    states: States,
    seconds: float,
    seed: int = 0,
    disturbance: Disturbance = CALM,
    progress: Callable[[int], None] | None = None,
) -> Recording:
    """Let world 0 of the task follow the policy for whole fragments of about `seconds`, from one of the
    states. progress: called with the fragments done. Raises FloatingPointError when the state becomes
    non-finite."""
    random = np.random.default_rng(seed)
    graph, sim, model = task.graph, task.sim, task.model
    start = states.draw(sim.world_count, random)
    task.reset(start.k, start.joint_q, start.joint_qd)
    steered = Steered(task, policy, start.k, random, disturbance)
    joint_q, body_q, wanted = [sim.joint_q[0]], [sim.body_q[0]], []
    at, wall_time = planar(start.joint_q[:1]), 0.0
    for done in range(max(1, round(seconds / graph.period))):
        for _ in range(STEPS):
            began = time.perf_counter()
            steered.step()
            joint_q.append(sim.joint_q[0])
            wall_time += time.perf_counter() - began
            body_q.append(sim.body_q[0])
        rows, at = _reference(model, graph, steered.k[0], at)
        wanted.append(rows[:-1])
        if progress:
            progress(done + 1)
    task.calm()
    if sim.status[0] & NONFINITE:
        raise FloatingPointError("the simulation broke down (non-finite state); try another --seed")
    return Recording(np.array(joint_q), np.array(body_q), np.concatenate([*wanted, rows[-1:]]), wall_time)


def _reference(model, graph: ControlGraph, k: int, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows (STEPS + 1, nq) of fragment k begun from the planar pose `at` (1, 3), and where it leads."""
    ends = np.stack([graph.start_q[k], graph.goal_q[k]])
    rows = resample_q(model, ends, np.linspace(0.0, 1.0, STEPS + 1))
    own = planar(ends)
    turn = at[0, 2] - own[0, 2]
    rows[:, :7] = over_ground(rows[:, :7], own[0, :2], at[0, :2], turn)
    return rows, composed(at, relative(own[:1], own[1:]))
