"""Every field of a compiled model is simulated, cannot change a motion, or is refused where it is changed."""

import mujoco
import numpy as np
import pytest

from tests.reference import scenes
from warpdribble.sims import Model, ModelError, Simulation
from warpdribble.sims.model import fields, supported
from warpdribble.sims.model.supported import check_supported

TABLES = {"understood": fields.UNDERSTOOD, "must be default": fields.MUST_BE_DEFAULT, **fields.WITHOUT_EFFECT}
FULL = """
<mujoco><compiler autolimits="true"/>
<worldbody><geom name="floor" type="plane" size="1 1 1"/><camera name="c"/><light name="l"/>
<body name="b" pos="0 0 0.5"><joint name="j" axis="0 1 0" range="-20 20" damping="0.1" stiffness="1"/>
  <geom name="g" type="capsule" fromto="0 0 0 0.5 0 0" size="0.03"/><site name="s"/>
  <body name="tip" pos="0.5 0 0"><joint name="k" type="ball"/><geom name="h" size="0.05"/></body></body>
<body name="ball" pos="0 1 0.3"><freejoint/><geom name="ball" size="0.1"/></body></worldbody>
<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
<equality><joint name="e" joint1="j" active="false"/></equality>
<sensor><jointpos joint="j"/></sensor>
<actuator><position name="a" joint="j" kp="20" kv="1"/><motor name="m" joint="j" gear="2"/></actuator>
</mujoco>
"""
"""Something of everything, nothing that is refused."""


def compiled(xml=FULL):
    return mujoco.MjModel.from_xml_string(xml)


class Changed:
    """A compiled model but for one field: counts cannot be written to."""

    def __init__(self, m, field, value):
        self._m, self._changed = m, {field: value}

    def __getattr__(self, name):
        return self._changed[name] if name in self._changed else getattr(self._m, name)


def test_every_field_is_in_one_table():
    """Fails with a MuJoCo that has a new field: find out what it does, then list it."""
    there = supported.fields(compiled())
    assert there >= {"nq", "qpos0", "geom_margin", "opt.timestep", "opt.disableflags"}
    listed = [name for table in TABLES.values() for name in table]
    assert sorted(listed) == sorted(set(listed)), "a field in two tables"
    assert there - set(listed) == set(), "fields that nobody has looked at"
    assert set(listed) - there == set(), "fields that MuJoCo does not have"


def test_full_model_is_supported():
    notes = check_supported(compiled(), "full.xml")
    assert notes == ["1 equality constraint(s) that are not active are left out"]


@pytest.mark.parametrize(
    "field", sorted(set(fields.MUST_BE_DEFAULT) - {"opt.disableflags", "opt.enableflags"})
)
def test_refused_where_not_at_its_default(field):
    m, rule = compiled(), fields.MUST_BE_DEFAULT[field]
    value = supported.value(m, field)
    if field.startswith("opt."):
        setattr(m.opt, field[4:], 3)
    elif np.ndim(value) == 0:
        m = Changed(m, field, 3)
    else:
        row = 0 if rule.where is None else int(np.argmax(rule.where(m)))
        value[row] = ~value[row] if value.dtype == bool else value[row] + 1
    with pytest.raises(ModelError, match=rule.word or "equality") as error:
        check_supported(m, "odd.xml")
    assert str(error.value).startswith("odd.xml: ") and rule.advice in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "field, bits, prefix",
    [
        ("opt.disableflags", mujoco.mjtDisableBit, "mjDSBL_"),
        ("opt.enableflags", mujoco.mjtEnableBit, "mjENBL_"),
    ],
)
def test_every_flag_may_be_changed_or_is_refused(field, bits, prefix):
    flags = {
        name[len(prefix) :].lower(): int(b) for name, b in bits.__members__.items() if name.startswith(prefix)
    }
    may = fields.MUST_BE_DEFAULT[field].may.split()
    assert set(may) <= set(flags)
    for name, bit in {**flags, "1073741824": 1 << 30}.items():
        m = compiled()
        setattr(m.opt, field[4:], bit)
        if name in may:
            check_supported(m, "odd.xml")
            continue
        with pytest.raises(ModelError, match=f"option flag {name}='"):
            check_supported(m, "odd.xml")


def run(m, steps=300):
    """(steps, nq) by MuJoCo. Servo and motor work, the arm meets its limit and the ball the floor."""
    data = mujoco.MjData(m)
    data.ctrl[:] = 0.5, 0.2
    out = []
    for _ in range(steps):
        mujoco.mj_step(m, data)
        out.append(data.qpos.copy())
    return np.array(out)


