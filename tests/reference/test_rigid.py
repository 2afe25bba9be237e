"""The oracle itself against MuJoCo, in float64: agreement to 1e-10 of the quantity's size."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings

from tests.reference.rigid import Rigid, random_state
from tests.reference.trees import trees
from warpdribble.assets import path

EXACT = 1e-10  # two float64 programs: their rounding, through sums of some hundred terms


def close(a, b):
    scale = max(1.0, np.abs(b).max())
    assert np.abs(a - b).max() <= EXACT * scale


def check(m, q, v, force):
    robot, data = Rigid(m), mujoco.MjData(m)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(m, data)
    p = robot.pose(q, v)
    x, R = robot.bodies(p)
    close(x, data.xpos)
    close(R, data.xmat.reshape(-1, 3, 3))
    M = np.zeros((m.nv, m.nv))
    mujoco.mj_fullM(m, data, M)
    close(robot.mass_matrix(p) + np.diag(m.dof_armature), M)
    close(robot.bias(p), data.qfrc_bias)
    applied = np.zeros(m.nv)
    for b in range(1, m.nbody):
        mujoco.mj_applyFT(m, data, force[b], np.zeros(3), data.xipos[b], b, applied)
    close(robot.external(p, force), applied)
    velocity = np.zeros(6)
    for b in range(1, m.nbody):
        mujoco.mj_objectVelocity(m, data, mujoco.mjtObj.mjOBJ_BODY, b, velocity, 0)
        # of MuJoCo's inertial frame, which sits at the centre of mass
        mine = robot.body_velocities(p)[b]
        close(np.r_[mine[3:], mine[:3]], velocity)
    energy = m.opt.enableflags
    m.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    mujoco.mj_forward(m, data)
    m.opt.enableflags = energy
    close(robot.kinetic(p), data.energy[1] - 0.5 * v @ (m.dof_armature * v))
    mujoco.mj_subtreeVel(m, data)
    total = sum(
        m.body_subtreemass[b] * data.subtree_linvel[b] for b in range(1, m.nbody) if m.body_parentid[b] == 0
    )
    close(robot.momentum(p)[3:], total)
    close(robot.momentum(p)[:3], data.subtree_angmom[0])
    close(robot.centre(p), data.subtree_com[0])


@pytest.fixture(scope="module")
def player():
    return mujoco.MjSpec.from_file(str(path("player.xml"))).compile()


def test_player(player):
    rng = np.random.default_rng(1)
    for q, v in zip(*random_state(player, rng, 5)):
        check(player, q, v, rng.standard_normal((player.nbody, 3)))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(trees())
def test_trees(xml):
    m = mujoco.MjModel.from_xml_string(xml)
    rng = np.random.default_rng(2)
    for q, v in zip(*random_state(m, rng, 2)):
        check(m, q, v, rng.standard_normal((m.nbody, 3)))


HINGES = """
<mujoco><compiler angle="radian"/><option timestep="0.01" integrator="discrete"/><worldbody>
  <body pos="0 0 2"><inertial pos="0.1 0 -0.1" mass="1.5" diaginertia="0.03 0.02 0.04"/>
    <joint name="a" axis="0 1 0" armature="0.02" damping="0.3" stiffness="4" springref="0.3"/>
    <joint name="b" axis="1 0 0" pos="0 0 -0.1" ref="0.2" armature="0.01"/>
    <body pos="0 0 -0.4"><inertial pos="0 0.05 -0.2" mass="0.7" diaginertia="0.02 0.02 0.01"/>
      <joint name="c" axis="0.6 0.8 0" damping="0.1"/></body></body>
</worldbody><actuator>
  <position joint="a" kp="200" kv="5"/><position joint="b" kp="50" kv="1" forcerange="-1000 1000"/>
  <position joint="c" kp="30" kv="0.5"/>
</actuator></mujoco>"""


def test_drive_step_is_mujoco_discrete():
    """The implicit drive step against MuJoCo's `discrete` integrator: servos, damping, stiffness."""
    m = mujoco.MjModel.from_xml_string(HINGES)
    robot, data = Rigid(m), mujoco.MjData(m)
    rng = np.random.default_rng(3)
    q, v = m.qpos0.copy(), 3 * rng.standard_normal(m.nv)
    target = q + 0.5 * rng.standard_normal(m.nq)
    data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, target
    for _ in range(50):
        q, v = robot.step(q, v, target, 0.01, robot.drives())
        mujoco.mj_step(m, data)
        close(q, data.qpos)
        close(v, data.qvel)
