"""What a step conserves, and how fast it converges: momentum, energy, order in h."""

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.reference import scenes
from tests.reference.rigid import Rigid, from_mujoco, to_mujoco
from warpdribble.sims import Model, Simulation


def at_step(model, h):
    """The model with another time step."""
    model.timestep = h
    return model


def first_order(errors):
    """Whether errors halve with each halving of h, to a tenth."""
    ratios = np.array(errors[:-1]) / errors[1:]
    return ((ratios > 1.8) & (ratios < 2.2)).all()


def compiled(model):
    return mujoco.MjSpec.from_file(str(model.path)).compile()


@pytest.mark.parametrize("driven", [True, False], ids=["driven", "limp"])
def test_momentum_of_the_player(driven):
    """Half a second in the air, limbs moving. Linear momentum changes by gravity alone and angular
    momentum about the centre of mass stays. In joint coordinates a semi-implicit step keeps both but
    for terms in proportion to h: 3 % of what there is at 10 ms, half of it at half the step."""
    drift = []
    for h in (0.01, 0.005, 0.0025):
        model = at_step(Model.load("player"), h)
        if not driven:
            model.tables["dof_kp"][:] = model.tables["dof_kd"][:] = 0
        robot = Rigid(compiled(model))
        rng = np.random.default_rng(2)
        q, qd = scenes.start(model, 4), rng.standard_normal((4, model.nv))
        q[:, 2] += 20
        q[:, model.q_slice("ball").start : model.q_slice("ball").start + 3] = 3, 0, 20
        sim = Simulation(model, 4)
        sim.reset(joint_q=q, joint_qd=qd)

        def momenta(sim=sim, robot=robot):
            states = zip(to_mujoco(robot.m, sim.joint_q), sim.joint_qd.astype(float))
            return np.array([robot.momentum(robot.pose(*state)) for state in states])

        before = momenta()
        sim.step(round(0.5 / h))
        change = momenta() - before
        change[:, 3:] -= 0.5 * robot.m.body_mass.sum() * robot.gravity
        drift.append((np.abs(change[:, :3]).max(), np.abs(change[:, 3:]).max()))
    angular, linear = np.array(drift).T
    print(f"{driven=}: angular {angular} N m s, linear {linear} N s")
    size = np.abs(before).max(axis=0)
    assert angular[0] <= 0.03 * size[:3].max() and linear[0] <= 0.03 * size[3:].max()
    for error in (angular, linear):
        assert first_order(error)


TUMBLER = (
    '<body name="b"><freejoint/><inertial pos="0.1 -0.2 0.05" quat="0.9 0.1 0.3 0.2" mass="2"'
    ' diaginertia="0.03 0.05 0.07"/></body>'
)


def test_momentum_of_one_body():
    """Turning about a point off its centre of mass, a free body keeps its momentum."""
    for h in (0.01, 0.005):
        model = scenes.scene(TUMBLER, h)
        sim = Simulation(model, 1)
        sim.reset(joint_qd=[1, 2, 3, 2, -1, 3])
        inertia, com = model.body_inertia[0], model.body_com[0]

        def spin(sim=sim, inertia=inertia):
            q, w = sim.body_q[0, 0, 3:].astype(float), sim.body_qd[0, 0, 3:].astype(float)
            R = Rotation(q)
            return R @ inertia @ R.T @ w

        v, L = sim.body_qd[0, 0, :3].copy(), spin()
        sim.step(round(1 / h))
        assert com.any()
        np.testing.assert_allclose(sim.body_qd[0, 0, :3], v + [0, 0, -9.81], atol=1e-4)
        np.testing.assert_allclose(spin(), L, atol=1e-4 * np.linalg.norm(L))


def test_linear_momentum_of_a_ball_is_exact():
    """With the origin at the centre of mass nothing but gravity enters, whatever the spin; 1e-5 is the
    rounding of 200 sums."""
    sim = Simulation(scenes.scene(scenes.ball()), 1)
    sim.reset(joint_q=[0, 0, 50, 0, 0, 0, 1], joint_qd=[1, -2, 3, 20, -10, 30])
    sim.step(200)
    np.testing.assert_allclose(sim.joint_qd[0, :3], [1, -2, 3 - 2 * 9.81], rtol=1e-5)
    np.testing.assert_allclose(sim.joint_qd[0, 3:], [20, -10, 30], rtol=1e-5)
    np.testing.assert_allclose(sim.joint_q[0, :2], [2, -4], rtol=1e-5)


