"""Worlds that differ in everything, so that none can be taken for another."""

import numpy as np

from warpdribble.sims import Simulation
from warpdribble.sims.worlds.state import QUANTITIES

WORLDS = 37  # three groups of 16, the last one not full


def carried(sim):
    """All that a step hands to the next, by public name, a row per world."""
    return {name: sim._read(getattr(sim._world, inside)) for name, inside in QUANTITIES.items()}


def spare(sim):
    """joint_q of the unused worlds of the last group."""
    return sim._rows(sim._world.q)[..., 0, :].transpose(0, 2, 1).reshape(-1, sim.model.nq)[sim.world_count :]


def varied(model, lanes=None, threads=None):
    """Worlds that differ in state, contacts, status, targets, mass and force."""
    random = np.random.default_rng(2)
    sim = Simulation(model, WORLDS, lanes=lanes, threads=threads)
    q = np.tile(model.keyframes["hold"], (WORLDS, 1))
    q[:, 2] += random.uniform(0, 0.02, WORLDS)
    q[::5, 2] -= 0.5  # these fall
    q[3, model.q_slice("l_elbow")] = 1.0
    targets = q.copy()
    targets[:, model.q_slice("r_elbow")] += random.uniform(-0.5, 0.5, (WORLDS, 1))
    sim.set_targets(targets)
    sim.set_mass("ball", random.uniform(0.4, 0.8, WORLDS))
    sim.apply_force("torso", random.uniform(-20, 20, (WORLDS, 3)))
    qd = np.zeros((WORLDS, model.nv))
    qd[7, model.dof_slice("l_elbow")] = 1e4  # faster than joints may turn
    sim.reset(joint_q=q, joint_qd=qd)
    sim.step(10)
    sim._write("q", np.array([11]), np.array([np.nan]), column=0)
    sim.step(1)
    return sim