def idle():
    """Fields of numbers that are listed as without effect, and may be written to without harm to MuJoCo."""
    reasons = ("only shown", "only measured, named or noted down", "only beside something that is refused")
    m = compiled()
    names = sorted(name for reason in reasons for name in fields.WITHOUT_EFFECT[reason])
    rows = {name: np.asarray(supported.value(m, name)) for name in names if name != "vis"}
    real = {name for name, row in rows.items() if row.dtype.kind == "f" and row.size}
    return sorted(real | {name for name in rows if name.endswith(("_group", "_castshadow", "light_active"))})


@pytest.fixture(scope="module")
def usual():
    return run(compiled())


@pytest.mark.parametrize("field", idle())
def test_without_effect_in_mujoco_itself(field, usual):
    m = compiled()
    value = supported.value(m, field)
    if np.ndim(value):
        value[:] = ~value if value.dtype == bool else value * 2 + 0.01
    else:
        setattr(m.opt, field[4:], value * 2 + 0.01)
    check_supported(m, "odd.xml")
    np.testing.assert_array_equal(run(m), usual)


def test_the_run_tells_fields_apart(usual):
    """The run above is moved by what is refused: it would notice."""
    for field, row in {"geom_margin": -1, "jnt_solref": 0, "dof_frictionloss": 0}.items():
        m = compiled()
        supported.value(m, field)[row] += 0.05
        assert np.abs(run(m) - usual).max() > 1e-5, field


@pytest.mark.parametrize(
    "change",
    [
        ('name="h"', 'name="h" contype="0" conaffinity="0" solref="0.5 1" solimp="0.1 0.2 0.3" margin="0.1"'),
        ('name="k"', 'name="k" solreflimit="0.5 1" solimplimit="0 0.5 0.1"'),
        ('name="h"', 'name="h" gap="0.1" friction="1 0.1 0.1" group="3"'),
        ("<worldbody>", '<option integrator="RK4" cone="elliptic" iterations="3" impratio="10"/><worldbody>'),
        ("<worldbody>", '<option><flag energy="enable" sensor="disable"/></option><worldbody>'),
        ("<worldbody>", '<visual><global fovy="30"/></visual><statistic extent="9"/><worldbody>'),
    ],
)
def test_what_does_nothing_is_not_refused(change):
    check_supported(compiled(FULL.replace(*change)), "odd.xml")


def test_all_refusals_are_named():
    m = compiled()
    m.geom_margin[0], m.dof_frictionloss[0] = 0.1, 0.2
    with pytest.raises(
        ModelError, match=r"frictionloss 0\.2 of joint 'j'.*; nor are: margin 0\.1 of geom 'floor'"
    ):
        check_supported(m, "odd.xml")


@pytest.mark.parametrize("field", ["jnt_stiffness", "dof_damping", "dof_armature", "actuator_damping"])
def test_negative_is_refused(field):
    m = compiled()
    supported.value(m, field)[0] = -1
    with pytest.raises(ModelError, match=f"negative {field.partition('_')[2]} -1 of"):
        check_supported(m, "odd.xml")


class Newer:
    """Tables that lack some fields, as they would with a newer MuJoCo."""

    def __init__(self, monkeypatch, *names):
        kept = {k: rule for k, rule in fields.MUST_BE_DEFAULT.items() if k not in names}
        monkeypatch.setattr(supported, "MUST_BE_DEFAULT", kept)
        idle = {reason: table - set(names) for reason, table in fields.WITHOUT_EFFECT.items()}
        monkeypatch.setattr(supported, "WITHOUT_EFFECT", idle)


def test_new_field_that_a_file_can_say_is_refused_where_it_is_changed(monkeypatch):
    Newer(monkeypatch, "geom_surfacevel", "opt.wind", "actuator_delay")
    m = compiled()
    assert "actuator_delay, geom_surfacevel, opt.wind not looked at" in check_supported(m, "new.xml")[-1]
    m.geom_surfacevel[2, 0] = 1.0
    with pytest.raises(ModelError, match=r"surfacevel of geom 'h' \(new in MuJoCo"):
        check_supported(m, "new.xml")
    m = compiled()
    m.opt.wind[0] = 1.0
    with pytest.raises(ModelError, match=r"option wind \(new in MuJoCo"):
        check_supported(m, "new.xml")


def test_new_field_that_follows_from_others_is_noted(monkeypatch):
    Newer(monkeypatch, "dof_M0", "nC")
    assert "dof_M0, nC not looked at" in check_supported(compiled(), "new.xml")[-1]


