"""The player stands: both feet, root free, drives at the start pose."""

import numpy as np
import pytest

from tests.reference.scenes import record
from warpdribble.sims import Model, Simulation

SETTLED, END = 300, 1000


@pytest.fixture(scope="module")
def stood():
    """10 s in four worlds, by step: body poses, contact impulses of the player's slots, status."""
    model = Model.load("player")
    sim = Simulation(model, 4)
    ball = model.body("ball")
    shapes = {s.name for s in model.shapes if s.body == ball}

    def see(sim):
        touch = sim.contacts()
        own = [k for k, pair in enumerate(touch.shapes) if not shapes & set(pair)]
        return sim.body_q.copy(), touch.impulse[:, own].copy(), sim.status.copy()

    body_q, impulse, status = zip(*[see(s) for s in _steps(sim, END)])
    return model, np.array(body_q), np.array(impulse), np.array(status)


def _steps(sim, count):
    for _ in range(count):
        sim.step()
        yield sim


def test_stays_up(stood):
    model, body_q, _, status = stood
    assert not status.any()
    head = body_q[:, :, model.body("head"), 2]
    assert np.abs(head - head[0]).max() < 0.02
    tilt = body_q[-1, :, model.body("pelvis"), 3:6]
    assert np.abs(tilt).max() < 0.02


def test_feet_do_not_slide(stood):
    """Each foot's corners move less than 1 mm/s in any half second once settled."""
    model, body_q, _, _ = stood
    late = body_q[SETTLED:]
    for name in ("l_foot", "r_foot", "l_toes", "r_toes"):
        x = late[:, :, model.body(name), :2]
        assert (np.linalg.norm(x[50:] - x[:-50], axis=-1) / 0.5).max() <= 1e-3
        turn = late[:, :, model.body(name), 3:]
        assert np.abs(turn - turn[0]).max() <= 1e-3  # nor rock


def test_ground_carries_the_weight(stood):
    model, _, impulse, _ = stood
    weight = (model.body_mass.sum() - model.body_mass[model.body("ball")]) * 9.81
    force = impulse[SETTLED:, :, :, 0].sum(axis=2) / model.timestep
    np.testing.assert_allclose(force, weight, rtol=5e-3)  # at every step, so it does not jitter either
    sideways = np.linalg.norm(impulse[SETTLED:, :, :, 1:].sum(axis=2), axis=-1) / model.timestep
    assert sideways.max() <= 5e-3 * weight


def test_worlds_are_alike(stood):
    _, body_q, _, _ = stood
    assert np.array_equal(body_q[-1], np.broadcast_to(body_q[-1, :1], body_q[-1].shape))


def test_pushed_over_it_falls():
    """The status tells a fall, and only of the world that was pushed."""
    model = Model.load("player")
    sim = Simulation(model, 3)
    sim.apply_force("torso", [600.0, 0.0, 0.0], [1])
    record(sim, 1)
    sim.step(150)
    assert list(sim.status & 2) == [0, 2, 0]
    sim.reset([1])
    assert not sim.status.any()


def test_holds_the_ball():
    """A ball in the upturned hand for 5 s: it stays there and does not jitter (RMS under 0.5 m/s^2)."""
    model = Model.load("player")
    hold = model.keyframes["hold"]
    sim = Simulation(model, 1)
    sim.reset(joint_q=hold)
    sim.set_targets(hold)
    sim.step(200)
    ball = model.body("ball")
    v = record(sim, 500, lambda sim: sim.body_qd[0, ball, :3].copy())
    jitter = np.sqrt(np.mean(np.sum((np.diff(v, axis=0) / model.timestep) ** 2, axis=1)))
    print(f"RMS acceleration of a held ball {jitter:.4f} m/s^2")
    assert jitter <= 0.5
    assert not sim.status.any()
    assert sim.body_q[0, ball, 2] > 1.0
