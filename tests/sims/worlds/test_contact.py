"""Friction, rolling and the geometry of contacts, against formulas and MuJoCo's distances."""

import mujoco
import numpy as np
import pytest

from tests.reference.scenes import GRAVITY, MASS, RADIUS, ball, ground, record, scene, start
from warpdribble.sims import Simulation

H = 0.01


def tilted(angle):
    """Normal of a plane that falls towards +x, its downhill direction, and a body's orientation."""
    n = np.array([np.sin(angle), 0, np.cos(angle)])
    down = np.array([np.cos(angle), 0, -np.sin(angle)])
    return n, down, np.array([0, np.sin(angle / 2), 0, np.cos(angle / 2)])


def text(v):
    return " ".join(f"{x:.9f}" for x in v)


BOX = (
    '<body name="box"><freejoint/><geom name="box" type="box" size="0.1 0.08 0.03" mass="2"'
    ' friction="0.8"/></body>'
)


def on_slope(angle, body, height, frictions):
    n, down, turn = tilted(angle)
    model = scene(ground(text(n)) + body, H)
    q = start(model, len(frictions))
    q[:, :3], q[:, 3:] = n * height, turn
    sim = Simulation(model, len(frictions))
    sim.reset(joint_q=q)
    sim.set_contact(model.body_names[0], "ground", friction=np.asarray(frictions, float))
    return sim, down


@pytest.mark.parametrize("degrees", [5, 15, 30])
def test_box_sticks_or_slides(degrees):
    """Within 2 % of mu on either side: at 1.02 tan(angle) it holds, creeping under 1 mm/s; below, it
    slides with g (sin - mu cos) within 2 %."""
    angle = np.radians(degrees)
    grips = np.tan(angle) * np.array([1.02, 1.1, 2.0])
    slips = np.tan(angle) * np.array([0.0, 0.2, 0.5, 0.8, 0.9])
    sim, down = on_slope(angle, BOX, 0.03, [*grips, *slips])
    sim.step(100)
    before, x = sim.body_qd[:, 0, :3] @ down, sim.joint_q[:, :3] @ down
    sim.step(100)
    creep = (sim.joint_q[:, :3] @ down - x)[:3]
    print(f"{degrees} deg: creep {1000 * np.abs(creep).max():.4f} mm/s")
    assert np.abs(creep).max() <= 1e-3
    a = (sim.body_qd[:, 0, :3] @ down - before)[3:]
    exact = GRAVITY * (np.sin(angle) - slips * np.cos(angle))
    print(f"  sliding error {np.abs(a / exact - 1).max():.5f}")
    np.testing.assert_allclose(a, exact, rtol=0.02)
    # what would be 2 % of mu too little does not hold
    sim.set_contact("box", "ground", friction=0.98 * np.tan(angle))
    v = sim.body_qd[:, 0, :3] @ down
    sim.step(50)
    assert (sim.body_qd[:, 0, :3] @ down > v + 0.25 * GRAVITY * 0.02 * np.sin(angle)).all()


@pytest.mark.parametrize("degrees", [3, 10, 20])
def test_shell_rolls(degrees):
    """A shell rolls down with 3/5 g sin, its surface at rest on the ground."""
    angle = np.radians(degrees)
    sim, down = on_slope(angle, ball(), RADIUS, [0.8])
    sim.step(50)
    before = sim.body_qd[0, 0, :3] @ down
    sim.step(100)
    v = sim.body_qd[0, 0]
    assert (v[:3] @ down - before) == pytest.approx(0.6 * GRAVITY * np.sin(angle), rel=0.02)
    assert v[:3] @ down == pytest.approx(RADIUS * v[4], rel=1e-3)


def test_box_lands_and_rests():
    """Dropped flat and tilted, it ends flat, at rest, carrying its weight."""
    model = scene(ground() + BOX, H)
    rng = np.random.default_rng(0)
    q = start(model, 16)
    q[:, 2] = 0.3
    q[:, 3:] = [0, 0, 0, 1]
    q[1:, 3:6] = 0.3 * rng.standard_normal((15, 3))
    sim = Simulation(model, 16)
    sim.reset(joint_q=q)
    sim.step(400)
    speed = record(sim, 100, lambda sim: sim.body_qd[:, 0].copy())
    assert np.abs(speed).max() <= 1e-3
    touch = sim.contacts()
    np.testing.assert_allclose(touch.impulse[:, :, 0].sum(axis=1) / H, 2 * GRAVITY, rtol=5e-3)
    assert touch.gap.min() > -2e-3