def test_shipped_player_is_understood_whole():
    assert Model.load("player").notes == []


SERVOS = {
    "gear": '<position joint="j" kp="20" kv="1" gear="3"/>',
    "gear backwards": '<position joint="j" kp="20" kv="1" gear="-2"/>',
    "gear and forcerange": '<position joint="j" kp="20" kv="1" gear="3" forcerange="-0.2 0.2"/>',
    "armature": '<position joint="j" kp="20" kv="1" armature="0.5"/>',
    "armature of a motor": '<motor joint="j" gear="2" armature="0.1"/>',
    "damping": '<position joint="j" kp="20" damping="2"/>',
    "damping beyond the limit": '<position joint="j" kp="20" damping="1" gear="2" forcerange="-1 1"/>',
    "two actuators": '<position joint="j" kp="20" armature="0.1"/><motor joint="j" gear="3" damping="0.2"/>',
}
BALL_SERVOS = {
    "orientation": '<orientation joint="j" kp="20" kv="1"/>',
    "orientation with a limit": '<orientation joint="j" kp="20" kv="1" forcerange="0 0.5"/>',
    "three with gears": "".join(
        f'<position joint="j" kp="5" kv="0.2" gear="{gear}"/>' for gear in ("2 0 0", "0 2 0", "0 0 -2")
    ),
    "armature": '<orientation joint="j" kp="20" kv="1"/><motor joint="j" gear="2 0 0" armature="0.02"/>',
}


def fall(joint, actuators, steps=400, dt=0.0005):
    """A pendulum let go beside its servo, by MuJoCo and here."""
    xml = f"""<mujoco><compiler angle="radian" autolimits="true"/>
    <option timestep="{dt}" integrator="implicitfast"/><worldbody>
    <body><joint name="j" {joint}/><geom type="capsule" fromto="0 0 0 0.4 0.1 0" size="0.03" mass="1"
    contype="0" conaffinity="0"/></body></worldbody><actuator>{actuators}</actuator></mujoco>"""
    model, m = scenes.model(xml), mujoco.MjModel.from_xml_string(xml)
    sim, data = Simulation(model, 1, lanes=1), mujoco.MjData(m)
    sim.set_targets(model.start_q)
    sim.step(steps)
    mujoco.mj_step(m, data, steps)
    theirs = data.qpos.copy()
    if model.nq > 1:
        theirs[-4:] = np.roll(theirs[-4:], -1)
    return sim.joint_q[0], theirs


@pytest.mark.parametrize("case", SERVOS)
def test_servo_of_a_hinge_is_mujocos(case):
    ours, theirs = fall('axis="0 1 0"', SERVOS[case])
    assert abs(theirs[0]) > 0.01
    np.testing.assert_allclose(ours, theirs, rtol=5e-3, atol=1e-4)


@pytest.mark.parametrize("case", BALL_SERVOS)
def test_servo_of_a_ball_joint_is_mujocos(case):
    ours, theirs = fall('type="ball"', BALL_SERVOS[case])
    assert np.abs(theirs[:3]).max() > 0.01
    np.testing.assert_allclose(ours, theirs, rtol=5e-3, atol=3e-4)


def test_margin_of_a_limit_is_mujocos():
    """A limit pushes from its margin on: the arm rests there in both, within what their limits give way."""
    ours, theirs = fall('axis="0 1 0" range="-1 0.8" margin="0.3" damping="0.5"', "", steps=6000)
    assert theirs[0] == pytest.approx(0.5, abs=0.02)
    np.testing.assert_allclose(ours, theirs, atol=0.02)


@pytest.mark.parametrize("joint", ['type="free" damping="2" armature="0.4"', 'type="ball" damping="0.3"'])
def test_passive_parts_are_mujocos(joint):
    ours, theirs = fall(joint, "")
    np.testing.assert_allclose(ours, theirs, rtol=5e-3, atol=1e-4)


