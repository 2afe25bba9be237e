import numpy as np
import pytest
from pxr import Usd, UsdPhysics
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model
from warpdribble.sims.model import pose
from warpdribble.takes import usdjoints
from warpdribble.takes.take import Take, validate, write_take

JOINTS = "/World/Player/Joints"


@pytest.fixture(scope="module", params=usdjoints.KINDS)
def kind(request):
    return request.param


@pytest.fixture(scope="module")
def stages(dribble_take, tmp_path_factory):
    folder = tmp_path_factory.mktemp("takes")
    return {
        kind: Usd.Stage.Open(str(write_take(folder / f"{kind}.usdc", dribble_take, joints=kind)))
        for kind in usdjoints.KINDS
    }


def turn_of(quat) -> Rotation:
    return Rotation.from_quat([*quat.GetImaginary(), quat.GetReal()])


def ends(joint, take):
    """The joint's frame, seen from its two bodies at frame 0: two (position, rotation) in the world."""
    found = []
    for rel, p, r in (
        (joint.GetBody0Rel(), joint.GetLocalPos0Attr(), joint.GetLocalRot0Attr()),
        (joint.GetBody1Rel(), joint.GetLocalPos1Attr(), joint.GetLocalRot1Attr()),
    ):
        q = take.body_q[0, take.body_names.index(rel.GetTargets()[0].name)]
        turn = Rotation.from_quat(q[3:])
        found.append((q[:3] + turn.apply(p.Get()), turn * turn_of(r.Get())))
    return found


def test_every_way_is_valid(dribble_take, tmp_path, kind):
    assert validate(write_take(tmp_path / "take.usdc", dribble_take, joints=kind)) == []


def test_the_bodies_are_joined_where_they_touch(stages, dribble_take, kind):
    joints = [UsdPhysics.Joint(p) for p in stages[kind].GetPrimAtPath(JOINTS).GetChildren()]
    assert len(joints) == {"revolute": 23 * 3 + 26, "d6": 49, "spherical": 49}[kind]
    for joint in joints:
        (a, _), (b, _) = ends(joint, dribble_take)
        assert np.allclose(a, b, atol=2e-6), joint.GetPath()


def test_a_hinge_stands_at_its_angle(stages, dribble_take, shipped_player):
    for name in ("r_elbow", "l_knee", "r_index_pip", "l_thumb_dip"):
        prim = stages["revolute"].GetPrimAtPath(f"{JOINTS}/{name}")
        joint = UsdPhysics.RevoluteJoint(prim)
        (_, a), (_, b) = ends(joint, dribble_take)
        seen = (a.inv() * b).as_rotvec()
        limits = shipped_player.tables["link_lower"], shipped_player.tables["link_upper"]
        link = shipped_player.joint_link[shipped_player.joint(name)]
        assert joint.GetAxisAttr().Get() == "X" and np.allclose(seen[1:], 0.0, atol=1e-5)
        drive = UsdPhysics.DriveAPI(prim, "angular")
        assert drive.GetTargetPositionAttr().Get() == pytest.approx(np.degrees(seen[0]), abs=1e-3)
        assert joint.GetLowerLimitAttr().Get() == pytest.approx(np.degrees(limits[0][link]), rel=1e-5)
        assert joint.GetUpperLimitAttr().Get() == pytest.approx(np.degrees(limits[1][link]), rel=1e-5)


def test_gains_are_per_degree(stages):
    """A drive of 500 N m/rad, 50 N m s/rad, 400 N m at the hip; the same torque for the same bend."""
    hips = (
        UsdPhysics.DriveAPI(stages["revolute"].GetPrimAtPath(f"{JOINTS}/l_hip_y"), "angular"),
        UsdPhysics.DriveAPI(stages["d6"].GetPrimAtPath(f"{JOINTS}/l_hip"), "rotY"),
    )
    for drive in hips:
        assert drive.GetTypeAttr().Get() == "force"
        assert drive.GetStiffnessAttr().Get() * 57.29578 == pytest.approx(500.0, rel=1e-6)
        assert drive.GetDampingAttr().Get() * 57.29578 == pytest.approx(50.0, rel=1e-6)
        assert drive.GetMaxForceAttr().Get() == pytest.approx(400.0)


