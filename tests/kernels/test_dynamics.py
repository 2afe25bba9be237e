"""Kinematics, mass matrix and bias force of the kernels against MuJoCo and the float64 oracle.

Errors are relative: lengths to the player's height; velocities and bias forces to the root mean square
of the same entry over all states; M_ij to sqrt(M_ii M_jj).
"""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings

from tests.reference import scenes
from tests.reference.rigid import Rigid, from_mujoco, random_state, same_signs, to_mujoco
from tests.reference.trees import trees
from warpdribble.sims import Model, Simulation

TOLERANCE = 1e-4
STATES = 1000


@pytest.fixture(scope="module")
def player():
    model = Model.load("player")
    return model, mujoco.MjSpec.from_file(str(model.path)).compile()


def matrices(body_q):
    """(..., 3, 3) of the quaternions in body_q."""
    x, y, z, w = np.moveaxis(body_q[..., 3:].astype(float), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def relative_to_rms(error, value):
    """Largest error of each entry over its root mean square over the states (at least 1e-3: a ball's
    bias torque is zero)."""
    size = np.maximum(np.sqrt(np.mean(value**2, axis=0)), 1e-3)
    return (np.abs(error).max(axis=0) / size).max()


@pytest.mark.parametrize("away", [0.0, 100.0], ids=["origin", "100m"])
def test_player_against_mujoco(player, away):
    model, m = player
    rng = np.random.default_rng(7)
    q, v = random_state(m, rng, STATES)
    q[:, :2] += away / np.sqrt(2)
    sim = Simulation(model, STATES)
    sim.reset(joint_q=from_mujoco(m, q), joint_qd=v)
    q, v = to_mujoco(m, sim.joint_q), sim.joint_qd.astype(float)  # as rounded to float32

    data = mujoco.MjData(m)
    x, R, velocity, bias, M = [], [], [], [], np.zeros((STATES, m.nv, m.nv))
    for k in range(STATES):
        data.qpos[:], data.qvel[:] = q[k], v[k]
        mujoco.mj_kinematics(m, data)
        mujoco.mj_comPos(m, data)
        mujoco.mj_crb(m, data)
        mujoco.mj_comVel(m, data)
        qfrc = np.zeros(m.nv)
        mujoco.mj_rne(m, data, 0, qfrc)
        mujoco.mj_fullM(m, data, M[k])
        x.append(data.xpos[1:].copy())
        R.append(data.xmat[1:].reshape(-1, 3, 3).copy())
        bias.append(qfrc)
        both = np.zeros((m.nbody - 1, 6))
        for b in range(1, m.nbody):
            mujoco.mj_objectVelocity(m, data, mujoco.mjtObj.mjOBJ_BODY, b, both[b - 1], 0)
        velocity.append(both[:, [3, 4, 5, 0, 1, 2]])
    x, R, velocity, bias = (np.array(a) for a in (x, R, velocity, bias))

    body_q = sim.body_q
    assert np.abs(body_q[..., :3] - x).max() <= TOLERANCE * 1.8
    assert np.abs(matrices(body_q) - R).max() <= TOLERANCE
    assert relative_to_rms(sim.body_qd - velocity, velocity) <= TOLERANCE
    assert relative_to_rms(sim.bias_force() - bias, bias) <= TOLERANCE
    diagonal = np.sqrt(np.einsum("kii->ki", M))
    error = np.abs(sim.mass_matrix() - M) / (diagonal[:, :, None] * diagonal[:, None, :])
    assert error.max() <= TOLERANCE


def against_oracle(xml):
    """One model in 16 random states: kinematics, M, bias, and a contact-free step."""
    model = scenes.model(xml)
    m = mujoco.MjModel.from_xml_string(xml)
    loose, tumbling = (
        np.array([of[joint.link] > sign for joint in model.joints for _ in range(model.nv)[joint.dof]])
        for of, sign in ((model.tables["link_loose"], 0), (model.tables["link_tumbler"], -1))
    )
    robot, h = Rigid(m, mean=loose), model.timestep
    rng = np.random.default_rng(5)
    q0, v0 = random_state(m, rng, 16)
    target, _ = random_state(m, rng, 16)
    f = rng.standard_normal((16, m.nv))
    push = 2 * rng.standard_normal((16, m.nbody, 3))

    def thrown():
        sim = Simulation(model, 16)
        sim.reset(joint_q=from_mujoco(m, q0), joint_qd=v0)
        sim.set_targets(from_mujoco(m, target))
        return sim, to_mujoco(m, sim.joint_q), sim.joint_qd.astype(float)

    def step(sim):
        sim.set_joint_force(f)
        for b in range(1, m.nbody):
            sim.apply_force(b - 1, push[:, b])
        sim.step()

    limited, q, v = thrown()
    step(limited)
    after = limited.joint_qd.astype(float)
    held = [
        robot.obeys_effort_limits(q[k], v[k], after[k], target[k], h, robot.drives(), f[k], push[k])[0]
        for k in range(16)
    ]
    if m.nu:
        assert np.mean(held) >= 0.9

    model.tables["link_effort"][:] = 1e9
    sim, q, v = thrown()
    body_q, body_qd, M, bias = sim.body_q, sim.body_qd, sim.mass_matrix(), sim.bias_force()
    R = matrices(body_q)
    step(sim)
    q_next, v_next = to_mujoco(m, sim.joint_q), sim.joint_qd
    exact_q = np.array([robot.integrate(q[k], v_next[k].astype(float), h) for k in range(16)])
    for i in model.tables["tumbler_link"]:  # they have tests of their own
        at = slice(model.tables["link_q"][i], model.tables["link_q"][i] + 7)
        exact_q[:, at] = q_next[:, at]
    np.testing.assert_allclose(same_signs(m, q_next, exact_q), exact_q, atol=1e-5)
    for k in range(16):
        p = robot.pose(q[k], v[k])
        x, E = robot.bodies(p)
        # float32 through a chain of at most a dozen joints: a few 1e-6
        np.testing.assert_allclose(body_q[k, :, :3], x[1:], atol=2e-5)
        np.testing.assert_allclose(R[k], E[1:], atol=2e-5)
        speed = robot.body_velocities(p)[1:]
        np.testing.assert_allclose(body_qd[k], speed, atol=2e-5 * (1 + np.abs(speed).max()))
        exact = robot.mass_matrix(p) + np.diag(m.dof_armature)
        scale = np.sqrt(np.diag(exact))
        assert (np.abs(M[k] - exact) / np.outer(scale, scale)).max() <= TOLERANCE
        force = robot.bias(p)
        assert np.abs(bias[k] - force).max() <= TOLERANCE * (np.abs(force).max() + 1)

        # In the metric of Mh, where the factor has no condition number: the error against the speed
        # before the step, what forces add to it, and rounding.
        Mh, after = robot.system(q[k], v[k], target[k], h, robot.drives(), f[k], push[k])
        size = np.sqrt(v[k] @ Mh @ v[k]) + np.sqrt(after @ Mh @ after)
        error = np.where(tumbling, 0.0, v_next[k] - after)
        assert np.sqrt(error @ Mh @ error) <= TOLERANCE * size


@settings(max_examples=60, deadline=None, derandomize=True)
@given(trees())
def test_random_trees(xml):
    against_oracle(xml)


@pytest.mark.slow
@settings(max_examples=1000, deadline=None)
@given(trees())
def test_more_random_trees(xml):
    against_oracle(xml)