LEG = """
<body name="{0}_thigh" pos="0 {1} -0.05">
  <joint name="{0}_hip_x" axis="1 0 0"/><joint name="{0}_hip_y" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.05"/>
  <body name="{0}_shin" pos="0 0 -0.4"><joint name="{0}_knee" axis="0 1 0" range="-120 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.04"/>
    <geom class="sole" name="{0}_sole" size="0.06" pos="0 0 -0.4"/></body></body>
"""
FIGURE = """
<mujoco model="figure"><compiler autolimits="true"/>
<option timestep="0.005" integrator="implicitfast" cone="elliptic" iterations="50">
  <flag eulerdamp="disable"/></option>
<visual><global azimuth="120"/></visual><statistic meansize="0.05"/>
<default><joint limited="true" range="-60 60" damping="1" armature="0.02"/><geom condim="3" friction="0.7"/>
  <default class="visual"><geom contype="0" conaffinity="0" group="2"/></default>
  <default class="sole"><geom friction="1 0.05 0.01"/></default></default>
<asset><texture name="sky" type="skybox" builtin="gradient" width="8" height="8"/>
  <mesh name="mesh" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/><material name="m" rgba="1 0 0 1"/></asset>
<worldbody><light pos="0 0 3"/><camera name="side" mode="trackcom"/>
  <geom name="floor" type="plane" size="0 0 0.05" material="m"/>
  <body name="pelvis" pos="0 0 1"><freejoint name="root"/>
    <inertial pos="0 0 0" mass="9" diaginertia="0.1 0.1 0.1"/>
    <geom class="visual" type="ellipsoid" size="0.1 0.15 0.1"/><geom class="visual" type="mesh" mesh="mesh"/>
    <geom size="0.12"/><site name="imu"/>LEGS</body></worldbody>
<contact><exclude body1="l_thigh" body2="r_thigh"/></contact><actuator>SERVOS</actuator>
<tendon><fixed name="both"><joint joint="l_knee" coef="1"/><joint joint="r_knee" coef="-1"/></fixed></tendon>
<sensor><gyro site="imu"/><tendonpos tendon="both"/></sensor>
<keyframe><key name="home" qpos="0 0 1 1 0 0 0 0 0 0 0 0 0"/></keyframe></mujoco>
"""


@pytest.mark.parametrize(
    "servo, notes",
    [
        ('<position joint="{0}" kp="60" kv="2" forcerange="-80 80"/>', 0),
        ('<position joint="{0}" kp="60" dampratio="1" gear="2"/>', 6),
        ('<motor joint="{0}" gear="100" ctrlrange="-1 1"/>', 6),
    ],
)
def test_usual_files_load(servo, notes):
    """Classes, cameras, textures, sensors, a tendon that only measures, shapes that only show, keyframes."""
    joints = [f"{side}_{joint}" for side in "lr" for joint in ("hip_x", "hip_y", "knee")]
    figure = FIGURE.replace("LEGS", LEG.format("l", 0.1) + LEG.format("r", -0.1))
    model = scenes.model(figure.replace("SERVOS", "".join(servo.format(joint) for joint in joints)))
    assert model.nv == 12 and len(model.notes) == notes


@pytest.mark.parametrize("user", ["0.8", "0.8 0.2", "0.8 0.2 1e-5", "0.8 0.2 1e-5 7"])
def test_user_numbers_that_are_not_given_keep_their_default(user):
    """MuJoCo pads all geoms to the longest: erp and cfm of every shape would be zero."""
    model = scenes.model(
        '<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>'
        f'<body pos="3 0 1"><freejoint/><geom name="ball" size="0.1" user="{user}"/></body>'
        '<body pos="0 0 1"><freejoint/><geom name="crate" type="box" size="0.1 0.1 0.1"/></body>'
        "</worldbody></mujoco>"
    )
    told = {s.name: (s.restitution, s.erp, s.cfm) for s in model.shapes}
    assert told == {"floor": (0, 0.2, 1e-5), "ball": (0.8, 0.2, 1e-5), "crate": (0, 0.2, 1e-5)}


def test_user_numbers_that_are_given_are_kept():
    before = '<size nuser_geom="4"/><default><geom user="0.5 0.3"/></default>'
    bodies = '<body><freejoint/><geom name="{}" size="0.1" {} contype="0"/></body>'
    body = (
        bodies.format("zero", 'user="0.1 0 0"')
        + bodies.format("class", "")
        + bodies.format("one", 'user="0"')
    )
    model = scenes.model(f"<mujoco>{before}<worldbody>{body}</worldbody></mujoco>")
    told = {s.name: (s.restitution, s.erp, s.cfm) for s in model.shapes}
    assert told == {"zero": (0.1, 0, 0), "class": (0.5, 0.3, 1e-5), "one": (0, 0.2, 1e-5)}


@pytest.mark.parametrize("user", ["7", "0.5 2", "0.5 0.2 -1", "-0.1"])
def test_user_numbers_that_make_no_sense_are_refused(user):
    with pytest.raises(ModelError, match=f"user '{user}' of geom 'g' is not restitution"):
        scenes.model(f'<mujoco><worldbody><geom name="g" size="0.1" user="{user}"/></worldbody></mujoco>')
