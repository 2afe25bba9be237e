"""The factor and one contact-free step of the player against the float64 oracle."""

import mujoco
import numpy as np
import pytest

from tests.reference import scenes
from tests.reference.rigid import Rigid, from_mujoco, random_state, same_signs, to_mujoco
from tests.reference.trees import text
from warpdribble.sims import Model, Simulation

WORLDS = 16


def fling(effort=None):
    """The player in 16 random states, drives on, in the air: (sim, oracle, q, v, target) as rounded to
    float32. Joint limits, which the oracle does not know, are off."""
    model = Model.load("player")
    model.tables["link_limited"][:] = 0
    if effort:
        model.tables["link_effort"][:] = effort
    m = mujoco.MjSpec.from_file(str(model.path)).compile()
    rng = np.random.default_rng(11)
    q, v = random_state(m, rng, WORLDS, spread=0.5)
    q[:, 2] += 10.0
    target, _ = random_state(m, rng, WORLDS, spread=0.8)
    sim = Simulation(model, WORLDS)
    ball = model.q_slice("ball").start
    q[:, ball : ball + 3] = 20.0, 0.0, 5.0  # out of reach
    sim.reset(joint_q=from_mujoco(m, q), joint_qd=v)
    sim.set_targets(from_mujoco(m, target))
    q, v = to_mujoco(m, sim.joint_q), sim.joint_qd.astype(float)
    return sim, Rigid(m), q, v, target


@pytest.fixture(scope="module")
def flung():
    """No effort limits."""
    return fling(effort=1e9)


def whitening(sim, world):
    """W with w = W qd, from the factor's s, U and d as `kernels.articulated` defines them:
    w_j = D_j^(1/2) (qd_j + U_j . V_j / D_j), V_j being the velocity of the link by the dofs before j."""
    model, state = sim.model, sim._world
    s, U, d = (sim._read(getattr(state, name))[world].astype(float) for name in ("s", "U", "d"))
    origin = sim._read(state.pos)[world].astype(float)
    t = model.tables
    joint, parent, dof = t["link_joint"], t["link_parent"], t["link_dof"]
    W = np.zeros((model.nv, model.nv))
    for i in range(1, len(joint)):
        above, a = [], parent[i]
        while a:
            above += [(a, k) for k in range(6 >> joint[a])]  # 6, 3 or 1 dofs
            a = parent[a]
        for k in range(6 >> joint[i]):
            j = dof[i] + k
            W[j, j] = 1 / d[j]
            for link, n in above + [(i, n) for n in range(k)]:
                axis = s[dof[link] + n]
                if joint[link] == 0 and n < 3:
                    V = np.r_[0, 0, 0, axis]
                else:
                    V = np.r_[axis, np.cross(axis, origin[i] - origin[link])]
                W[j, dof[link] + n] = V @ U[j]
    return W


def test_factor(flung):
    """W^T W = Mh; entries relative to sqrt(Mh_ii Mh_jj)."""
    sim, robot, q, v, target = flung
    sim.reset(joint_q=from_mujoco(robot.m, q), joint_qd=v)
    for part in ("run_kinematics", "run_inertias", "run_factorize"):
        sim.launch(part)
    w = sim._read(sim._world.w).astype(float)
    for k in range(4):
        Mh, after = robot.system(q[k], v[k], target[k], sim.model.timestep, robot.drives())
        W, scale = whitening(sim, k), np.sqrt(np.diag(Mh))
        assert (np.abs(W.T @ W - Mh) / np.outer(scale, scale)).max() <= 1e-4
        # w is the whitened free velocity
        assert w[k] @ w[k] == pytest.approx(after @ Mh @ after, rel=1e-4)
        assert np.abs(w[k] - W @ after).max() <= 1e-4 * np.linalg.norm(w[k])


def test_step(flung):
    """Every dof to 1e-4 of its root mean square: float32 through ten joints, with room."""
    sim, robot, q, v, target = flung
    h = sim.model.timestep
    sim.reset(joint_q=from_mujoco(robot.m, q), joint_qd=v)
    sim.step()
    after = [robot.system(q[k], v[k], target[k], h, robot.drives())[1] for k in range(WORLDS)]
    after, got = np.array(after), sim.joint_qd
    size = np.sqrt(np.mean(after**2, axis=0))
    assert (np.abs(got - after).max(axis=0) / size).max() <= 1e-4

    q_next = to_mujoco(robot.m, sim.joint_q)
    exact = np.array([robot.integrate(q[k], after[k], h) for k in range(WORLDS)])
    np.testing.assert_allclose(same_signs(robot.m, q_next, exact), exact, atol=2e-5)


