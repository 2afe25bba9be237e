import mujoco
import numpy as np
import pytest

from warpdribble.sims import Model
from warpdribble.sims.reference.feedforward import holding_torques, leading_targets
from warpdribble.sims.reference.reference import Reference, difference, integrate

FEET = ("l_foot", "r_foot")
LEGS = [f"{s}_{j}" for s in "lr" for j in ("hip", "knee", "ankle", "toes")]


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module")
def lean(player):
    """A pose held for a second: the start pose with every joint bent a little."""
    bend = 0.15 * np.random.default_rng(3).normal(size=player.nv)
    bend[player.dof_slice("root")] = bend[player.dof_slice("ball")] = 0.0
    pose = integrate(player, player.start_q[None], bend[None])
    return Reference(np.tile(pose, (101, 1)), player.timestep)


def mujoco_at(player, joint_q):
    """MuJoCo's model and data at joint coordinates, at rest."""
    m = mujoco.MjModel.from_xml_path(str(player.path))
    d = mujoco.MjData(m)
    d.qpos[:] = joint_q
    for k in player.quaternions():
        d.qpos[k : k + 4] = np.roll(joint_q[k : k + 4], 1)
    mujoco.mj_forward(m, d)
    return m, d


def test_arms_and_trunk_at_rest_equal_mujoco(player, lean):
    torque = holding_torques(player, lean, FEET)[50]
    expected = mujoco_at(player, lean.joint_q[50])[1].qfrc_bias
    for name in player.joint_names:
        if name not in LEGS and player.joint_type(name) != "free":
            dofs = player.dof_slice(name)
            assert np.allclose(torque[dofs], expected[dofs], atol=1e-6), name


def test_legs_and_ground_hold_the_body_in_balance(player, lean):
    """What gravity asks for beyond our torques is a wrench at each foot and nothing else."""
    m, d = mujoco_at(player, lean.joint_q[50])
    missing = d.qfrc_bias - holding_torques(player, lean, FEET)[50]
    wrenches = []
    for foot in FEET:
        jacobian = np.zeros((6, m.nv))
        mujoco.mj_jacBody(m, d, jacobian[:3], jacobian[3:], m.body(foot).id)
        wrenches.append(jacobian)
    jacobian = np.concatenate(wrenches)
    ball = player.dof_slice("ball")
    missing[ball] = 0.0
    solved, *_ = np.linalg.lstsq(jacobian.T, missing, rcond=None)
    assert np.allclose(jacobian.T @ solved, missing, atol=1e-6)
    up = solved[[2, 8]]
    assert up.sum() == pytest.approx(76.0 * 9.81, rel=1e-6)
    assert np.all(up > 0.0)


def test_targets_of_a_pose_at_rest_differ_by_torque_over_stiffness(player, lean):
    targets = leading_targets(player, lean, FEET)
    apart = difference(player, lean.joint_q, targets)[50]
    torque = holding_torques(player, lean, FEET)[50]
    driven = 0
    for joint in player.joints:
        if joint.driven:
            assert np.allclose(joint.kp * apart[joint.dof], torque[joint.dof], atol=1e-6), joint.name
            driven += 1
        else:
            assert np.allclose(apart[joint.dof], 0.0), joint.name
    assert driven == 49 and np.abs(torque).max() > 10.0


def test_targets_lead_a_steady_motion_by_damping_over_stiffness(player):
    speed = np.zeros(player.nv)
    speed[player.dof_slice("r_elbow")] = 0.5
    times = player.timestep * np.arange(101)[:, None]
    joint_q = integrate(player, np.tile(player.start_q, (101, 1)), times * speed)
    targets = leading_targets(player, Reference(joint_q, player.timestep))
    elbow = player.joints[player.joint("r_elbow")]
    assert np.allclose((targets - joint_q)[:, elbow.q], 0.5 * elbow.kd / elbow.kp)
