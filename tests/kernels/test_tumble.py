"""Free bodies that turn over and over, against what they conserve and Euler's equations in float64."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from tests.reference.scenes import GRAVITY, ground, record, scene
from warpdribble.sims import Simulation

H = 0.01
MOMENTS = np.array([0.01, 0.02, 0.03])
AWAY = np.array([0.2, -0.1, 0.05])


def racket(at=(0, 0, 0), shape=""):
    x, y, z = MOMENTS
    return (
        f'<body name="racket"><freejoint/><inertial pos="{at[0]} {at[1]} {at[2]}" mass="0.8"'
        f' diaginertia="{x} {y} {z}"/>{shape}</body>'
    )


def bodies(sim, at):
    """Rotations, places and velocities of the centre of mass, angular momenta about it, energies."""
    q, qd = sim.joint_q.astype(float), sim.joint_qd.astype(float)
    R, w = Rotation.from_quat(q[:, 3:]), qd[:, 3:]
    v = qd[:, :3] + R.apply(np.cross(w, at))
    energy = 0.5 * 0.8 * np.sum(v**2, axis=1) + 0.5 * np.sum(MOMENTS * w**2, axis=1)
    return R, q[:, :3] + R.apply(at), v, R.apply(MOMENTS * w), energy


def thrown(at, rate, count=16, h=H, gravity="0 0 0"):
    """About every axis, the middle one first."""
    model = scene(racket(at), h, gravity=gravity)
    random = np.random.default_rng(3)
    spin = random.standard_normal((count, 3))
    spin[0] = 0.01, 1.0, 0.01
    qd = np.c_[random.standard_normal((count, 3)), rate * spin / np.linalg.norm(spin, axis=1)[:, None]]
    q = np.c_[np.zeros((count, 3)), Rotation.random(count, rng=random).as_quat()]
    sim = Simulation(model, count)
    sim.reset(joint_q=q, joint_qd=qd)
    return sim


@pytest.mark.parametrize("rate", [1.0, 5.0, 20.0, 40.0, 80.0])
@pytest.mark.parametrize("at", [np.zeros(3), AWAY], ids=["centred", "off centre"])
def test_energy_and_momentum_stay(at, rate):
    """To 0.1 % in 5 s, the momentum's direction too; the centre of mass goes straight on."""
    sim = thrown(at, rate)
    _, x, v, L, energy = bodies(sim, at)
    for k in range(1, 51):
        sim.step(10)
        _, x1, v1, L1, energy1 = bodies(sim, at)
        np.testing.assert_allclose(energy1, energy, rtol=1e-3)
        assert np.linalg.norm(L1 - L, axis=1).max() <= 1e-3 * np.linalg.norm(L, axis=1).min()
        np.testing.assert_allclose(v1, v, atol=2e-4 * (1 + 0.1 * rate))
        np.testing.assert_allclose(x1, x + 10 * k * H * v, atol=1e-3 * (1 + 0.1 * rate))
    assert not sim.status.any()


def test_it_goes_as_euler_says():
    """Orientations after half a second at 10 rad/s: of second order in h, down to what rounding leaves."""
    error = []
    for h in (0.02, 0.01, 0.005):
        sim = thrown(AWAY, 10.0, 4, h)
        q, w = sim.joint_q[:, 3:].astype(float), sim.joint_qd[:, 3:].astype(float)
        sim.step(round(0.5 / h))
        worst = 0.0
        for k in range(4):

            def fly(t, s):
                turn, w = s[:4], s[4:]
                x, y, z, c = turn
                rate = 0.5 * np.array([c * w[0] + y * w[2] - z * w[1], c * w[1] + z * w[0] - x * w[2]])
                rate = np.r_[rate, 0.5 * (c * w[2] + x * w[1] - y * w[0]), -0.5 * turn[:3] @ w]
                return np.r_[rate, -np.cross(w, MOMENTS * w) / MOMENTS]

            end = solve_ivp(fly, (0, 0.5), np.r_[q[k], w[k]], rtol=1e-10, atol=1e-12).y[:4, -1]
            apart = Rotation.from_quat(end).inv() * Rotation.from_quat(sim.joint_q[k, 3:])
            worst = max(worst, apart.magnitude())
        error.append(worst)
    print("angle from Euler's [rad]", error)
    assert error[0] < 0.01 and error[1] < 0.35 * error[0] and error[2] < 1e-3