def test_effort_limits():
    """Inverse dynamics of a step, and of the next: every drive gives what its gains ask for, or its
    limit. A fiftieth of the joints may be judged wrongly, since one drive's limit moves others."""
    sim, robot, q, v, target = fling()
    drives, h = robot.drives(), sim.model.timestep
    for _ in range(2):
        sim.step()
        after = sim.joint_qd.astype(float)
        held = [robot.obeys_effort_limits(q[k], v[k], after[k], target[k], h, drives) for k in range(WORLDS)]
        good, full = np.moveaxis(np.array(held), 1, 0)
        print(f"{100 * full.mean():.1f} % of drives at their limit, {100 * (~good).mean():.2f} % wrong")
        assert 0.02 <= full.mean() <= 0.5
        assert (~good).mean() <= 0.02
        q, v = to_mujoco(robot.m, sim.joint_q), after


def chain(rng, length):
    """Of ball joints, with gains from soft to stiff and effort limits that most of them meet."""
    inside, servos = "", []
    for j in range(length):
        place, com = rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.15, 0.15, 3)
        a, b, c = rng.uniform(0.002, 0.02, 3)
        inside = (
            f'<body pos="{text(place)}"><joint name="j{j}" type="ball" armature="0.001"/>'
            f'<inertial pos="{text(com)}" mass="{rng.uniform(0.3, 3):.6g}"'
            f' diaginertia="{text([a + b, b + c, a + c])}"/>{inside}</body>'
        )
        kp, kv = rng.uniform(20, 400), rng.uniform(0.5, 15)
        limit = kp * rng.uniform(0.05, 1)
        servos += [
            f'<position joint="j{j}" gear="{gear}" kp="{kp:.6g}" kv="{kv:.6g}"'
            f' forcerange="{text([-limit, limit])}"/>'
            for gear in ("1 0 0", "0 1 0", "0 0 1")
        ]
    return (
        f'<mujoco><option timestep="0.01"/><worldbody>{inside}</worldbody>'
        f"<actuator>{''.join(servos)}</actuator></mujoco>"
    )


def test_effort_limits_of_flung_chains():
    """Every torque at a limit points the way that is asked for, at each of 16 steps with targets that jump:
    velocities beside the exact solution's, relative to the fastest of a world's and 1 rad/s."""
    rng, off, full = np.random.default_rng(0), [], []
    for length in (2, 3, 4, 5):
        xml = chain(rng, length)
        robot, h = Rigid(mujoco.MjModel.from_xml_string(xml)), 0.01
        sim, drives = Simulation(scenes.model(xml), WORLDS), robot.drives()
        q, v = random_state(robot.m, rng, WORLDS, spread=1.0)
        sim.reset(joint_q=from_mujoco(robot.m, q), joint_qd=10 * v / np.abs(v).max())
        for k in range(16):
            if k % 8 == 0:
                target, _ = random_state(robot.m, rng, WORLDS, spread=1.5)
                sim.set_targets(from_mujoco(robot.m, target))
            q, v = to_mujoco(robot.m, sim.joint_q), sim.joint_qd.astype(float)
            sim.step()
            after = sim.joint_qd.astype(float)
            for w in np.flatnonzero(np.abs(after).max(axis=1) < 57):  # no joint at max_speed
                exact = robot.within_effort(q[w], v[w], target[w], h, drives)
                off.append(np.abs(after[w] - exact).max() / (1 + np.abs(exact).max()))
                full += [*robot.obeys_effort_limits(q[w], v[w], exact, target[w], h, drives)[1]]
    share = np.quantile(off, [0.5, 0.9, 0.99, 1])
    print(f"{100 * np.mean(full):.0f} % of drives at their limit, velocities off by {share}")
    assert len(off) > 600 and np.mean(full) > 0.3
    assert (share <= [1e-5, 1e-3, 1e-2, 0.1]).all()


def test_quaternions_stay_unit():
    """Their length drifts by rounding unless it is renewed: 1000 steps."""
    sim = Simulation(Model.load("player"), 4)
    sim.apply_force("torso", [0.0, 60.0, 0.0], [1])
    sim.step(1000)
    for k in sim.model.quaternions():
        np.testing.assert_allclose(np.linalg.norm(sim.joint_q[:, k : k + 4], axis=1), 1, atol=1e-6)
