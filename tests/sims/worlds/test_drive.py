"""Drives, joint limits, forces and masses: against MuJoCo's implicit drives, and against formulas."""

import mujoco
import numpy as np
import pytest

from tests.reference import scenes
from tests.reference.rigid import Rigid, from_mujoco, to_mujoco
from tests.reference.spatial import quat_exp
from warpdribble.sims import Model, Simulation

H = 0.01
ACT = "<actuator>{}</actuator>"

ARM = """
<body pos="0 0 2"><inertial pos="0 0 -0.15" mass="2" diaginertia="0.02 0.02 0.005"/>
  <joint name="shoulder" type="{kind}" axis="0 1 0" armature="0.01" damping="0.2"/>
  <body pos="0 0 -0.3"><inertial pos="0.02 0 -0.12" mass="1" diaginertia="0.01 0.01 0.003"/>
    <joint name="elbow" axis="0 1 0" armature="0.01" ref="0.1"/>
    <body pos="0 0 -0.25"><inertial pos="0 0.01 -0.05" mass="0.4" diaginertia="0.002 0.002 0.001"/>
      <joint name="wrist" axis="1 0 0" armature="0.002" stiffness="3" springref="0.2"/></body></body></body>
"""


def servo(joint, kp, kv, gear="1 0 0", limit=None):
    force = "" if limit is None else f' forcerange="{-limit} {limit}"'
    return f'<position joint="{joint}" kp="{kp}" kv="{kv}" gear="{gear}"{force}/>'


def beside_mujoco(worldbody, servos, target, steps=200):
    """Trajectories (steps, nq) of the same file here and with MuJoCo's `discrete` integrator."""
    model = scenes.scene(worldbody, H, rest=ACT.format(servos))
    m = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option timestep="{H}" integrator="discrete"/>'
        f"<worldbody>{worldbody}</worldbody><actuator>{servos}</actuator></mujoco>"
    )
    data = mujoco.MjData(m)
    data.ctrl[:] = target
    q = m.qpos0.copy()
    for j in range(m.njnt):
        k = m.jnt_qposadr[j]
        if m.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL:
            q[k : k + 4] = quat_exp([0.4, -0.5, 0.3])
        else:
            q[k] += 0.3
    data.qpos[:] = q
    sim = Simulation(model, 1)
    sim.reset(joint_q=from_mujoco(m, q))
    goal = m.qpos0.copy()
    if m.nu == m.nq:
        goal[:] = target
    sim.set_targets(from_mujoco(m, goal))
    ours, theirs = [], []
    for _ in range(steps):
        sim.step()
        mujoco.mj_step(m, data)
        ours.append(to_mujoco(m, sim.joint_q[0]))
        theirs.append(data.qpos.copy())
    assert np.ptp(theirs, axis=0).max() > 0.2  # it does move
    return np.array(ours), np.array(theirs)


def test_hinge_step_response():
    """MuJoCo's `discrete` steps the same equation for hinges: float32 against float64 over 2 s."""
    servos = servo("shoulder", 200, 10) + servo("elbow", 100, 4) + servo("wrist", 20, 0.3)
    ours, theirs = beside_mujoco(ARM.format(kind="hinge"), servos, [0.5, -0.4, 0.3])
    print("hinge response, largest difference [rad]", np.abs(ours - theirs).max())
    assert np.abs(ours - theirs).max() <= 2e-5


def test_stiff_step_response():
    """kp h^2 far above the inertia, where an explicit drive bursts."""
    servos = servo("shoulder", 5000, 50) + servo("elbow", 5000, 20) + servo("wrist", 2000, 5)
    ours, theirs = beside_mujoco(ARM.format(kind="hinge"), servos, [0.5, -0.4, 0.3])
    assert np.abs(ours - theirs).max() <= 2e-5
    assert np.ptp(ours[-50:], axis=0).max() < 1e-3  # settled


def test_ball_step_response():
    """A ball joint drawn to its zero, for which MuJoCo's three servos are the same law."""
    servos = "".join(servo("shoulder", 200, 10, g) for g in ("1 0 0", "0 1 0", "0 0 1"))
    servos += servo("elbow", 100, 4) + servo("wrist", 20, 0.3)
    ours, theirs = beside_mujoco(ARM.format(kind="ball"), servos, [0, 0, 0, 0.1, 0])
    print("ball response, largest difference", np.abs(ours - theirs).max())
    assert np.abs(ours - theirs).max() <= 2e-5


