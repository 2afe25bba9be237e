"""Joints and the tree: against MuJoCo's own compiler, the kernels' numbers, and paths followed by hand."""

import mujoco
import numpy as np
import pytest

from warpdribble.kernels import tree
from warpdribble.sims import Model
from warpdribble.sims.model import joints

MANY = """
<mujoco><worldbody>
<body name="a" pos="1 2 3" euler="0 0 30"><freejoint name="f"/>
  <geom size="0.1" name="one"/><geom size="0.2"/>
  <body name="b" pos="0 0 .2" euler="10 0 0">
    <joint name="h1" axis="1 0 0" pos=".1 0 0" ref="20" range="0 50" limited="true"/>
    <joint name="h2" axis="0 1 0" damping="3" armature=".5"/><geom size="0.1"/>
    <body name="w" pos="0 .3 0"><geom size="0.1"/>
      <body name="c" pos="0 .3 0"><joint name="s" type="ball" range="0 70" limited="true"/>
        <geom size="0.1"/></body>
    </body>
  </body>
</body>
<body name="post"><geom size="0.1"/></body>
</worldbody>
<actuator><position joint="h2" kp="7" kv="2" forcerange="-9 9"/></actuator></mujoco>"""


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "many.xml"
    path.write_text(MANY)
    return Model.load(path)


def compiled(model):
    return mujoco.MjModel.from_xml_path(str(model.path))


@pytest.fixture(params=["player", "many"])
def model(request):
    return request.getfixturevalue(request.param)


def test_kinds_have_the_kernels_numbers():
    assert (joints.FREE, joints.BALL, joints.HINGE) == (tree.FREE, tree.BALL, tree.HINGE)
    assert [joints.KINDS[kind] for kind in (tree.FREE, tree.BALL, tree.HINGE)] == ["free", "ball", "hinge"]


def test_joints_are_mujoco_s(model):
    """Names, places in the coordinates, bodies, axes, limits, armature."""
    m = compiled(model)
    types = {"free": mujoco.mjtJoint.mjJNT_FREE, "ball": mujoco.mjtJoint.mjJNT_BALL}
    assert len(model.joints) == m.njnt
    for j, joint in enumerate(model.joints):
        assert (joint.name, joint.body) == (m.joint(j).name, m.jnt_bodyid[j] - 1)
        assert m.jnt_type[j] == types.get(joint.kind, mujoco.mjtJoint.mjJNT_HINGE)
        q, dof = (slice(part.start, part.stop) for part in (joint.q, joint.dof))
        assert (q.start, dof.start) == (m.jnt_qposadr[j], m.jnt_dofadr[j])
        assert (model.q_slice(joint.name), model.dof_slice(joint.name)) == (q, dof)
        assert joint.limits == (tuple(m.jnt_range[j]) if m.jnt_limited[j] else None)
        assert joint.armature == m.dof_armature[dof.start]
        if joint.kind == "hinge":
            np.testing.assert_array_equal(joint.axis, m.jnt_axis[j])
            assert joint.zero == m.qpos0[q.start]
    assert [joint.dof.stop for joint in model.joints][-1] == m.nv


def test_drives(many, player):
    h1, h2, s = (many.joints[many.joint(name)] for name in ("h1", "h2", "s"))
    assert (h2.kp, h2.kd, h2.effort, h2.driven) == (7.0, 2.0, 9.0, True)
    assert (h1.kp, h1.driven, s.kp, s.driven) == (0.0, False, 0.0, False)
    m = compiled(player)
    for a in range(m.nu):
        joint = player.joints[m.actuator_trnid[a, 0]]
        assert (joint.kp, joint.kd) == (m.actuator_gainprm[a, 0], -m.actuator_biasprm[a, 2])
        assert joint.effort == m.actuator_forcerange[a, 1] and joint.driven


def test_each_coordinate_adds_or_turns(model):
    """No coordinate is left out or counted twice, and quaternions are those of turning joints."""
    at = model.coordinates
    assert sorted([*at.line_q, *at.turn_q.ravel()]) == list(range(model.nq))
    assert sorted([*at.line_dof, *at.turn_dof.ravel()]) == list(range(model.nv))
    turning = [j for j in model.joints if j.kind != "hinge"]
    assert at.turn_q.tolist() == [list(range(j.q.stop - 4, j.q.stop)) for j in turning]
    assert at.turn_dof.tolist() == [list(range(j.dof.stop - 3, j.dof.stop)) for j in turning]
    assert model.quaternions() == [j.q.stop - 4 for j in turning]
    for q, dof in zip(at.line_q, at.line_dof):
        joint = next(j for j in model.joints if j.q.start <= q < j.q.stop)
        assert dof - joint.dof.start == q - joint.q.start


def test_the_zero_pose_is_mujoco_s(model):
    """MuJoCo's reference configuration, unless a body with a free joint starts elsewhere."""
    m = compiled(model)
    d = mujoco.MjData(m)
    mujoco.mj_kinematics(m, d)
    qpos0 = m.qpos0.copy()
    for k in model.quaternions():
        qpos0[k : k + 4] = np.roll(qpos0[k : k + 4], -1)
    np.testing.assert_allclose(model.zero_q, qpos0, atol=1e-12)
    np.testing.assert_allclose(model.zero_pose[:, :3], d.xpos[1:], atol=1e-12)
    for values in (model.zero_q, model.zero_pose):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0


def test_the_tree(model):
    """Descendants are those whose way down to the ground passes the body."""
    for body in range(model.nbody):
        below = []
        for other in range(model.nbody):
            way = other
            while way not in (body, -1):
                way = int(model.body_parent[way])
            below += [other] if way == body else []
        assert model.descendants(body) == below
        assert model.children(body) == [b for b in below if model.body_parent[b] == body]
    assert model.children(-1) == [b for b in range(model.nbody) if model.body_parent[b] < 0]


def test_the_joint_of_a_body(many):
    assert many.joint_body("h1") == many.joint_body("h2") == many.body("b")
    assert many.body_joint(many.body("c")) == "s"
    for name, count in (("b", 2), ("w", 0), ("post", 0)):
        with pytest.raises(ValueError, match=f"'{name}' has {count} joints"):
            many.body_joint(many.body(name))


def test_the_first_shape(many, player):
    assert many.first_shape(many.body("a")).name == "one"
    assert player.ball_radius == player.first_shape(player.body("ball")).size[0] == 0.1193
    bare = Model.load("player", without=("ball",))
    with pytest.raises(ValueError, match="no ball"):
        _ = bare.ball_radius
    bare.shapes = []
    with pytest.raises(ValueError, match="'pelvis' of the model has no shape"):
        bare.first_shape(0)