def test_engines_are_told_the_armature_and_where_a_hinge_starts(stages):
    hip = stages["d6"].GetPrimAtPath(f"{JOINTS}/l_hip")
    elbow = stages["revolute"].GetPrimAtPath(f"{JOINTS}/l_elbow")
    part = stages["revolute"].GetPrimAtPath(f"{JOINTS}/l_hip_y")
    for prim, armature in ((hip, 0.02), (elbow, 0.01), (part, 0.02)):
        for name in ("newton:armature", "physxJoint:armature"):
            assert prim.GetAttribute(name).Get() == pytest.approx(armature)
    start = UsdPhysics.DriveAPI(elbow, "angular").GetTargetPositionAttr().Get()
    assert elbow.GetAttribute("mjc:ref").Get() == pytest.approx(start, rel=1e-6)
    assert not part.HasAttribute("mjc:ref")


def test_a_ball_joint_stands_at_its_euler_angles(stages, dribble_take):
    joint = UsdPhysics.Joint(stages["d6"].GetPrimAtPath(f"{JOINTS}/r_shoulder"))
    (_, a), (_, b) = ends(joint, dribble_take)
    targets = [
        UsdPhysics.DriveAPI(joint.GetPrim(), f"rot{axis}").GetTargetPositionAttr().Get() for axis in "XYZ"
    ]
    assert np.abs(targets).max() > 10.0
    assert np.allclose(Rotation.from_euler("XYZ", targets, degrees=True).as_matrix(),
                       (a.inv() * b).as_matrix(), atol=1e-5)  # fmt: skip
    for axis, name in zip("XYZ", "xyz"):
        prim = stages["revolute"].GetPrimAtPath(f"{JOINTS}/r_shoulder_{name}")
        turned = turn_of(UsdPhysics.Joint(prim).GetLocalRot1Attr().Get()).apply([1.0, 0.0, 0.0])
        own = turn_of(joint.GetLocalRot1Attr().Get()).apply(np.eye(3)["XYZ".index(axis)])
        assert np.allclose(turned, own, atol=1e-6)


def test_d6_locks_what_cannot_move(stages):
    prim = stages["d6"].GetPrimAtPath(f"{JOINTS}/l_ankle")
    for axis in "XYZ":
        lock = UsdPhysics.LimitAPI(prim, f"trans{axis}")
        assert lock.GetLowAttr().Get() > lock.GetHighAttr().Get()
        assert UsdPhysics.LimitAPI(prim, f"rot{axis}").GetHighAttr().Get() == pytest.approx(np.degrees(0.9))


def test_a_cone_goes_around_the_bone(stages):
    for name, axis in (("l_shoulder", "Y"), ("r_hip", "Z"), ("lower_back", "Z")):
        joint = UsdPhysics.SphericalJoint(stages["spherical"].GetPrimAtPath(f"{JOINTS}/{name}"))
        assert joint.GetAxisAttr().Get() == axis
        assert joint.GetConeAngle0LimitAttr().Get() == joint.GetConeAngle1LimitAttr().Get() > 50.0


def test_joints_with_an_offset_and_two_in_a_body(tmp_path):
    (tmp_path / "m.xml").write_text(
        """<mujoco><worldbody><body name="door" pos="1 0 0" euler="0 0 30">
        <joint name="hinge" type="hinge" axis="0 0 1" pos="0 .2 0" ref="20" range="-10 80"/>
        <geom type="box" size=".3 .02 .4"/>
        <body name="arm" pos="0 0 1"><joint name="a" type="hinge" axis="0 1 0" pos="0 0 .1"/>
        <joint name="b" type="hinge" axis="1 0 0" pos="0 .1 0"/><geom type="sphere" size=".1"/></body>
        </body></worldbody></mujoco>"""
    )
    model = Model.load(tmp_path / "m.xml")
    q = np.array([[0.7, 0.0, 0.0]])
    take = Take.of(model, pose.forward(model, q), 10.0)
    stage = Usd.Stage.Open(str(write_take(tmp_path / "m.usdc", take)))
    hinge = UsdPhysics.RevoluteJoint(stage.GetPrimAtPath(f"{JOINTS}/hinge"))
    assert stage.GetPrimAtPath("/World/Player/door").HasAPI(UsdPhysics.ArticulationRootAPI)
    assert hinge.GetBody0Rel().GetTargets() == []
    turn = Rotation.from_quat(take.body_q[0, 0, 3:])
    place = take.body_q[0, 0, :3] + turn.apply(hinge.GetLocalPos1Attr().Get())
    assert np.allclose(place, hinge.GetLocalPos0Attr().Get(), atol=1e-6)
    seen = turn_of(hinge.GetLocalRot0Attr().Get()).inv() * turn * turn_of(hinge.GetLocalRot1Attr().Get())
    zero = np.radians(20.0)
    assert seen.as_rotvec()[0] == pytest.approx(0.7 - zero, abs=1e-6)
    assert hinge.GetLowerLimitAttr().Get() == pytest.approx(-30.0, abs=1e-4)
    assert hinge.GetUpperLimitAttr().Get() == pytest.approx(60.0, abs=1e-4)
    for name in ("a", "b"):
        (a, _), (b, _) = ends(UsdPhysics.Joint(stage.GetPrimAtPath(f"{JOINTS}/{name}")), take)
        assert np.allclose(a, b, atol=1e-6)


