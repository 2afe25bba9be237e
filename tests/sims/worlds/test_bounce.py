"""A ball over the ground against formulas: apexes, energy, spin, rest."""

import numpy as np
import pytest

from tests.reference.scenes import GRAVITY, MASS, RADIUS, SHELL, ball, ground, record, scene, start
from warpdribble.sims import Simulation

H = 0.01


@pytest.fixture(scope="module")
def model():
    return scene(ground() + ball(), H)


def drop(model, count, restitution, gap, friction=0.0, vx=0.0, spin_y=0.0):
    """`count` balls `gap` above the ground."""
    sim = Simulation(model, count)
    q = start(model, count)
    q[:, 2] = RADIUS + gap
    qd = np.zeros((count, 6))
    qd[:, 0], qd[:, 4] = vx, spin_y
    sim.reset(joint_q=q, joint_qd=qd)
    every = np.ones(count)
    sim.set_contact("ball", "ground", restitution * every, friction * every)
    return sim


def apexes(gap, count):
    """The first heights [m] of a sampled bouncing ball: the vertex of the parabola through the highest
    sample of each arc and its neighbours."""
    out = []
    for k in range(1, len(gap) - 1):
        a, b, c = gap[k - 1 : k + 2]
        if a < b >= c and b > 0.01:
            out.append(b + (a - c) ** 2 / (8 * (2 * b - a - c)))
    return np.array(out[:count])


@pytest.mark.parametrize("restitution", [0.6, 0.8, 0.9])
def test_apexes(model, restitution):
    """Within 0.1 % of e^2n h over four bounces, whatever the phase of the impact within a step."""
    heights = np.linspace(0.9, 1.9, 101)
    sim = drop(model, len(heights), restitution, heights)
    gap = record(sim, 500)[:, :, 2] - RADIUS
    assert gap.min() > -1e-4  # never inside the ground at a step's end
    worst = 0.0
    for k, height in enumerate(heights):
        got = apexes(gap[:, k], 4)
        exact = height * restitution ** (2 * np.arange(1, 5))
        worst = max(worst, np.abs(got / exact - 1).max())
    print(f"e = {restitution}: largest apex error {100 * worst:.3f} %")
    assert worst <= 1e-3


def test_elastic_bounce_keeps_energy(model):
    """Twenty bounces at e = 1: apexes within 0.1 % of the first height."""
    heights = np.linspace(0.9, 1.9, 11)
    sim = drop(model, len(heights), 1.0, heights)
    gap = record(sim, 2600)[:, :, 2] - RADIUS
    for k, height in enumerate(heights):
        got = apexes(gap[:, k], 20)
        assert len(got) == 20
        assert np.abs(got / height - 1).max() <= 1e-3


def oblique(model, friction, vx, spin_y, restitution=0.8, gap=1.0):
    """Velocity along x and spin about y after one bounce, and the normal velocity of the impact."""
    count = len(np.atleast_1d(vx))
    sim = drop(model, count, restitution, gap, friction, vx, spin_y)
    fall = np.sqrt(2 * gap / GRAVITY)
    sim.step(int(fall / H) + 5)
    velocity = sim.body_qd[:, 0]
    assert (velocity[:, 2] > 0).all()  # on the way up
    return velocity[:, 0], velocity[:, 4], np.sqrt(2 * GRAVITY * gap)


def test_oblique_bounce_sticks(model):
    """With ample friction the surface stops: impulse -2/5 m u for a thin shell, u the slip. To 1e-5:
    only rounding."""
    vx, spin = np.array([1.0, 2.0, -1.5, 0.5]), np.array([0.0, 5.0, 10.0, -20.0])
    u = vx - RADIUS * spin
    v, w, _ = oblique(model, 10.0, vx, spin)
    np.testing.assert_allclose(v, vx - 0.4 * u, atol=1e-5)
    np.testing.assert_allclose(w, spin + RADIUS * MASS * 0.4 * u / SHELL, atol=1e-4)
    np.testing.assert_allclose(v - RADIUS * w, 0, atol=1e-5)


def test_oblique_bounce_slides(model):
    """With little friction the impulse is mu times the normal one. A drop from rest starts g h^2 / 8
    higher than it says (its velocity belongs half a step earlier): 6e-5 of the impact speed."""
    mu, e = 0.1, 0.8
    vx, spin = np.array([4.0, 6.0, -5.0]), np.array([0.0, -10.0, 10.0])
    u = vx - RADIUS * spin
    v, w, normal = oblique(model, mu, vx, spin, e)
    impulse = -np.sign(u) * mu * (1 + e) * MASS * normal
    assert (np.abs(impulse) < 0.4 * MASS * np.abs(u)).all()
    np.testing.assert_allclose(v, vx + impulse / MASS, atol=3e-4)
    np.testing.assert_allclose(w, spin - RADIUS * impulse / SHELL, atol=3e-4 * MASS * RADIUS / SHELL)


def test_bounce_shows_its_impulse(model):
    """Contacts report m (1 + e) v of the bounce, and nothing in the steps around it."""
    sim = drop(model, 1, 0.8, 1.0)
    impulse = record(sim, 60, lambda sim: sim.contacts().impulse[0, 0, 0])
    assert np.count_nonzero(impulse) == 1
    assert impulse.max() == pytest.approx(1.8 * MASS * np.sqrt(2 * GRAVITY), rel=1e-3)


def test_ball_comes_to_rest(model):
    """After its last bounce a ball lies still, and the ground carries its weight."""
    heights = np.linspace(0.5, 1.5, 16)
    sim = drop(model, 16, 0.8, heights, friction=0.8)
    sim.step(1500)
    speed = record(sim, 200, lambda sim: sim.body_qd[:, 0].copy())
    assert np.abs(speed).max() <= 1e-4
    assert np.abs(np.diff(speed[..., 2], axis=0) / H).max() <= 1e-3  # no jitter [m/s^2]
    touch = sim.contacts()
    assert np.abs(touch.gap).max() <= 1e-3
    np.testing.assert_allclose(touch.impulse[:, 0, 0] / H, MASS * GRAVITY, rtol=1e-3)


def test_each_world_has_its_own_restitution(model):
    """set_contact by world: the first apex is e^2 of the drop."""
    e = np.linspace(0.5, 0.95, 16)
    sim = drop(model, 16, e, 1.2)
    gap = record(sim, 200)[:, :, 2] - RADIUS
    got = np.array([apexes(gap[:, k], 1)[0] for k in range(16)])
    np.testing.assert_allclose(got, 1.2 * e**2, rtol=1e-3)


def test_step_size_does_not_matter():
    """The impact is solved within its step: the fourth apex is right at 20 ms as at 2 ms."""
    for h in (0.002, 0.02):
        coarse = scene(ground() + ball(), h)
        sim = drop(coarse, 1, 0.8, 1.3)
        gap = record(sim, int(4.0 / h))[:, 0, 2] - RADIUS
        assert apexes(gap, 4)[3] == pytest.approx(1.3 * 0.8**8, rel=3e-3)
