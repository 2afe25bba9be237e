"""Worlds that go wrong do so alone: flagged, reset, and their neighbours never notice."""

import numpy as np
import pytest

from tests.reference.scenes import ball, scene, start
from warpdribble.sims import Model, Simulation
from warpdribble.sims.worlds.simulation import BAD_CONTACT, FALL, FAR, NONFINITE

SICK = 3
OTHERS = [k for k in range(8) if k != SICK]


@pytest.fixture(scope="module")
def model():
    return Model.load("player")


def standing(model, lanes):
    """Eight worlds, each with its own targets, feet down."""
    sim = Simulation(model, 8, lanes=lanes, threads=1)
    rng = np.random.default_rng(1)
    target = np.tile(model.start_q, (8, 1))
    hinges = [model.q_slice(n).start for n in model.joint_names if model.joint_type(n) == "hinge"]
    target[:, hinges] += 0.1 * rng.standard_normal((8, len(hinges)))
    sim.set_targets(target)
    sim.step(20)
    return sim


def nan_velocity(sim):
    joint = sim.model.dof_slice("l_elbow").start
    sim._write("qd", np.array([SICK]), np.array([np.nan]), column=joint)


def nan_position(sim):
    sim._write("q", np.array([SICK]), np.array([np.nan]), column=0)


def absurd_force(sim):
    sim.apply_force("torso", [1e30, 0.0, 1e30], [SICK])


def infinite_velocity(sim):
    sim._write("qd", np.array([SICK]), np.array([np.inf]), column=sim.model.dof_slice("ball").start)


@pytest.mark.parametrize("lanes", [1, 4, 8])
@pytest.mark.parametrize("harm", [nan_velocity, nan_position, absurd_force, infinite_velocity])
def test_nonfinite_world_is_flagged_and_reset_alone(model, harm, lanes):
    well, ill = standing(model, lanes), standing(model, lanes)
    if harm is absurd_force:
        well.apply_force("torso", [0.0, 0.0, 0.0])  # the same code path for forces
    harm(ill)
    for _ in range(10):
        well.step()
        ill.step()
        assert np.array_equal(ill.joint_q[OTHERS], well.joint_q[OTHERS])
        assert np.array_equal(ill.joint_qd[OTHERS], well.joint_qd[OTHERS])
    assert ill.status[SICK] & NONFINITE
    assert not ill.status[OTHERS].any()
    # the flag stays until the reset
    ill.step(5)
    well.step(5)
    assert ill.status[SICK] & NONFINITE

    ill.apply_force("torso", [0.0, 0.0, 0.0], [SICK])
    ill.reset(worlds=[SICK])
    well.reset(worlds=[SICK])
    assert not ill.status.any()
    for _ in range(30):
        well.step()
        ill.step()
    assert np.isfinite(ill.joint_q).all() and not ill.status.any()
    for name in ("joint_q", "joint_qd", "body_q", "body_qd"):
        assert np.array_equal(getattr(ill, name), getattr(well, name))
    assert np.array_equal(ill.contacts().impulse, well.contacts().impulse)


def test_observations_of_a_nonfinite_world(model):
    """Reading one does not raise, nor spoil what is read of the others."""
    sim = standing(model, 8)
    expected = sim.body_q.copy(), sim.mass_matrix()
    nan_position(sim)
    got = sim.body_q, sim.mass_matrix()
    for a, b in zip(got, expected):
        assert np.array_equal(a[OTHERS], b[OTHERS])
    assert np.isnan(sim.joint_q[SICK]).any()


def test_fall_and_bad_contact(model):
    """A ball on the head is a bad contact; lying on the ground is a fall; both show until the reset."""
    sim = Simulation(model, 3)
    q = np.tile(model.start_q, (3, 1))
    ball = model.q_slice("ball").start
    q[1, ball : ball + 3] = 0.0, 0.0, 2.2
    root = model.q_slice("root").start
    q[2, root : root + 7] = [0, 0, 0.3, 0, np.sqrt(0.5), 0, np.sqrt(0.5)]
    q[2, ball] = -2.0
    sim.reset(joint_q=q)
    sim.step(50)
    assert list(sim.status) == [0, BAD_CONTACT, FALL]
    sim.reset([1, 2])
    assert not sim.status.any()
    sim.step(20)
    assert not sim.status.any()


def test_ball_in_a_hand_is_no_bad_contact(model):
    sim = Simulation(model, 1)
    sim.reset(joint_q=model.keyframes["hold"])
    sim.set_targets(model.keyframes["hold"])
    sim.step(100)
    touch = sim.contacts()
    pushed = {pair for pair, n in zip(touch.shapes, touch.impulse[0, :, 0]) if n > 0}
    assert any("ball" in pair and "r_hand" in pair for pair in pushed)
    assert not sim.status.any()


def test_reset_some(model):
    """reset(worlds) sets the state asked for, clears history there, and leaves the others' bits."""
    sim = standing(model, 8)
    before = sim.joint_q.copy()
    q = np.tile(model.start_q, (2, 1))
    q[:, 0] = [5.0, 6.0]
    sim.reset(worlds=[6, 2], joint_q=q)
    after = sim.joint_q
    keep = [0, 1, 3, 4, 5, 7]
    assert np.array_equal(after[keep], before[keep])
    assert after[6, 0] == 5.0 and after[2, 0] == 6.0
    assert not sim.joint_qd[[2, 6]].any()
    mask = np.zeros(8, bool)
    mask[4] = True
    sim.reset(worlds=mask)
    np.testing.assert_allclose(sim.joint_q[4], model.start_q, atol=1e-6)  # quaternions are renewed
    assert not sim.contacts().impulse[[2, 4, 6]].any()


def test_reset_clears_the_bounce_impulse(model):
    """contacts() after a reset shows nothing of the step before it."""
    sim = Simulation(model, 1)
    q = model.start_q.copy()
    q[model.q_slice("ball").start + 2] += 0.02
    sim.reset(joint_q=q)
    for _ in range(20):
        sim.step()
        slots = [k for k, pair in enumerate(sim.contacts().shapes) if set(pair) == {"ground", "ball"}]
        if sim.contacts().impulse[0, slots, 0] > 0.2:
            break
    else:
        pytest.fail("no bounce")
    sim.reset()
    assert not sim.contacts().impulse.any()


def test_too_far_for_slow_motion():
    """Beyond 2^24 h 1 cm/s, 1.7 km at 10 ms; nearer, a body at 1 cm/s goes on."""
    model = scene(ball(), 0.01, gravity="0 0 0")
    away = np.array([0.0, -1000.0, 1600.0, 1700.0, -2100.0])
    sim = Simulation(model, len(away))
    q = start(model, len(away))
    for axis in range(3):
        q[:, :3] = 0.0
        q[:, axis] = away
        qd = np.zeros(6)
        qd[axis] = 0.01
        sim.reset(joint_q=q, joint_qd=qd)
        assert not sim.status.any()
        sim.step(100)
        assert sim.status.tolist() == [0, 0, 0, FAR, FAR]
        assert ((sim.joint_q[:3, axis] - away[:3]) > 0.007).all()
        sim.step(1)
        assert sim.joint_q[4, axis] == away[4]  # as it says
