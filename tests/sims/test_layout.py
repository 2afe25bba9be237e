"""Worlds side by side, the layout that CUDA uses, give what worlds in rows give."""

import numpy as np
import pytest

from warpdribble.sims import Model, Simulation
from warpdribble.sims.batch import Batch, find_device


def test_side_by_side_gives_the_same_bits(monkeypatch):
    model = Model.load("player")
    rows = Simulation(model, 3, lanes=1)
    monkeypatch.setattr(Batch, "_side_by_side", property(lambda self: True, lambda self, value: None), False)
    columns = Simulation(model, 3, lanes=1)
    assert columns._world.q.strides[0] < columns._world.q.strides[1]
    q = np.tile(model.keyframes["hold"], (3, 1))
    q[1, 2] += 0.01
    for sim in (rows, columns):
        sim.reset(joint_q=q)
        sim.set_targets(q[0])
        sim.set_mass("ball", [0.5, 0.6, 0.7])
        sim.set_contact("ball", "ground", restitution=0.7, worlds=[2])
        sim.apply_force("torso", [20.0, 0.0, 0.0], worlds=[0])
        sim.step(20)
        sim.reset(worlds=[2], joint_q=q[0])
        sim.step(20)
    np.testing.assert_array_equal(rows.joint_q, columns.joint_q)
    np.testing.assert_array_equal(rows.joint_qd, columns.joint_qd)
    np.testing.assert_array_equal(rows.contacts().impulse, columns.contacts().impulse)
    np.testing.assert_array_equal(rows.mass_matrix(), columns.mass_matrix())


def test_unknown_device_names_those_there_are():
    with pytest.raises(ValueError, match=r"no device 'cuda:99' here; there are: cpu"):
        find_device("cuda:99")