def test_a_drive_without_an_effort_limit_is_a_drive(tmp_path):
    (tmp_path / "m.xml").write_text(
        """<mujoco><worldbody><body name="door"><joint name="hinge"/><geom size=".1"/></body>
        <body name="free" pos="1 0 0"><joint name="loose"/><geom size=".1"/></body></worldbody>
        <actuator><position joint="hinge" kp="30" kv="2"/></actuator></mujoco>"""
    )
    model = Model.load(tmp_path / "m.xml")
    take = Take.of(model, pose.forward(model, model.start_q[None]), 10.0)
    stage = Usd.Stage.Open(str(write_take(tmp_path / "m.usdc", take)))
    drive = UsdPhysics.DriveAPI(stage.GetPrimAtPath(f"{JOINTS}/hinge"), "angular")
    assert drive.GetStiffnessAttr().Get() * 57.29578 == pytest.approx(30.0, rel=1e-6)
    assert drive.GetDampingAttr().Get() * 57.29578 == pytest.approx(2.0, rel=1e-6)
    assert np.isinf(drive.GetMaxForceAttr().Get())
    assert not stage.GetPrimAtPath(f"{JOINTS}/loose").HasAPI(UsdPhysics.DriveAPI)


def test_an_unknown_way_is_refused(dribble_take, tmp_path):
    with pytest.raises(ValueError, match="revolute, d6, spherical"):
        write_take(tmp_path / "take.usdc", dribble_take, joints="rubber")
    assert list(tmp_path.iterdir()) == []


def test_frames_invert():
    frame = usdjoints.Frame(np.array([1.0, 2.0, 3.0]), Rotation.from_rotvec([0.3, 0.2, -0.5]))
    back = frame.inverse() @ frame
    assert np.allclose(back.p, 0.0) and back.R.magnitude() == pytest.approx(0.0, abs=1e-12)


SPRUNG = """
<mujoco><default><joint axis="0 1 0" damping=".4"/><geom size=".1"/></default><worldbody>
<body name="base" pos="0 0 1"><freejoint name="root"/><geom/>
<body name="soft"><joint name="soft" stiffness="3" springref="30"/><geom/></body>
<body name="damped"><joint name="damped"/><geom/></body>
<body name="open"><joint name="open" stiffness="3"/><geom/></body>
<body name="capped"><joint name="capped" stiffness="3"/><geom/></body>
<body name="ball"><joint name="ball" type="ball" stiffness="3"/><geom/></body></body></worldbody><actuator>
<position joint="open" kp="9" kv="2"/><position joint="capped" kp="9" kv="2" forcerange="-5 5"/></actuator>
</mujoco>
"""


def sprung_stage(tmp_path, kind, angle=0.5):
    (tmp_path / "m.xml").write_text(SPRUNG)
    model = Model.load(tmp_path / "m.xml")
    q = model.start_q.copy()
    q[7:11] = angle
    path = write_take(tmp_path / "m.usdc", Take.of(model, pose.forward(model, q[None]), 10.0), joints=kind)
    assert validate(path) == []
    return Usd.Stage.Open(str(path)), model


def said(prim, where="angular"):
    """Torque of a drive at 0.1 rad and 0.2 rad/s, and its limit, from what the file says."""
    drive = UsdPhysics.DriveAPI(prim, where)
    target, kp, kd = (
        a.Get() for a in (drive.GetTargetPositionAttr(), drive.GetStiffnessAttr(), drive.GetDampingAttr())
    )
    return kp * (target - np.degrees(0.1)) - kd * np.degrees(0.2), drive.GetMaxForceAttr().Get()


