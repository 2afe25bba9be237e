"""The state as torch tensors: the same numbers, the same memory. `test_ports` has what is written to them."""

import numpy as np
import pytest

from warpdribble.sims import Simulation
from warpdribble.sims.worlds.tensors import as_array

torch = pytest.importorskip("torch", reason="torch is an optional extra: learn")


@pytest.mark.parametrize("lanes", [1, 16])
def test_tensors_show_the_state(player, lanes):
    sim = Simulation(player, 3, lanes=lanes)
    sim.step(2)
    assert sim.torch.joint_q.shape == (3, sim.model.nq)
    np.testing.assert_array_equal(sim.torch.joint_q.numpy(), sim.joint_q)
    np.testing.assert_array_equal(sim.torch.joint_qd.numpy(), sim.joint_qd)
    np.testing.assert_array_equal(sim.torch.joint_target_q.numpy(), sim._read(sim._world.target))
    assert sim.torch.joint_f.shape == (3, sim.model.nv) and not sim.torch.joint_f.any()
    for name in ("joint_q", "joint_qd", "joint_target_q", "joint_f"):
        tensor = getattr(sim.torch, name)
        assert tensor.dtype == torch.float32 and not tensor.requires_grad


@pytest.mark.parametrize("lanes", [1, 16])
def test_memory_is_shared(player, lanes):
    sim = Simulation(player, 2, lanes=lanes)
    state = sim.torch.joint_q
    before = state.clone()
    state[1, 0] = 0.25
    assert sim.joint_q[1, 0] == np.float32(0.25)
    sim.step(1)
    assert not torch.equal(state, before)
    np.testing.assert_array_equal(state.numpy(), sim.joint_q)


@pytest.mark.parametrize("lanes", [1, 16])
def test_operations_in_place(player, lanes):
    """Whole tensors, columns and masks: all of it reaches the simulation, as do views of views."""
    sim = Simulation(player, 19, lanes=lanes)
    q, qd = sim.torch.joint_q, sim.torch.joint_qd
    start = q.clone()
    qd.normal_(generator=torch.Generator().manual_seed(0)).clamp_(-1.0, 1.0)
    q[:, 2] += 1.0
    q[torch.arange(19) % 2 == 0, 0] = 3.0
    q[18][1] = -2.0
    expected = start.clone()
    expected[:, 2] += 1.0
    expected[::2, 0] = 3.0
    expected[18, 1] = -2.0
    np.testing.assert_array_equal(sim.joint_q, expected.numpy())
    np.testing.assert_array_equal(sim.joint_qd, qd.numpy())
    assert 0.3 < np.std(sim.joint_qd) < 1.0


def test_targets_from_a_tensor(player):
    sim = Simulation(player, 2)
    target = torch.tensor(player.start_q, dtype=torch.float64, requires_grad=True)
    sim.set_targets(target)
    np.testing.assert_allclose(sim.torch.joint_target_q[1], player.start_q, atol=1e-6)


def test_arrays_from_tensors():
    """Of any type, with a gradient or not; lists and arrays, too."""
    for values in (torch.tensor([1.5, 2.0], requires_grad=True), torch.tensor([1.5, 2.0]).double(), [1.5, 2]):
        got = as_array(values)
        assert got.dtype == np.float32
        np.testing.assert_array_equal(got, [1.5, 2.0])
