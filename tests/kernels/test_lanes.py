"""Lanes and threads are ways of running, not part of the result."""

import numpy as np
import pytest

from warpdribble.kernels import program
from warpdribble.sims import Model, Simulation

WORLDS, STEPS = 24, 50


@pytest.fixture(scope="module")
def model():
    return Model.load("player")


def run(model, worlds=WORLDS, steps=STEPS, **how):
    """The player on its feet, targets a little off its pose, each world its own; the ball falls from
    where it bounces within the time."""
    rng = np.random.default_rng(3)
    q = np.tile(model.start_q, (WORLDS, 1))
    q[:, model.q_slice("ball").start + 2] += 0.1 + 0.1 * rng.random(WORLDS)
    target = q.copy()
    hinges = [model.q_slice(n).start for n in model.joint_names if model.joint_type(n) == "hinge"]
    target[:, hinges] += 0.1 * rng.standard_normal((WORLDS, len(hinges)))
    sim = Simulation(model, worlds, **how)
    sim.reset(joint_q=q[:worlds])
    sim.set_targets(target[:worlds])
    sim.step(steps)
    assert (sim.contacts().impulse[:, :, 0] > 0).any(axis=1).all()  # all stand
    return sim.joint_q.copy(), sim.joint_qd.copy()


@pytest.fixture(scope="module")
def scalar(model):
    return run(model, lanes=1, threads=1)


@pytest.mark.parametrize("lanes", [4, 8, 16])
def test_lanes_agree(model, scalar, lanes):
    """A multiplication that one width contracts with an addition and another does not differs by 6e-8;
    50 steps with contacts multiply that by some hundreds."""
    q, qd = run(model, lanes=lanes)
    np.testing.assert_allclose(q, scalar[0], atol=2e-5)
    np.testing.assert_allclose(qd, scalar[1], atol=2e-3)


@pytest.mark.parametrize("lanes", [1, 4, 8, 16])
def test_same_bits_again(model, lanes):
    first, again = run(model, lanes=lanes, threads=2), run(model, lanes=lanes, threads=2)
    assert all(np.array_equal(a, b) for a, b in zip(first, again))


def test_threads_change_nothing(model):
    one, two = (run(model, lanes=4, threads=n) for n in (1, 2))
    assert all(np.array_equal(a, b) for a, b in zip(one, two))


def test_unused_lanes_change_nothing(model):
    few, full = run(model, 5, lanes=16), run(model, 16, lanes=16)
    assert all(np.array_equal(a, b[:5]) for a, b in zip(few, full))


@pytest.mark.parametrize("lanes", [4, 16])
def test_one_launch_is_many_steps(model, monkeypatch, lanes):
    whole, step, calls = run(model, steps=20, lanes=lanes), Simulation.step, []

    def by_one(sim, count=1):
        for _ in range(count):
            calls.append(step(sim))

    monkeypatch.setattr(Simulation, "step", by_one)
    parts = run(model, steps=20, lanes=lanes)
    assert len(calls) == 20
    assert all(np.array_equal(a, b) for a, b in zip(parts, whole))


@pytest.mark.parametrize("lanes", [0, 2, 3, 32, "16"])
def test_refused(lanes):
    with pytest.raises(ValueError, match="lanes must be"):
        program(lanes)
