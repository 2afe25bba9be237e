"""Joints made rigid: fewer degrees of freedom, the same bodies in the same places."""

import numpy as np
import pytest

from warpdribble.sims import Model, ModelError, Simulation

FINGERS = ("*_mcp", "*_pip", "*_dip")


def test_stiff_hands_leave_51_degrees_of_freedom():
    model, full = Model.load("player", rigid=FINGERS), Model.load("player")
    assert model.nv == 45 + 6 + 6  # and the ball's six
    assert model.body_names == full.body_names
    assert model.tables["link_mass"].sum() == pytest.approx(full.tables["link_mass"].sum())
    np.testing.assert_allclose(Simulation(model, 1).body_q[0], Simulation(full, 1).body_q[0], atol=2e-6)


def test_frozen_in_the_pose_asked_for():
    fist, full = Model.load("player", rigid=FINGERS, pose="fist"), Model.load("player")
    sim = Simulation(full, 1)
    sim.reset(joint_q=full.keyframes["fist"])
    np.testing.assert_allclose(Simulation(fist, 1).body_q[0], sim.body_q[0], atol=2e-6)


def test_it_moves_as_the_full_player_with_stiff_fingers():
    """Same mass matrix over the joints that are left, to the fingers' armature."""
    model, full = Model.load("player", rigid=FINGERS), Model.load("player")
    keep = np.concatenate([np.arange(full.nv)[full.dof_slice(name)] for name in model.joint_names])
    M = Simulation(full, 1).mass_matrix()[0][np.ix_(keep, keep)]
    np.testing.assert_allclose(Simulation(model, 1).mass_matrix()[0], M, atol=2e-5)


def test_coordinates_convert_by_name():
    model, full = Model.load("player", rigid=FINGERS), Model.load("player")
    q = full.keyframes["hold"]
    there = model.convert_q(full, q)
    np.testing.assert_allclose(there, model.keyframes["hold"])
    wanted = q.copy()
    for joint in set(full.joint_names) - set(model.joint_names):
        wanted[full.q_slice(joint)] = full.start_q[full.q_slice(joint)]
    np.testing.assert_allclose(full.convert_q(model, there), wanted)


def test_a_pattern_without_joints_is_refused():
    with pytest.raises(ModelError, match="no joint is named like tail"):
        Model.load("player", rigid=("tail*",))
    with pytest.raises(ModelError, match="cannot be made rigid"):
        Model.load("player", rigid=("root",))
