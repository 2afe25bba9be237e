import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model
from warpdribble.sims.model import pose
from warpdribble.takes import usdphysics
from warpdribble.takes.take import Take, validate, write_take

SMALL = """<mujoco><option gravity="0 3 -4"/><size nuser_geom="3"/><worldbody>
<geom name="ground" type="plane" size="0 0 1"/>
<body name="post" pos="0 0 1"><geom name="post" type="box" size=".1 .2 .3" rgba=".2 .2 .2 1"/>
  <body name="door" pos=".1 0 0"><joint name="hinge" type="hinge" axis="0 0 1" pos="0 .2 0" range="-1 1.5"/>
    <geom type="box" size=".3 .02 .4" pos=".3 0 0" euler="0 20 0"/> <body name="knob" pos=".5 0 0"><geom
    type="sphere" size=".04" contype="0" conaffinity="0"/></body></body></body>
<body name="arm" pos="2 0 1"><joint name="a" type="hinge" axis="0 1 0"/><joint name="b" type="hinge" axis="1 0
0"/>
  <geom name="arm" type="capsule" size=".05 .2" pos="0 0 -.2" user="0.5 0.2 1e-5" friction="0.3 0 0"/></body>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def stage(dribble_take, tmp_path_factory):
    path = write_take(tmp_path_factory.mktemp("take") / "take.usdc", dribble_take)
    return Usd.Stage.Open(str(path))


@pytest.fixture
def small(tmp_path):
    (tmp_path / "small.xml").write_text(SMALL)
    model = Model.load(tmp_path / "small.xml")
    joint_q = np.tile(model.start_q, (3, 1))
    return Take.of(model, pose.forward(model, joint_q), 10.0)


def bodies(stage):
    return {p.GetName(): p for p in stage.Traverse() if p.HasAPI(UsdPhysics.RigidBodyAPI)}


def test_every_body_has_its_mass_centre_and_inertia(stage, shipped_player):
    prims = bodies(stage)
    assert len(prims) == shipped_player.nbody
    for body, name in enumerate(shipped_player.body_names):
        mass = UsdPhysics.MassAPI(prims["Ball" if name == "ball" else name])
        assert mass.GetMassAttr().Get() == pytest.approx(shipped_player.body_mass[body], rel=1e-6)
        assert np.allclose(mass.GetCenterOfMassAttr().Get(), shipped_player.body_com[body], atol=1e-7)
        turn = mass.GetPrincipalAxesAttr().Get()
        axes = Rotation.from_quat([*turn.GetImaginary(), turn.GetReal()]).as_matrix()
        tensor = axes @ np.diag(mass.GetDiagonalInertiaAttr().Get()) @ axes.T
        assert np.allclose(tensor, shipped_player.body_inertia[body], rtol=1e-4, atol=1e-10)


def test_principal_axes_turn_the_right_way_round():
    turn = Rotation.from_rotvec([0.4, -0.8, 0.3])
    tensor = turn.as_matrix() @ np.diag([1.0, 2.0, 4.0]) @ turn.as_matrix().T
    moments, quat = usdphysics.principal(tensor)
    axes = Rotation.from_quat(quat).as_matrix()
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert np.allclose(axes @ np.diag(moments) @ axes.T, tensor)


def test_one_articulation_begins_at_the_pelvis(stage):
    roots = [p.GetName() for p in stage.Traverse() if p.HasAPI(UsdPhysics.ArticulationRootAPI)]
    assert roots == ["pelvis"]


def test_gravity_is_the_models(stage):
    scene = UsdPhysics.Scene.Get(stage, "/World/PhysicsScene")
    assert np.allclose(scene.GetGravityDirectionAttr().Get(), [0.0, 0.0, -1.0])
    assert scene.GetGravityMagnitudeAttr().Get() == pytest.approx(9.81)


def test_colliders_are_guides_with_the_shapes_materials(stage, shipped_player):
    colliders = [p for p in stage.Traverse() if p.HasAPI(UsdPhysics.CollisionAPI)]
    assert len(colliders) == len(shipped_player.shapes)
    for prim in colliders:
        assert UsdGeom.Imageable(prim).GetPurposeAttr().Get() == "guide"
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
        contact = UsdPhysics.MaterialAPI(material)
        kind = {"Ball": 0.8, "Court": 1.0}.get(prim.GetParent().GetName(), 0.0)
        assert contact.GetRestitutionAttr().Get() == pytest.approx(kind)
        assert contact.GetDynamicFrictionAttr().Get() == pytest.approx(0.8)
        assert contact.GetStaticFrictionAttr().Get() == pytest.approx(0.8)


def test_colliders_are_where_the_shapes_are(stage, shipped_player, dribble_take):
    for name in ("l_hand", "r_lower_arm_b", "head_a"):
        shape = next(s for s in shipped_player.shapes if s.name == name)
        body = shipped_player.body_names[shape.body]
        number = [s.name for s in shipped_player.shapes if s.body == shape.body].index(name) + 1
        suffix = f"_{number}" if number > 1 else ""
        prim = stage.GetPrimAtPath(f"/World/Player/{body}/{body}_collider{suffix}")
        place = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
        q = dribble_take.body_q[0, shape.body]
        turn = Rotation.from_quat(q[3:])
        assert np.allclose(place[3, :3], q[:3] + turn.apply(shape.pos), atol=1e-5)
        axis = (turn * Rotation.from_quat(shape.quat)).apply([0.0, 0.0, 1.0])
        assert np.allclose(place[2, :3] / np.linalg.norm(place[2, :3]), axis, atol=1e-5)


def filtered(stage):
    """Pairs of names whose collisions are filtered."""
    found = set()
    for prim in stage.Traverse():
        for other in UsdPhysics.FilteredPairsAPI(prim).GetFilteredPairsRel().GetTargets():
            found.add(frozenset((prim.GetName(), other.name)))
    return found


def test_the_player_does_not_meet_itself_but_the_ball_and_the_ground(stage, shipped_player):
    pairs = filtered(stage)
    own = [name for name in shipped_player.body_names if name != "ball"]
    assert pairs == {frozenset((a, b)) for a in own for b in own if a < b}


def test_bodies_that_a_file_excludes_are_filtered(tmp_path):
    (tmp_path / "m.xml").write_text(
        """<mujoco><worldbody><body name="a"><freejoint/><geom size=".1"/></body>
        <body name="b" pos="1 0 0"><freejoint/><geom size=".1"/></body>
        <body name="c" pos="2 0 0"><freejoint/><geom size=".1"/></body></worldbody>
        <contact><exclude body1="a" body2="c"/></contact></mujoco>"""
    )
    model = Model.load(tmp_path / "m.xml")
    take = Take.of(model, model.zero_pose[None], 10.0)
    stage = Usd.Stage.Open(str(write_take(tmp_path / "m.usdc", take)))
    assert filtered(stage) == {frozenset(("a", "c"))}


def test_shapes_that_meet_in_part_are_filtered_one_by_one(tmp_path):
    (tmp_path / "m.xml").write_text(
        """<mujoco><worldbody><body name="a"><freejoint name="fa"/><geom type="sphere" size=".1" contype="1"
        conaffinity="2"/><geom type="sphere" size=".1" pos="0 0 .3" contype="4" conaffinity="8"/></body> <body
        name="b" pos="1 0 0"><freejoint name="fb"/><geom type="sphere" size=".1" contype="2" conaffinity="1"/>
        </body></worldbody></mujoco>"""
    )
    model = Model.load(tmp_path / "m.xml")
    take = Take.of(model, pose.forward(model, model.start_q[None]), 10.0)
    stage = Usd.Stage.Open(str(write_take(tmp_path / "m.usdc", take)))
    assert filtered(stage) == {frozenset(("a_collider_2", "b_collider"))}


def test_any_model_has_valid_physics(small, tmp_path):
    path = write_take(tmp_path / "small.usda", small)
    assert validate(path) == []
    stage = Usd.Stage.Open(str(path))
    assert set(bodies(stage)) == {"door", "knob", "arm"}
    scene = UsdPhysics.Scene.Get(stage, "/World/PhysicsScene")
    assert np.allclose(scene.GetGravityDirectionAttr().Get(), [0.0, 0.6, -0.8])
    assert scene.GetGravityMagnitudeAttr().Get() == pytest.approx(5.0)
    knob = stage.GetPrimAtPath("/World/Player/knob")
    assert not [c for c in knob.GetChildren() if c.HasAPI(UsdPhysics.CollisionAPI)]
    arm = stage.GetPrimAtPath("/World/Player/arm/arm_collider")
    material, _ = UsdShade.MaterialBindingAPI(arm).ComputeBoundMaterial("physics")
    contact = UsdPhysics.MaterialAPI(material)
    assert contact.GetRestitutionAttr().Get() == pytest.approx(0.5)
    assert contact.GetDynamicFrictionAttr().Get() == pytest.approx(0.3)


def test_a_take_without_a_model_has_no_physics(dribble_take, tmp_path):
    take = Take(dribble_take.body_names, dribble_take.shapes, dribble_take.body_q, 50.0)
    stage = Usd.Stage.Open(str(write_take(tmp_path / "plain.usdc", take)))
    assert not [p for p in stage.Traverse() if p.GetTypeName().startswith("Physics")]
    assert not bodies(stage)
