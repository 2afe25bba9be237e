"""What a model says of itself, and what it refuses."""

import mujoco
import numpy as np
import pytest

from tests.reference import scenes
from warpdribble.sims import Model, ModelError

BODY = '<body name="b"><joint name="j"/><geom name="g" size="0.1"/></body>'


def mjcf(worldbody=BODY, rest="", option="", before="") -> str:
    return f"<mujoco>{before}<option {option}/><worldbody>{worldbody}</worldbody>{rest}</mujoco>"


def joint(attributes):
    return mjcf(f'<body><joint name="j" {attributes}/><geom size="0.1"/></body>')


def geom(attributes, before=""):
    return mjcf(f'<body><joint/><geom name="g" {attributes}/></body>', before=before)


def actuator(text, kind="hinge"):
    return mjcf(
        f'<body><joint name="j" type="{kind}"/><geom size="0.1"/></body>',
        rest=f"<actuator>{text}</actuator>",
    )


MESH = '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>'
TWO = '<body name="a"><joint name="ja"/><geom name="ga" size="0.1"/></body>'
TWO += '<body name="b" pos="1 0 0"><joint name="jb"/><geom name="gb" size="0.1"/></body>'

REFUSED = {
    "slide joint": (joint('type="slide"'), "slide joint 'j'"),
    "free joint in a tree": (
        mjcf(
            '<body><joint/><geom size="0.1"/><body><joint name="f" type="ball"/>'
            '<geom size="0.1"/></body></body><body><freejoint name="f2"/><geom size="0.1"/></body>'
        ).replace('<joint name="f" type="ball"/>', '<joint name="f" type="free"/>'),
        "free",
    ),
    "mesh": (geom('type="mesh" mesh="m"', before=MESH), "mesh geom 'g'"),
    "cylinder": (geom('type="cylinder" size="0.1 0.1"'), "cylinder geom 'g'"),
    "ellipsoid": (geom('type="ellipsoid" size="0.1 0.1 0.2"'), "ellipsoid geom 'g'"),
    "condim 4": (geom('size="0.1" condim="4"'), "condim 4 of geom 'g'"),
    "condim 6": (geom('size="0.1" condim="6"'), "condim 6 of geom 'g'"),
    "frictionloss": (joint('frictionloss="0.1"'), "frictionloss 0.1 of joint 'j'"),
    "free joint stiffness": (joint('type="free" stiffness="3"'), "stiffness of free joint 'j'"),
    "moving plane": (
        mjcf('<body><joint/><geom size="0.1"/><geom name="p" type="plane" size="1 1 1"/></body>'),
        "plane",  # MuJoCo's compiler already says so
    ),
    "equality": (mjcf(TWO, rest='<equality><joint joint1="ja" joint2="jb"/></equality>'), "equality"),
    "limit that gives way": (
        joint('range="0 1" limited="true" solreflimit="0.5 1"'),
        "solreflimit 0.5 1 of joint 'j'",
    ),
    "soft contact": (geom('size="0.1" solref="0.2 1"'), "solref 0.2 1 of geom 'g'"),
    "parent filter": (
        mjcf().replace("<option />", '<option><flag filterparent="disable"/></option>'),
        "option flag filterparent='disable'",
    ),
    "tendon": (
        mjcf(TWO, rest='<tendon><fixed stiffness="3"><joint joint="ja" coef="1"/></fixed></tendon>'),
        "stiffness 3 of tendon '0'",
    ),
    "contact pair": (mjcf(TWO, rest='<contact><pair geom1="ga" geom2="gb"/></contact>'), "contact pair"),
    "mocap": (mjcf(BODY + '<body mocap="true"><geom size="0.1"/></body>'), "mocap"),
    "fluid": (mjcf(option='density="1.2"'), "option density"),
    "viscosity": (mjcf(option='viscosity="0.1"'), "option viscosity"),
    "velocity servo": (actuator('<velocity name="a" joint="j" kv="1"/>'), "actuator 'a'"),
    "muscle": (actuator('<muscle name="a" joint="j" lengthrange="0.1 1"/>'), "actuator 'a'"),
    "integrated velocity": (
        actuator('<intvelocity name="a" joint="j" kp="1" actrange="-1 1"/>'),
        "actuator 'a'",
    ),
    "gear 0": (actuator('<position name="a" joint="j" kp="1" gear="0"/>'), "actuator 'a': gear"),
    "constant torque": (
        actuator('<general name="a" joint="j" biastype="affine" gainprm="1" biasprm="5 -1 0"/>'),
        "actuator 'a' is not a position servo",
    ),
    "gain that follows the joint": (
        actuator('<general name="a" joint="j" gaintype="affine" gainprm="1 1 0"/>'),
        "actuator 'a'",
    ),
    "filtered servo": (
        actuator('<position name="a" joint="j" kp="1" timeconst="0.1"/>'),
        "actuator 'a': activation filterexact",
    ),
    "orientation of a site": (
        mjcf(
            BODY.replace("</body>", '<site name="s"/></body>') + '<site name="w"/>',
            rest='<actuator><orientation name="a" site="s" refsite="w" kp="1"/></actuator>',
        ),
        "actuator 'a': transmission site",
    ),
    "pid": (actuator('<pid name="a" joint="j" kp="1" ki="1"/>'), "actuator 'a'"),
    "gear askew": (
        actuator('<position name="a" joint="j" kp="1" gear="1 1 0"/>', "ball"),
        "actuator 'a': gear",
    ),
    "servo of a free joint": (
        actuator('<position name="a" joint="j" kp="1"/>', "free"),
        "actuator 'a': gear",
    ),
    "uneven ball drives": (
        actuator(
            '<position joint="j" kp="1" gear="1 0 0"/><position joint="j" kp="2" gear="0 1 0"/>', "ball"
        ),
        "ball joint's three drives",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_by_name(case):
    xml, words = REFUSED[case]
    with pytest.raises(ModelError, match=words) as error:
        scenes.model(xml, "odd.xml")
    assert "\n" not in str(error.value)  # one line, as the command line prints it


# What changes the motion in MuJoCo and not here.
NOT_SIMULATED = {
    "gravcomp": mjcf('<body gravcomp="1"><joint/><geom size="0.1"/></body>'),
    "one-sided effort range": actuator('<position joint="j" kp="1" forcerange="0 5"/>'),
    "two servos on one joint": actuator('<position joint="j" kp="1"/><position joint="j" kp="2"/>'),
    "ctrlrange": actuator('<position joint="j" kp="1" ctrllimited="true" ctrlrange="-0.1 0.1"/>'),
    "disabled gravity": mjcf(option="").replace("<option />", '<option><flag gravity="disable"/></option>'),
    "disabled contact": mjcf(option="").replace("<option />", '<option><flag contact="disable"/></option>'),
}


@pytest.mark.parametrize("case", NOT_SIMULATED)
def test_not_left_out_silently(case):
    """The reader promises to refuse by name, or to note, what it does not simulate."""
    try:
        model = scenes.model(NOT_SIMULATED[case])
    except (ModelError, UserWarning):
        return
    assert model.notes, f"{case} is dropped without a word"


def test_missing_file(tmp_path):
    with pytest.raises(ModelError, match="no such file"):
        Model.load(tmp_path / "none.xml")
    with pytest.raises(ModelError, match="no such file"):
        Model.load(tmp_path)


@pytest.mark.parametrize(
    "text", ["", "<mujoco>", "not xml", "<mujoco><worldbody><body><joint/></body></worldbody></mujoco>"]
)
def test_broken_file(tmp_path, text):
    file = tmp_path / "broken.xml"
    file.write_text(text)
    with pytest.raises(ModelError, match=r"broken\.xml: not a valid MJCF file") as error:
        Model.load(file)
    assert "\n" not in str(error.value)


def test_binary_file(tmp_path):
    file = tmp_path / "noise.xml"
    file.write_bytes(bytes(range(256)) * 10)
    with pytest.raises(ModelError):
        Model.load(file)


def test_box_against_box_is_warned_about():
    two = "".join(
        f'<body name="{n}" pos="{x} 0 0"><freejoint/><geom name="{n}" type="box" size="0.1 0.1 0.1"/></body>'
        for n, x in (("one", 0), ("two", 1))
    )
    with pytest.raises(UserWarning, match="one and two"):
        scenes.scene(two)


def test_shapes_that_only_show_may_be_anything():
    m = scenes.model(geom('type="cylinder" size="0.1 0.1" contype="0" conaffinity="0"'))
    assert m.nbody == 1 and not m.pairs


def test_names_of_the_player():
    model = Model.load("player")
    assert (model.nq, model.nv, model.nbody) == (132, 107, 51)
    assert model.timestep == 0.01
    assert model.body_names[model.body("l_foot")] == "l_foot"
    assert model.joint_type("root") == "free" and model.joint_type("l_knee") == "hinge"
    assert model.joint_type("neck") == "ball"
    assert model.q_slice("root") == slice(0, 7) and model.dof_slice("root") == slice(0, 6)
    q = [model.q_slice(n) for n in model.joint_names]
    v = [model.dof_slice(n) for n in model.joint_names]
    assert [s.start for s in q[1:]] == [s.stop for s in q[:-1]] and q[-1].stop == model.nq
    assert [s.start for s in v[1:]] == [s.stop for s in v[:-1]] and v[-1].stop == model.nv


@pytest.mark.parametrize("ask", ["body", "joint", "q_slice", "dof_slice", "joint_type", "joint_axis"])
def test_unknown_name(ask):
    model = scenes.model(mjcf())
    with pytest.raises(KeyError, match=r"no (body|joint) named 'nobody'; there are: [bj]"):
        getattr(model, ask)("nobody")


def test_axis_is_a_copy():
    model = scenes.model(joint('axis="0 3 4"'))
    np.testing.assert_allclose(model.joint_axis("j"), [0, 0.6, 0.8])
    model.joint_axis("j")[:] = 0
    np.testing.assert_allclose(model.joint_axis("j"), [0, 0.6, 0.8])


def test_masses_and_inertias_are_mujocos():
    model = Model.load("player")
    m = mujoco.MjSpec.from_file(str(model.path)).compile()
    np.testing.assert_array_equal(model.body_mass, m.body_mass[1:])
    for b in range(model.nbody):
        values = np.linalg.eigvalsh(model.body_inertia[b])
        np.testing.assert_allclose(values, np.sort(m.body_inertia[b + 1]), rtol=1e-9)


def test_start_pose():
    """The keyframe `start` where there is one, else qpos0, quaternions xyzw."""
    player = Model.load("player")
    np.testing.assert_array_equal(player.start_q, player.keyframes["start"])
    plain = scenes.model(
        '<mujoco><worldbody><body pos="1 2 3" quat="0 1 0 0"><freejoint/><geom size="0.1"/>'
        '<body><joint ref="30"/><geom size="0.1" pos="0.5 0 0"/></body></body></worldbody></mujoco>'
    )
    np.testing.assert_allclose(plain.start_q, [1, 2, 3, 1, 0, 0, 0, np.radians(30)])


def test_motor_is_noted():
    model = scenes.model(actuator('<motor name="m" joint="j"/>'))
    assert any("motor 'm'" in note for note in model.notes)


def test_contact_filter_is_mujocos():
    """Pairs of shapes that may touch, against those MuJoCo finds when everything overlaps."""
    model = Model.load("player")
    spec = mujoco.MjSpec.from_file(str(model.path))
    for geom in spec.geoms:
        geom.margin = 100.0
    m = spec.compile()
    found = {frozenset(model.shapes[k].name for k in p["shapes"]) for p in model.pairs}
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    expected = {
        frozenset(m.geom(int(g)).name or f"geom{int(g)}" for g in (c.geom1, c.geom2)) for c in data.contact
    }
    assert found == expected


def test_contact_filter_knows_parents_and_exclusions():
    """As MuJoCo: not a body with its parent, unless that is fixed to the world; not what is excluded."""

    def ball(name, inner="", attributes=""):
        return (
            f'<body name="{name}"><joint/><geom name="{name}" size="0.1" pos="0.3 0 0" {attributes}/>'
            f"{inner}</body>"
        )

    xml = mjcf(
        '<geom name="floor" type="plane" size="1 1 1"/>'
        + f'<body name="post"><geom name="post" size="0.1"/>{ball("arm")}</body>'
        + ball("a", ball("b", ball("c")))
        + ball("ghost", attributes='contype="0" conaffinity="0"')
        + ball("far", attributes='contype="2" conaffinity="4"'),
        rest='<contact><exclude body1="a" body2="c"/></contact>',
    )
    model = scenes.model(xml)
    found = {frozenset(model.shapes[k].name for k in p["shapes"]) for p in model.pairs}
    names = "floor-arm floor-a floor-b floor-c post-arm post-a post-b post-c arm-a arm-b arm-c"
    assert found == {frozenset(pair.split("-")) for pair in names.split()}


def test_contact_properties_of_a_pair():
    """Friction: the larger, or that of the higher priority; none where condim is 1. Restitution: the
    product; erp and cfm: the mean."""

    def shape(name, attributes):
        return f'<body><freejoint/><geom name="{name}" size="0.1" {attributes}/></body>'

    model = scenes.scene(
        '<geom name="floor" type="plane" size="1 1 1" friction="0.5" user="0.5 0.2 1e-5"/>'
        + shape("rough", 'friction="0.9" user="0.8 0.4 3e-5" contype="0"')
        + shape("smooth", 'friction="0.1" user="0 0.2 1e-5" contype="0"')
        + shape("chief", 'friction="0.1" priority="1" contype="0"')
        + shape("slick", 'friction="0.9" condim="1" priority="1" contype="0"')
    )
    pairs = {model.shapes[p["shapes"][1]].name: p for p in model.pairs}
    friction = {name: pair["friction"] for name, pair in pairs.items()}
    assert friction == {"rough": 0.9, "smooth": 0.5, "chief": 0.1, "slick": 0.0}
    assert pairs["rough"]["restitution"] == pytest.approx(0.4)
    assert (pairs["rough"]["erp"], pairs["rough"]["cfm"]) == pytest.approx((0.3, 2e-5))
    assert pairs["smooth"]["restitution"] == 0.0
