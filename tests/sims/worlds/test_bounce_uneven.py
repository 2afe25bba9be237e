"""Bounces of balls whose moments of inertia differ, against rigid-body impact in float64."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from tests.reference.scenes import GRAVITY, MASS, RADIUS, ground, scene
from warpdribble.sims import Simulation

MOMENTS = np.array([0.002, 0.006, 0.0075])
E, FALL = 0.8, 3.0


def ball(moments=MOMENTS, at="0 0 0", more=""):
    x, y, z = moments
    return (
        f'<body name="ball"><freejoint/><inertial pos="{at}" mass="{MASS}" diaginertia="{x} {y} {z}"/>'
        f'<geom name="ball" type="sphere" size="{RADIUS}" friction="0.8" user="{E} 0.2 1e-5"/>{more}</body>'
    )


def strike(model, friction, turn, v, mass=MASS):
    """Velocity and spin, world axes, of balls with a velocity v (n, 2) along the ground and no spin before
    they strike it, `turn` being how they lie."""
    count = len(v)
    sim = Simulation(model, count)
    q, qd = np.zeros((count, 7)), np.zeros((count, 6))
    q[:, 2], q[:, 3:] = RADIUS + 0.013, turn.as_quat()
    qd[:, :2], qd[:, 2] = v, -FALL + 0.5 * model.timestep * GRAVITY  # it lags half a step behind
    sim.reset(joint_q=q, joint_qd=qd)
    sim.set_contact("ball", "ground", friction=friction)
    sim.set_mass("ball", mass)
    sim.step()
    assert (sim.contacts().impulse[:, 0, 0] > 0).all()
    return sim.body_qd[:, 0, :3].astype(float), sim.body_qd[:, 0, 3:].astype(float)


def answer(turn, mass=MASS):
    """K (n, 2, 2), the ground's tangential velocity change by an impulse, and what it does to the spin
    (n, 3, 2)."""
    R = turn.as_matrix()
    free = np.linalg.inv(R @ np.diag(MOMENTS * mass / MASS) @ R.transpose(0, 2, 1))
    arm = np.array([[0, RADIUS, 0], [-RADIUS, 0, 0], [0, 0, 0]])  # r x, r = (0, 0, -radius)
    K = np.eye(3) / mass - arm @ free @ arm
    return K[:, :2, :2], (free @ arm)[:, :, :2]


@pytest.fixture(scope="module")
def model():
    return scene(ground() + ball(), 0.01)


@pytest.fixture(scope="module")
def throws():
    random = np.random.default_rng(4)
    return Rotation.random(64, rng=random), 2.0 * random.standard_normal((64, 2))


@pytest.mark.parametrize("mass", [MASS, 2.5 * MASS])
def test_it_sticks(model, throws, mass):
    """J = -K^-1 v, whatever axis is up: v + K J = 0."""
    turn, v = throws
    K, turns = answer(turn, mass)
    J = -np.linalg.solve(K, v[..., None])[..., 0]
    after, spin = strike(model, 10.0, turn, v, mass)
    np.testing.assert_allclose(after[:, :2], v + J / mass, atol=1e-5)
    np.testing.assert_allclose(spin, np.einsum("nij,nj->ni", turns, J), atol=2e-4)


def test_it_slides(model, throws):
    """Of the impulses that friction allows, the one that takes most energy; by a search over directions."""
    turn, v = throws
    mu = 0.05
    K, turns = answer(turn)
    after, spin = strike(model, mu, turn, v)
    most = mu * (1 + E) * MASS * np.sqrt(FALL**2 + 2 * GRAVITY * 0.013)
    slid = 0
    for k in range(len(v)):
        if np.linalg.norm(np.linalg.solve(K[k], v[k])) <= most:
            continue
        slid += 1

        def energy(angle, k=k):
            J = most * np.array([np.cos(angle[0]), np.sin(angle[0])])
            return v[k] @ J + 0.5 * J @ K[k] @ J

        start = np.arctan2(-v[k, 1], -v[k, 0])
        angle = minimize(energy, [start], method="Nelder-Mead", options=dict(xatol=1e-7, fatol=1e-12)).x[0]
        J = most * np.array([np.cos(angle), np.sin(angle)])
        np.testing.assert_allclose(after[k, :2], v[k] + J / MASS, atol=1e-4)
        np.testing.assert_allclose(spin[k], turns[k] @ J, atol=2e-3)
    assert slid > 50


def test_equal_moments_any_axes(throws):
    """An inertia given about turned axes is even all the same: v - 2/5 v for a thin shell."""
    shell = 2 / 3 * MASS * RADIUS**2
    model = scene(ground() + ball([shell] * 3).replace("mass=", 'quat="0.8 0 0.6 0" mass='), 0.01)
    assert model.tables["flyer_even"].tolist() == [1]
    turn, v = throws
    after, _ = strike(model, 10.0, turn, v)
    np.testing.assert_allclose(after[:, :2], 0.6 * v, atol=1e-5)


def energy(sim, height_of_com):
    M, qd = sim.mass_matrix().astype(float), sim.joint_qd.astype(float)
    mass = M[:, 0, 0]
    return 0.5 * np.einsum("ni,nij,nj->n", qd, M, qd) + mass * GRAVITY * height_of_com(sim)


@pytest.mark.parametrize("friction", [0.05, 0.5, 2.0])
def test_energy_never_grows(model, friction):
    """Thrown with spin, ten bounces. A step's velocity lags by g h / 2, which is m v g h / 2 of energy."""
    random = np.random.default_rng(8)
    sim = Simulation(model, 32)
    q, qd = np.zeros((32, 7)), random.standard_normal((32, 6)) * [1, 1, 1, 8, 8, 8]
    q[:, 2], q[:, 3:] = 1.0, Rotation.random(32, rng=random).as_quat()
    sim.reset(joint_q=q, joint_qd=qd)
    sim.set_contact("ball", "ground", friction=friction)
    least = first = energy(sim, lambda sim: sim.joint_q[:, 2])
    for _ in range(400):
        sim.step()
        now = energy(sim, lambda sim: sim.joint_q[:, 2] - 0.005 * sim.joint_qd[:, 2])
        assert (now <= least + 0.01 * first).all()
        least = np.minimum(least, now)


@pytest.mark.parametrize(
    "made",
    [
        ball(at="0 0.01 0"),
        ball(more='<body><joint/><geom size="0.01" mass="0.1" contype="0" conaffinity="0"/></body>'),
    ],
    ids=["off centre", "with a child"],
)
def test_what_flies_otherwise_is_left_to_the_solver(made):
    model = scene(ground() + made, 0.01)
    assert len(model.tables["flyer_link"]) == 0
    assert model.notes[0].startswith("bounces of ball are not exact")
    sim = Simulation(model, 1)
    q = model.start_q.copy()
    q[2] = 1.0
    sim.reset(joint_q=q)
    sim.step(400)
    assert sim.status[0] == 0 and abs(sim.contacts().gap[0, 0]) < 2e-3
