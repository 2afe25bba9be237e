"""Undriven trees keep their energy: pendulums, chains, satellites, tops."""

import mujoco
import numpy as np
import pytest

from tests.reference.rigid import Rigid, to_mujoco
from tests.reference.scenes import model as model_of
from tests.reference.scenes import record
from warpdribble.sims import Model, Simulation

H = 0.01


def body(joint, at, com, mass, moments, inside=""):
    return (
        f'<body pos="{at}"><joint {joint}/><inertial pos="{com}" mass="{mass}" diaginertia="{moments}"/>'
        f"{inside}</body>"
    )


ARM = ("0.15 0 0", 0.5, "0.001 0.004 0.005")
HINGE, BALL = 'type="hinge" axis="0 1 0"', 'type="ball"'


def satellite(*panels):
    return (
        '<body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="0.01 0.02 0.03"/>'
        f"{''.join(panels)}</body>"
    )


TREES = {
    "double pendulum": body(HINGE, "0 0 0", *ARM, body(HINGE, "0.3 0 0", *ARM)),
    "two axes": body(HINGE, "0 0 0", *ARM, body('type="hinge" axis="1 0 1"', "0.3 0 0", *ARM)),
    "ball joint": body(BALL, "0 0 0", *ARM),
    "chain of ball joints": body(BALL, "0 0 0", *ARM, body(BALL, "0.3 0 0", *ARM)),
    "satellite": satellite(body(HINGE, "0.2 0 0", *ARM)),
    "satellite with two": satellite(body(BALL, "0.2 0 0", *ARM), body(HINGE, "-0.2 0 0", *ARM)),
}


def made(name, h=H, gravity="0 0 0"):
    xml = f'<mujoco><option timestep="{h}" gravity="{gravity}"/><worldbody>{TREES[name]}</worldbody></mujoco>'
    return model_of(xml), Rigid(mujoco.MjModel.from_xml_string(xml))


def swung(name, rate, count=8, gravity="0 0 0"):
    """Every joint turning, at most at `rate` [rad/s]."""
    model, robot = made(name, gravity=gravity)
    random = np.random.default_rng(1)
    qd = random.uniform(-1, 1, (count, model.nv))
    if robot.m.jnt_type[0] == 0:
        qd[:, :3] = 0
        qd[:, 6:] *= 0.3
    qd *= rate / np.abs(qd).max(axis=1, keepdims=True)
    sim = Simulation(model, count)
    sim.reset(joint_qd=qd)
    return sim, robot


def energies(sim, robot):
    """Of each world, its place half a step before, where its velocity belongs."""
    h, out = sim.model.timestep, []
    for q, v in zip(to_mujoco(robot.m, sim.joint_q), sim.joint_qd.astype(float)):
        p = robot.pose(robot.integrate(q, v, -h / 2), v)
        out.append(robot.kinetic(p) + robot.potential(p))
    return np.array(out)


@pytest.mark.parametrize("rate, allowed", [(5.0, 0.02), (10.0, 0.08), (20.0, 0.4)])
@pytest.mark.parametrize("name", TREES)
def test_energy_does_not_drift(name, rate, allowed):
    """Five seconds without anything that acts: explicit forces multiply it by up to 1.6 at 5 rad/s, and know
    no bound from 10 on. Of second order in h times rate."""
    sim, robot = swung(name, rate)
    sim.step()
    first, worst = energies(sim, robot), 0.0
    for _ in range(50):
        sim.step(10)
        worst = max(worst, np.abs(energies(sim, robot) / first - 1).max())
    print(f"{name} at {rate} rad/s: energy within {100 * worst:.2f} %")
    assert worst <= allowed and not sim.status.any()


@pytest.mark.parametrize("name", ["double pendulum", "chain of ball joints"])
def test_under_gravity(name):
    """Let go from the horizontal, for five seconds."""
    sim, robot = swung(name, 1e-3, gravity="0 0 -9.81")
    sim.step()
    first, size = energies(sim, robot), 0.8 * 9.81 * 0.3
    for _ in range(50):
        sim.step(10)
        np.testing.assert_allclose(energies(sim, robot), first, atol=0.1 * size)


def test_a_top_precesses():
    """At the rate p for which m g l = p (I3 w - I1 p cos(lean)), and its tip keeps its height."""
    top = body(BALL, "0 0 0", "0 0 0.1", 0.5, "0.0025 0.0025 0.004")
    xml = f'<mujoco><option timestep="{H}"/><worldbody>{top}</worldbody></mujoco>'
    model = model_of(xml)
    sim = Simulation(model, 1)
    lean, spin = 0.3, 40.0
    own, across, weight = 0.004, 0.0025 + 0.5 * 0.1**2, 0.5 * 9.81 * 0.1
    slow = np.roots([-across * np.cos(lean), own * spin, -weight]).min()
    turn = [np.sin(lean / 2), 0, 0, np.cos(lean / 2)]
    about_up = slow * np.array([0, np.sin(lean), np.cos(lean)])  # precession, in the top's axes
    sim.reset(joint_q=turn, joint_qd=about_up + [0, 0, spin - about_up[2]])
    path = record(sim, 100, lambda sim: sim.body_q[0, 0, 3:].astype(float))
    x, y, z, w = path.T
    tip = np.c_[2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)]
    assert np.abs(tip[:, 2] - np.cos(lean)).max() < 0.02
    angle = np.unwrap(np.arctan2(tip[:, 1], tip[:, 0]))
    assert (angle[-1] - angle[0]) / (100 * H) == pytest.approx(slow, rel=0.03)


def test_fast_ones_stay_finite():
    for name in TREES:
        sim, _ = swung(name, 60.0)
        sim.step(500)
        assert np.isfinite(sim.joint_qd).all() and not (sim.status & 1).any()


def test_a_world_does_not_feel_the_others():
    """A slow one beside fast ones, which are gone through more often: the same bits as alone."""
    paths = []
    for rate in (1.0, 30.0):
        sim, _ = swung("satellite with two", rate, 16)
        qd = sim.joint_qd.copy()
        qd[0] = 0.01 * np.arange(sim.model.nv)
        sim.reset(joint_qd=qd)
        paths.append(record(sim, 50)[:, 0])
    np.testing.assert_array_equal(paths[0], paths[1])


def test_what_is_left_out():
    """Trees whose joints are all driven: a player on its feet, arms that are fixed to the world."""
    assert not Model.load("player").tables["link_loose"].any()
    assert made("satellite")[0].tables["link_loose"].tolist() == [0, 1, 1]
    servo = '<actuator><position joint="j" kp="100" kv="5"/></actuator>'
    for tree, loose in (("double pendulum", 1), ("satellite", 1)):
        worldbody = TREES[tree].replace("<joint ", '<joint name="j" ', 1)
        model = model_of(f"<mujoco><worldbody>{worldbody}</worldbody>{servo}</mujoco>")
        assert model.tables["link_loose"].tolist() == [0, loose, loose]
    one = body('name="j" ' + HINGE, "0 0 0", *ARM, "<geom size='0.1' mass='0.1'/>")
    assert not model_of(f"<mujoco><worldbody>{one}</worldbody>{servo}</mujoco>").tables["link_loose"].any()