def test_springs_and_dampers_are_drives(tmp_path, kind):
    """The torque that they and the servo make together in the model, limits apart."""
    stage, _ = sprung_stage(tmp_path, kind)
    torques = {
        "soft": 3 * (np.radians(30) - 0.1) - 0.4 * 0.2,
        "damped": -0.4 * 0.2,
        "open": 9 * (0.5 - 0.1) + 3 * (0 - 0.1) - 2.4 * 0.2,
    }
    for name, torque in torques.items():
        found, limit = said(stage.GetPrimAtPath(f"{JOINTS}/{name}"))
        assert found == pytest.approx(torque, rel=1e-5) and np.isinf(limit)
        assert not stage.GetPrimAtPath(f"{JOINTS}/{name}").HasAttribute("newton:damping")
    ball = {"d6": ("ball", "rotY"), "revolute": ("ball_y", "angular")}.get(kind)
    if ball:
        found, limit = said(stage.GetPrimAtPath(f"{JOINTS}/{ball[0]}"), ball[1])
        assert found == pytest.approx(3 * (0 - 0.1) - 0.4 * 0.2, rel=1e-5) and np.isinf(limit)


def test_a_damper_beside_a_limited_servo_has_a_word_of_its_own(tmp_path, kind):
    stage, _ = sprung_stage(tmp_path, kind)
    prim = stage.GetPrimAtPath(f"{JOINTS}/capped")
    found, limit = said(prim)
    assert found == pytest.approx(9 * 0.4 - 2 * 0.2, rel=1e-5) and limit == 5.0
    assert prim.GetAttribute("newton:damping").Get() * 57.29578 == pytest.approx(0.4, rel=1e-6)


def test_what_usd_has_no_word_for_is_said(tmp_path, kind, dribble_take, shipped_player):
    stage, model = sprung_stage(tmp_path, kind)
    lost = usdjoints.left_out(model, kind)
    assert lost == [f"spring of {'capped, ball' if kind == 'spherical' else 'capped'}"]
    assert stage.GetRootLayer().customLayerData["left out"] == lost[0]
    servos = usdjoints.left_out(shipped_player, kind)
    assert servos == (["servo of lower_back, torso, neck and 20 others"] if kind == "spherical" else [])


def test_damping_of_a_free_body_is_left_out_aloud(tmp_path):
    (tmp_path / "m.xml").write_text(
        '<mujoco><worldbody><body><joint name="f" type="free" damping="2" armature="1"/>'
        '<geom size=".1"/></body></worldbody></mujoco>'
    )
    model = Model.load(tmp_path / "m.xml")
    assert usdjoints.left_out(model, "d6") == ["passive damping of f", "armature of f"]


@pytest.mark.parametrize(
    "limits, degrees, told",
    [
        ("0 300", 230, 230),
        ("0 300", 10, 10),
        ("-300 0", -250, -250),
        ("-20 70", 40, 40),
        ("180 340", 200, 200),
        ("400 700", 500, 500),
        ("0 300", 359, -1),  # past its limit by one, not by 59
        (None, 230, -130),
    ],
)
def test_a_hinge_is_said_within_its_limits(tmp_path, limits, degrees, told):
    """Poses do not tell whole turns apart: the limits do, in the file's own degrees."""
    limited = f'limited="true" range="{limits}"' if limits else ""
    (tmp_path / "m.xml").write_text(
        f'<mujoco><worldbody><body name="b"><joint name="j" axis="0 .6 -.8" {limited}/><geom size=".1"/>'
        '</body></worldbody><actuator><position joint="j" kp="9"/></actuator></mujoco>'
    )
    model = Model.load(tmp_path / "m.xml")
    take = Take.of(model, pose.forward(model, np.radians([[float(degrees)]])), 10.0)
    stage = Usd.Stage.Open(str(write_take(tmp_path / "m.usdc", take)))
    prim = stage.GetPrimAtPath(f"{JOINTS}/j")
    target = UsdPhysics.DriveAPI(prim, "angular").GetTargetPositionAttr().Get()
    assert target == pytest.approx(told, abs=1e-3) and (target - degrees) % 360 == pytest.approx(0, abs=1e-3)
    assert prim.GetAttribute("mjc:ref").Get() == pytest.approx(told, abs=1e-3)
    if limits:
        joint = UsdPhysics.RevoluteJoint(prim)
        found = (joint.GetLowerLimitAttr().Get(), joint.GetUpperLimitAttr().Get())
        assert found == pytest.approx([float(number) for number in limits.split()], rel=1e-5)