def test_clamped_step_response():
    """With effort limits, by inverse dynamics and beside MuJoCo. Both drop a saturated servo's implicit
    terms, but MuJoCo tells saturation by the force at the start of the step, so single steps differ at
    the edge: 3 degrees on the way, nothing at the end."""
    servos = servo("shoulder", 200, 10, limit=8) + servo("elbow", 100, 4, limit=4) + servo("wrist", 20, 0.3)
    target = np.array([0.8, -0.6, 0.3])
    ours, theirs = beside_mujoco(ARM.format(kind="hinge"), servos, target)
    print("clamped response, largest difference [rad]", np.abs(ours - theirs).max())
    assert np.abs(ours - theirs).max() <= 0.05
    assert np.abs(ours - theirs)[-1].max() <= 1e-4
    robot = Rigid(
        mujoco.MjModel.from_xml_string(
            f'<mujoco><compiler angle="radian"/>'
            f"<worldbody>{ARM.format(kind='hinge')}</worldbody><actuator>{servos}</actuator></mujoco>"
        )
    )
    q, v, full = robot.m.qpos0 + 0.3, np.zeros(3), []
    for k in range(100):
        after = (ours[k] - q) / H
        good, at_limit = robot.obeys_effort_limits(q, v, after, target, H, robot.drives())
        assert good.all()
        full.append(at_limit[:2])
        q, v = ours[k], after
    assert 0.05 < np.mean(full) < 0.9


ROTOR = '<body name="rotor"><joint name="j" type="{}" axis="0 0 1" armature="0.02" {}/>'
ROTOR += '<inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body>'


def test_effort_limit_of_a_hinge():
    """A saturated drive accelerates with limit / (I + armature), exactly."""
    model = scenes.scene(ROTOR.format("hinge", ""), rest=ACT.format(servo("j", 1e4, 1, limit=0.6)))
    sim = Simulation(model, 2)
    sim.set_targets([[50.0], [-50.0]])
    for n in range(1, 21):
        sim.step()
        np.testing.assert_allclose(sim.joint_qd[:, 0], [n * H * 5, -n * H * 5], rtol=1e-5)


def test_effort_limit_of_a_ball_joint():
    """The limit is the length of the torque, along the error."""
    servos = "".join(servo("j", 1e4, 1, g, 0.6) for g in ("1 0 0", "0 1 0", "0 0 1"))
    model = scenes.scene(ROTOR.format("ball", ""), rest=ACT.format(servos))
    sim = Simulation(model, 1)
    axis = np.array([2, -1, 2]) / 3
    sim.set_targets([*np.sin(1.0) * axis, np.cos(1.0)])
    sim.step(10)
    np.testing.assert_allclose(sim.joint_qd[0], 10 * H * 5 * axis, rtol=1e-5)


def test_effort_within_the_limit_is_not_clamped():
    """A weak drive with and without a distant limit: same bits."""
    out = []
    for limit in (None, 1e3):
        model = scenes.scene(ROTOR.format("hinge", ""), rest=ACT.format(servo("j", 5, 0.5, limit=limit)))
        sim = Simulation(model, 1)
        sim.set_targets([1.0])
        sim.step(50)
        out.append(sim.joint_q.copy())
    assert np.array_equal(*out)


@pytest.mark.parametrize("torque", [2.0, -2.0, 20.0])
def test_hinge_limit_holds(torque):
    """Pushed against a limit a hinge stops at it: within 0.2 mrad per rad/s^2 that the torque would give
    (`drive.stop`: excess = a h^2 / (0.2 * 50) = 1e-5 a) and comes back once let go."""
    model = scenes.scene(ROTOR.format("hinge", 'range="-0.7 0.4"'))
    sim = Simulation(model, 1)
    sim.set_joint_force([torque])
    q = scenes.record(sim, 300)[:, 0, 0]
    limit = 0.4 if torque > 0 else -0.7
    excess = np.abs(torque) / 0.12 * H**2
    past = (q - limit) * np.sign(torque)
    print("past the limit [mrad]: most", 1000 * past.max(), "at rest", 1000 * past[-1])
    assert past.max() <= 2 * excess
    assert past[-1] == pytest.approx(0.1 * excess, rel=0.05)
    assert np.ptp(q[-50:]) <= 1e-6
    sim.set_joint_force([-0.01 * torque])
    sim.step(100)
    assert (sim.joint_q[0, 0] - limit) * np.sign(torque) < -1e-3


