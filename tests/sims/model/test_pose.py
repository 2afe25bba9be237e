import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model
from warpdribble.sims.model import pose


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def random_q(model, count, seed=0):
    q = np.random.default_rng(seed).normal(size=(count, model.nq))
    for k in model.quaternions():
        q[:, k : k + 4] /= np.linalg.norm(q[:, k : k + 4], axis=1, keepdims=True)
    return q


def test_forward_kinematics_equal_mujoco(player):
    m = mujoco.MjModel.from_xml_path(str(player.path))
    d = mujoco.MjData(m)
    joint_q = random_q(player, 20)
    body_q = pose.forward(player, joint_q)
    for row, q in enumerate(joint_q):
        qpos = q.copy()
        for k in player.quaternions():
            qpos[k : k + 4] = np.roll(q[k : k + 4], 1)
        d.qpos[:] = qpos
        mujoco.mj_kinematics(m, d)
        assert np.allclose(body_q[row, :, :3], d.xpos[1:], atol=1e-12)
        turn = Rotation.from_quat(body_q[row, :, 3:])
        assert np.allclose(turn.as_matrix(), d.xmat[1:].reshape(-1, 3, 3), atol=1e-12)


def test_bodies_of_the_zero_pose_are_aligned_with_the_world(player):
    body_q = player.zero_pose
    assert np.allclose(np.abs(body_q[:, 6]), 1.0)
    assert body_q[player.body("l_hand"), 1] > 0.5 > -0.5 > body_q[player.body("r_hand"), 1]
    assert body_q[player.body("l_toes"), 0] > body_q[player.body("l_foot"), 0]


@pytest.mark.parametrize("seed", range(20))
def test_some_bodies_are_where_all_have_them(player, seed):
    """To the bit; the others are nowhere."""
    random = np.random.default_rng(seed)
    bodies = set(random.integers(-1, player.nbody, size=seed).tolist())
    joint_q = random_q(player, 3, seed)
    some, all_of_them = pose.forward(player, joint_q, bodies), pose.forward(player, joint_q)
    for body in range(player.nbody):
        if body in bodies:
            np.testing.assert_array_equal(some[:, body], all_of_them[:, body])
        else:
            assert np.isnan(some[:, body]).all()


def test_a_limb_of_the_world_is_placed(tmp_path):
    """The body above it is no body."""
    path = tmp_path / "arm.xml"
    path.write_text("""<mujoco><worldbody>
        <body name="a" pos="0 0 1"><joint name="s" type="ball"/><geom size="0.1"/>
        <body name="b" pos="0 0 -.4"><joint name="e" axis="0 1 0"/><geom size="0.1"/>
        <body name="c" pos="0 0 -.4"><joint name="w" type="ball"/><geom size="0.1"/></body></body></body>
        <body name="z" pos="5 5 5"><joint name="zz" type="ball"/><geom size="0.1"/></body>
        </worldbody></mujoco>""")
    model = Model.load(path)
    q = random_q(model, 1, seed=3)
    end, turn = np.array([0.3, -0.2, 0.6]), Rotation.random(1, random_state=0)
    pose.place_limb(model, q, "e", end, turn, [0.0, 1.0, 0.3])
    placed = pose.forward(model, q)[0, model.body("c")]
    np.testing.assert_allclose(placed[:3], end, atol=1e-12)
    assert (Rotation.from_quat(placed[3:]).inv() * turn).magnitude().max() < 1e-7


def test_twist_is_the_nearest_angle_about_an_axis():
    axis = np.array([0.0, 0.0, 1.0])
    turn = Rotation.from_rotvec([0.0, 0.0, 2.5]) * Rotation.from_rotvec([0.2, -0.1, 0.0])
    grid = np.linspace(-np.pi, np.pi, 20001)
    left = (Rotation.from_rotvec(grid[:, None] * axis).inv() * turn).magnitude()
    assert pose.twist(turn, axis) == pytest.approx(grid[left.argmin()], abs=1e-3)


def test_a_limb_reaches_where_it_is_told_and_bends_at_positive_angles():
    rng = np.random.default_rng(1)
    limb = pose.Limb(np.array([0, 0, -0.44]), np.array([0.01, 0, -0.45]), np.array([0, 1.0, 0]))
    start = rng.normal(size=(200, 3))
    way = rng.normal(size=(200, 3))
    way *= rng.uniform(0.2, 0.88, (200, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    turn, angle = limb.solve(start, start + way, rng.normal(size=(200, 3)))
    knee = start + turn.apply(limb.upper)
    lower = turn * Rotation.from_rotvec(angle[:, None] * limb.axis)
    assert np.allclose(knee + lower.apply(limb.lower), start + way, atol=1e-9)
    assert np.all(angle > 0.0)


def test_a_limb_stretches_toward_what_it_cannot_reach():
    limb = pose.Limb(np.array([0, 0, -0.4]), np.array([0, 0, -0.4]), np.array([0, 1.0, 0]))
    turn, angle = limb.solve(np.zeros((1, 3)), np.array([[2.0, 0, 0]]), np.array([[0, 1.0, 0]]))
    assert angle[0] == pytest.approx(0.0, abs=1e-6)
    assert np.allclose(turn.apply([0, 0, -1.0]), [[1.0, 0, 0]])