SHAPES = {
    "sphere": '<geom type="sphere" size="0.15" name="{}"/>',
    "capsule": '<geom type="capsule" size="0.07 0.2" pos="0.02 0 0.03" euler="0.3 0.2 0" name="{}"/>',
    "box": '<geom type="box" size="0.2 0.1 0.15" pos="0 0.03 0" euler="0.1 0.4 0.2" name="{}"/>',
}


@pytest.mark.parametrize(
    "a, b", [("sphere", "sphere"), ("capsule", "sphere"), ("box", "sphere"), ("capsule", "capsule")]
)
def test_gaps_are_mujocos_distances(a, b):
    """mj_geomDistance on the same shapes, apart and overlapping; float32 at 1 m: 1e-5."""
    from tests.reference.rigid import from_mujoco, random_state, to_mujoco

    bodies = "".join(
        f'<body name="{n}"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        f"{SHAPES[kind].format('g' + n)}</body>"
        for n, kind in (("a", a), ("b", b))
    )
    model = scene(bodies, gravity="0 0 0")
    xml = f'<mujoco><compiler angle="radian"/><worldbody>{bodies}</worldbody></mujoco>'
    m = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(m)
    q, _ = random_state(m, np.random.default_rng(4), 200)
    q[:, [0, 1, 2, 7, 8, 9]] *= 0.2
    sim = Simulation(model, 200)
    sim.reset(joint_q=from_mujoco(m, q))
    q, touch = to_mujoco(m, sim.joint_q), sim.contacts()
    apart, ends, kinds = [], np.zeros(6), {a, b}
    swap = touch.shapes[0] == ("gb", "ga")
    for k in range(200):
        data.qpos[:] = q[k]
        mujoco.mj_kinematics(m, data)
        gap = mujoco.mj_geomDistance(m, data, 0, 1, 5.0, ends)
        if (a, b) == ("box", "sphere") and gap < -0.15:
            continue  # the centre inside: MuJoCo's distance is no reference there
        apart.append(gap > 0)
        axes = data.geom_xmat.reshape(2, 3, 3)[:, :, 2]
        if kinds == {"capsule"} and np.linalg.norm(np.cross(*axes)) < 0.26:  # two contacts, 15 degrees
            assert touch.gap[k].min() == pytest.approx(gap, abs=1.5e-4)  # 1e-3 of their radii
            continue
        assert touch.gap[k].min() == pytest.approx(gap, abs=1e-5)
        if abs(gap) > 1e-3:
            n = (ends[3:] - ends[:3]) / gap * (-1 if swap else 1)
            assert touch.normal[k, 0] @ n == pytest.approx(1, abs=1e-5)
            assert touch.point[k, 0] == pytest.approx(0.5 * (ends[3:] + ends[:3]), abs=1e-4)
    assert 20 < sum(apart) < 180


def test_contacts_push_apart_equally():
    """Two balls meet head on: momentum stays, restitution as set."""
    model = scene(ball("left", 1.0) + ball("right", 1.0), gravity="0 0 0")
    q, qd = start(model, 3), np.zeros((3, 12))
    q[:, 0], q[:, 7] = -0.5, 0.5
    qd[:, 0], qd[:, 6] = 1.0, -2.0
    e = np.array([0.0, 0.5, 1.0])
    sim = Simulation(model, 3)
    sim.reset(joint_q=q, joint_qd=qd)
    sim.set_contact("left", "right", restitution=e, friction=0.0)
    sim.step(60)
    v = sim.joint_qd
    np.testing.assert_allclose(v[:, 0] + v[:, 6], -1.0, atol=1e-5)
    np.testing.assert_allclose(v[:, 6] - v[:, 0], 3 * e, atol=1e-2)


def test_condim_1_has_no_friction():
    model = scene((ground() + BOX).replace('friction="0.8"', 'condim="1"'), H)
    sim = Simulation(model, 1)
    q = start(model, 1)
    q[:, 2] = 0.03
    sim.reset(joint_q=q, joint_qd=[1, 0, 0, 0, 0, 0])
    sim.step(100)
    assert sim.joint_qd[0, 0] == pytest.approx(1.0, abs=1e-4)


def test_free_fall_then_weight():
    """No contact in the air, m g when down; the impulse is the solver's, not the gap's."""
    model = scene(ground() + ball(height=RADIUS + 0.5), H)
    sim = Simulation(model, 1)
    sim.step(5)
    assert sim.contacts().impulse.max() == 0
    sim.step(300)
    assert sim.contacts().impulse[0, 0, 0] / H == pytest.approx(MASS * GRAVITY, rel=1e-3)
