"""The state as torch tensors: the same numbers, the same memory where that is promised."""

import numpy as np
import pytest
import torch

from warpdribble.sims import Model, Simulation


@pytest.mark.parametrize("lanes", [1, 16])
def test_tensors_show_the_state(lanes):
    sim = Simulation(Model.load("player"), 3, lanes=lanes)
    sim.step(2)
    assert sim.torch.joint_q.shape == (3, sim.model.nq)
    np.testing.assert_array_equal(sim.torch.joint_q.numpy(), sim.joint_q)
    np.testing.assert_array_equal(sim.torch.joint_qd.numpy(), sim.joint_qd)


def test_one_lane_shares_memory():
    sim = Simulation(Model.load("player"), 2, lanes=1)
    state = sim.torch.joint_q
    before = state.clone()
    state[1, 0] = 0.25
    assert sim.joint_q[1, 0] == np.float32(0.25)
    sim.step(1)
    assert not torch.equal(state, before)


def test_targets_from_a_tensor():
    model = Model.load("player")
    sim = Simulation(model, 2)
    target = torch.tensor(model.start_q, dtype=torch.float64, requires_grad=True)
    sim.set_targets(target)
    np.testing.assert_allclose(sim.torch.joint_target_q[1], model.start_q, atol=1e-6)
