"""Worlds side by side, the layout that CUDA uses, give what worlds in rows give."""

import numpy as np
import pytest

from warpdribble.sims import Model, Simulation
from warpdribble.sims.worlds.batch import Batch, find_device
from warpdribble.sims.worlds.character import Character


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


def test_a_character_side_by_side(monkeypatch):
    model = Model.load("player", rigid=("*_mcp", "*_pip", "*_dip"), without=("ball",))
    random = np.random.default_rng(0)
    targets = np.tile(model.start_q, (12, 1))
    offset = 0.2 * random.standard_normal((3, 4))
    offset[:, 3] = np.abs(offset[:, 3])
    seen = []
    for columns in (False, True):
        if columns:
            flag = property(lambda self: True, lambda self, value: None)
            monkeypatch.setattr(Batch, "_side_by_side", flag, False)
        sim = Simulation(model, 3, lanes=1)
        who = Character(
            sim, targets, targets, np.zeros((12, model.nv)), ("l_foot",), ("neck",), ("l_hip", "r_knee")
        )
        who.step(5, [0, 3, 7], offset)
        sim.copy_worlds([0, 0, 2])
        who.step(5, [1, 2, 3], offset)
        seen.append(np.concatenate([who.sense([0, 1, 2]), sim.joint_q, sim.joint_qd], axis=1))
    np.testing.assert_array_equal(*seen)


def test_unknown_device_names_those_there_are():
    with pytest.raises(ValueError, match=r"no device 'cuda:99' here; there are: cpu"):
        find_device("cuda:99")