def Rotation(q):
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


CHAIN = """
<body pos="0 0 3"><joint type="ball"/><inertial pos="0 0 -0.2" mass="1" diaginertia="0.02 0.02 0.005"/>
<body pos="0 0 -0.4"><joint type="ball"/><inertial pos="0.05 0 -0.2" mass="0.8" diaginertia="0.02 0.01 0.01"/>
<body pos="0 0 -0.4"><joint type="hinge" axis="0.6 0.8 0"/>
<inertial pos="0 0.03 -0.15" mass="0.6" diaginertia="0.01 0.01 0.005"/>
<body pos="0 0 -0.3"><joint type="ball"/><inertial pos="0 0 -0.1" mass="0.4" diaginertia="0.004 0.003 0.002"/>
</body></body></body></body>"""


def chain(h, gravity="0 0 -9.81"):
    model = scenes.scene(CHAIN, h, gravity)
    m = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="0.0001" integrator="RK4" gravity="{gravity}"/>'
        f"<worldbody>{CHAIN}</worldbody></mujoco>"
    )
    return model, m


SPIN = np.array([1.0, 1.5, -1.0, -0.5, 1.0, 2.0, 1.0, -2.0, 1.0, 1.5])


def test_energy():
    """A chain without gravity, drives and damping, turning at some 2 rad/s: in 5 s its energy leaves
    its value by at most 1.5 % at 10 ms, less with smaller steps."""
    drift = []
    for h in (0.01, 0.005, 0.0025):
        model, m = chain(h, "0 0 0")
        robot = Rigid(m)
        sim = Simulation(model, 1)
        sim.reset(joint_qd=SPIN)
        energy = []
        for _ in range(50):
            q, v = to_mujoco(m, sim.joint_q[0]), sim.joint_qd[0].astype(float)
            energy.append(robot.kinetic(robot.pose(q, v)))
            sim.step(round(0.1 / h))
        drift.append(np.abs(np.array(energy) / energy[0] - 1).max())
    print("energy drift of a chain in 5 s", drift)
    assert drift[0] <= 0.015 and drift[1] <= 0.6 * drift[0]


def test_pendulum_converges_with_h():
    """First order: halving the step halves the error, to a tenth."""
    model = scenes.scene(
        '<body><joint axis="0 1 0"/><inertial pos="0 0 -0.5" mass="1" diaginertia="0.1 0.1 0.1"/></body>'
    )
    k = 0.5 * 9.81 / (0.1 + 0.25)
    exact = solve_ivp(lambda t, y: [y[1], -k * np.sin(y[0])], (0, 2), [1.0, 0.0], rtol=1e-12, atol=1e-12).y[
        :, -1
    ]
    errors = []
    for h in (0.02, 0.01, 0.005, 0.0025):
        sim = Simulation(at_step(model, h), 1)
        sim.reset(joint_q=[1.0])
        sim.step(round(2 / h))
        errors.append(np.hypot(sim.joint_q[0, 0] - exact[0], sim.joint_qd[0, 0] - exact[1]))
    print("pendulum errors", errors)
    assert first_order(errors)


def test_chain_converges_to_mujoco():
    """A falling chain of ball joints and a hinge against MuJoCo's RK4 at 0.1 ms: first order in h. The
    velocity products of the deeper links count here."""
    errors = []
    for h in (0.005, 0.0025, 0.00125):
        model, m = chain(h)
        data = mujoco.MjData(m)
        data.qvel[:] = SPIN
        mujoco.mj_step(m, data, 5000)
        sim = Simulation(model, 1)
        sim.reset(joint_qd=SPIN)
        sim.step(round(0.5 / h))
        got = sim.joint_q[0] * np.sign(sim.joint_q[0] @ from_mujoco(m, data.qpos))
        errors.append(np.abs(to_mujoco(m, got) - data.qpos).max())
    print("chain against RK4", errors)
    assert errors[-1] < 0.005 and first_order(errors)