def test_ball_limit_holds():
    """The cone of a ball joint: a weight drawn towards any side stops at it and lies still there, and
    slides along it when the pull turns. Sliding with w it leaves the cone by (h w)^2 / (2 0.6) a step,
    a fifth of which is taken back: 5 mrad at 3 rad/s."""
    body = ROTOR.replace('<inertial pos="0 0 0"', '<inertial pos="0 0 0.3"')
    model = scenes.scene(body.format("ball", 'range="0 0.6" damping="0.1"'), gravity="0 0 0")
    sim = Simulation(model, 16)
    rng = np.random.default_rng(0)
    side = np.pi * rng.uniform(-1, 1, 16)
    down = rng.uniform(-0.8, 0.5, 16)  # of the pull, against the 0.83 of the cone
    flat = np.sqrt(1 - down**2)
    pull = 5 * np.stack([flat * np.cos(side), flat * np.sin(side), down], 1)
    excess = 5 * 0.3 / 0.12 * H**2

    def run(steps):
        sim.step(steps)
        return sim.joint_q[:, :3].copy(), 2 * np.arccos(np.clip(np.abs(sim.joint_q[:, 3]), 0, 1))

    sim.apply_force("rotor", pull)
    most = max(run(1)[1].max() for _ in range(100))
    assert most <= 0.61
    vector, angle = run(500)
    np.testing.assert_allclose(angle, 0.6, atol=excess)
    assert np.abs(sim.joint_qd).max() <= 1e-3
    # it leans the way it is pulled: turned about z x pull
    axis = np.stack([-np.sin(side), np.cos(side), 0 * side], 1)
    np.testing.assert_allclose(vector / np.sin(0.3), axis, atol=5e-3)
    sim.apply_force("rotor", pull[:, [1, 0, 2]])
    most = max(run(1)[1].max() for _ in range(600))
    assert most <= 0.61
    # on its way round it has also twisted, which the cone counts in: about that way
    x, y, z, w = sim.joint_q.T
    lean = np.stack([x * z + w * y, y * z - w * x], 1)
    toward = np.sum(lean * pull[:, [1, 0]], 1) / np.linalg.norm(lean, axis=1) / (5 * flat)
    assert toward.min() > 0.9