@pytest.mark.parametrize("axis", range(3))
def test_about_a_principal_axis(axis):
    """As many turns as its rate says."""
    sim = Simulation(scene(racket(), H, gravity="0 0 0"), 1)
    qd = np.zeros(6)
    qd[3 + axis] = 40.0
    sim.reset(joint_qd=qd)
    sim.step(50)
    turned = Rotation.from_rotvec(20.0 * np.eye(3)[axis])
    assert (turned.inv() * Rotation.from_quat(sim.joint_q[0, 3:])).magnitude() < 2e-4


def test_with_torque_and_weight():
    """A torque along the momentum of a body that spins about a principal axis adds to it; the centre of mass,
    off the origin, falls on its parabola."""
    sim = Simulation(scene(racket(AWAY), H), 1)
    qd = np.zeros(6)
    qd[3:] = 0, 0, 5.0
    qd[:3] = -np.cross(qd[3:], AWAY)  # its centre of mass is at rest
    sim.reset(joint_qd=qd)
    torque = np.array([0, 0, 0.06])
    sim.set_joint_force(np.r_[0, 0, 0, torque])
    sim.step(100)
    _, x, v, L, _ = bodies(sim, AWAY)
    np.testing.assert_allclose(L[0], [0, 0, 0.15 + 0.06], atol=2e-4)
    np.testing.assert_allclose(v[0], [0, 0, -GRAVITY], atol=2e-3)
    np.testing.assert_allclose(x[0], AWAY - [0, 0, 0.5 * GRAVITY * (1 + H)], atol=2e-3)


def test_mass_scale_changes_nothing():
    light, heavy = thrown(AWAY, 10.0), thrown(AWAY, 10.0)
    heavy.set_mass("racket", 3.0)
    for sim in (light, heavy):
        sim.step(100)
    np.testing.assert_allclose(heavy.joint_q, light.joint_q, atol=1e-3)


@pytest.mark.parametrize("at", [np.zeros(3), np.array([0.03, 0.01, 0.0])], ids=["centred", "off centre"])
def test_thrown_on_the_floor_it_comes_to_rest(at):
    """Tumbling at 15 rad/s, with contacts: energy, half a step back, never grows by a hundredth of the
    first, and it lies still in the end."""
    shape = '<geom name="box" type="box" size="0.15 0.1 0.03" friction="0.8" user="0.3 0.2 1e-5"/>'
    model = scene(ground() + racket(at, shape), H)
    random = np.random.default_rng(5)
    n = 16
    sim = Simulation(model, n)
    q = np.c_[np.zeros((n, 2)), np.full(n, 0.8), Rotation.random(n, rng=random).as_quat()]
    sim.reset(joint_q=q, joint_qd=np.c_[random.standard_normal((n, 3)), 8 * random.standard_normal((n, 3))])

    def energy():
        _, x, v, _, kinetic = bodies(sim, at)
        return kinetic + 0.8 * GRAVITY * (x[:, 2] - 0.5 * H * v[:, 2])

    first = least = energy()
    for _ in range(600):
        sim.step()
        now = energy()
        assert (now <= least + 0.01 * first).all()
        least = np.minimum(least, now)
    assert np.abs(sim.joint_qd).max() < 0.05


def test_a_lane_does_not_feel_the_others():
    """Sixteen worlds, and one of them alone beside idle ones: the same bits."""
    both = thrown(AWAY, 20.0), thrown(AWAY, 20.0)
    q, qd = both[0].joint_q, both[0].joint_qd
    for sim in both:
        sim.reset(joint_q=q, joint_qd=qd)
        qd[1:] = 0
    paths = [record(sim, 50) for sim in both]
    np.testing.assert_array_equal(paths[0][:, 0], paths[1][:, 0])