def test_joint_force_at_the_limit_of_a_ball():
    """Along the link's axes there too: what is across the axis of the turn does h f / 0.12 in a step."""
    rng = np.random.default_rng(3)
    sim = Simulation(scenes.scene(ROTOR.format("ball", 'range="0 0.6"'), gravity="0 0 0"), 16)
    axis, f = rng.standard_normal((2, 16, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    sim.reset(joint_q=[np.roll(quat_exp(0.65 * a), -1) for a in axis])  # 0.05 rad past it
    sim.set_joint_force(f)
    sim.step()
    along = np.sum(sim.joint_qd * axis, axis=1, keepdims=True)
    assert along.max() < -0.1  # the limit pushes back
    across = f - axis * np.sum(f * axis, axis=1, keepdims=True)
    np.testing.assert_allclose(sim.joint_qd - along * axis, H / 0.12 * across, atol=1e-5)


def test_external_force():
    """F / m at the centre of mass, no turning, whatever the orientation; none in the other worlds."""
    body = '<body name="b" quat="0.5 0.5 0.5 -0.5"><freejoint/>'
    body += '<inertial pos="0.2 0.1 -0.3" mass="2.5" diaginertia="0.1 0.2 0.15"/></body>'
    sim = Simulation(scenes.scene(body, gravity="0 0 0"), 3)
    force = np.array([1.0, -2.0, 3.0])
    sim.apply_force("b", force, [1])
    sim.step(50)
    v = sim.body_qd[:, 0]
    np.testing.assert_allclose(v[1, :3], 0.5 * force / 2.5, rtol=1e-4)
    assert np.abs(v[1, 3:]).max() < 1e-5 and not v[[0, 2]].any()
    sim.apply_force("b", [0, 0, 0], [1])
    sim.step(10)
    np.testing.assert_allclose(sim.body_qd[1, 0, :3], 0.5 * force / 2.5, rtol=1e-4)


def test_force_on_a_body_fixed_to_the_world_changes_nothing():
    """Same bits as without it, drives at and below their limits included."""
    fixed = '<body name="post"><geom size="0.1" pos="3 0 0"/></body>'
    rest = ACT.format(servo("j", 50, 1, limit=0.6))
    model = scenes.scene(fixed + ROTOR.format("hinge", ""), rest=rest)
    out = []
    for force in (0.0, 1e3):
        sim = Simulation(model, 8, lanes=4)
        sim.set_targets(np.linspace(-2, 2, 8)[:, None])
        sim.apply_force("post", [force, -force, force])
        sim.step(20)
        out.append(sim.joint_qd.copy())
    assert np.array_equal(*out)


def test_joint_force():
    """set_joint_force on a free joint: force in the world, torque in the body; on a hinge: tau / I."""
    turned = ROTOR.format("hinge", "") + scenes.ball().replace("<body ", '<body quat="0.6 0 0.8 0" ')
    sim = Simulation(scenes.scene(turned, gravity="0 0 0"), 2)
    f = np.array([0.24, 0.6, 0, -1.2, 0.01, -0.02, 0.03])
    sim.set_joint_force([f, 0 * f])
    sim.step(10)
    v = sim.joint_qd
    assert v[0, 0] == pytest.approx(0.1 * 0.24 / 0.12, rel=1e-5)
    np.testing.assert_allclose(v[0, 1:4], 0.1 * f[1:4] / scenes.MASS, rtol=1e-5)
    np.testing.assert_allclose(v[0, 4:], 0.1 * f[4:] / scenes.SHELL, rtol=1e-5)
    assert not v[1].any()


def test_set_mass():
    """By world: the acceleration under one force, the weight on the ground, the moment of inertia."""
    model = scenes.scene(scenes.ground() + scenes.ball(height=scenes.RADIUS))
    masses = np.array([0.3, 0.6, 1.2])
    sim = Simulation(model, 4)
    sim.set_mass("ball", masses, [0, 1, 2])
    M = sim.mass_matrix()
    np.testing.assert_allclose(M[:, 0, 0], [*masses, 0.6], rtol=1e-6)
    np.testing.assert_allclose(M[:, 5, 5], np.array([*masses, 0.6]) / 0.6 * scenes.SHELL, rtol=1e-6)
    sim.step(50)
    weight = sim.contacts().impulse[:, 0, 0] / H
    np.testing.assert_allclose(weight, 9.81 * np.array([*masses, 0.6]), rtol=1e-4)
    sim.apply_force("ball", [0, 0, 30.0])
    sim.step(1)
    lift = 30 / np.array([*masses, 0.6]) - 9.81
    np.testing.assert_allclose(sim.joint_qd[:, 2], H * lift, rtol=1e-4)


def test_set_contact_by_world():
    model = scenes.scene(scenes.ground() + scenes.ball(height=scenes.RADIUS))
    friction = np.array([0.0, 0.1, 0.2])
    sim = Simulation(model, 4)
    sim.set_contact("ball", "ground", friction=friction, worlds=[0, 2, 3])
    sim.reset(joint_qd=[3.0, 0, 0, 0, 0, 0])
    sim.step(10)  # sliding: v = v0 - mu g t
    got = 3 - sim.joint_qd[:, 0]
    np.testing.assert_allclose(got[[0, 2, 3]], friction * 9.81 * 0.1, atol=1e-4)
    assert got[1] == pytest.approx(0.8 * 9.81 * 0.1, rel=1e-3)


def test_root_drive_of_a_free_body():
    """At rest a driven free body hangs m g / kp below its target; it turns to its target; zeros let go."""
    sim = Simulation(scenes.scene(scenes.ball()), 1)
    target = [0.5, -0.3, 2.0, *np.sin(0.5) * np.array([0.6, 0, 0.8]), np.cos(0.5)]
    sim.set_targets(target)
    sim.set_root_drive(400, 20, 0.5, 0.03)
    sim.step(800)
    got = sim.joint_q[0].copy()
    sag = scenes.MASS * 9.81 / 400
    np.testing.assert_allclose(got[:3], [0.5, -0.3, 2.0 - sag], atol=1e-4)
    np.testing.assert_allclose(got[3:], target[3:], atol=1e-4)
    sim.set_root_drive(0, 0, 0, 0)
    sim.step(10)
    assert sim.joint_qd[0, 2] == pytest.approx(-0.981, rel=1e-3)


def test_root_drive_of_the_player_tracks():
    """Lifted off the ground and drawn along at 0.5 m/s, the root follows where the law puts it."""
    model = Model.load("player")
    sim = Simulation(model, 2)
    sim.set_root_drive(2e4, 2e3, 2e3, 2e2)
    target = np.tile(model.start_q, (2, 1))
    target[:, 2] += 0.3
    for k in range(150):
        target[:, 0] = 0.5 * H * k
        sim.set_targets(target)
        sim.step()
    root = sim.joint_q[:, :3]
    # behind by kd v / kp = 5 cm: the drive damps the velocity, not its difference from the target's
    lag = 0.5 * 2e3 / 2e4 + 0.5 * H
    sag = model.body_mass[:-1].sum() * 9.81 / 2e4
    np.testing.assert_allclose(root, target[:, :3] - [lag, 0, sag], atol=0.01)
    assert (sim.status == 0).all()
