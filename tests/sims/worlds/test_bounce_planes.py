"""Balls among planes: far ones change nothing, and near ones are struck one after the other."""

import numpy as np
import pytest

from tests.reference.scenes import GRAVITY, MASS, RADIUS, ball, ground, record, scene
from tests.sims.worlds.test_bounce import apexes
from warpdribble.sims import Simulation

H = 0.01


def plane(name, normal, at="0 0 0", restitution=1.0):
    return (
        f'<geom name="{name}" type="plane" size="0 0 1" pos="{at}" zaxis="{normal}" friction="0.8"'
        f' user="{restitution} 0.2 1e-5"/>'
    )


def thrown(model, x, v, spin=(0, 0, 0), restitution=None, friction=None):
    """(n, 3) places of the centre, velocities at the step's start."""
    x, v = np.atleast_2d(x), np.atleast_2d(v)
    sim = Simulation(model, len(x))
    q, qd = np.zeros((len(x), 7)), np.zeros((len(x), 6))
    q[:, :3], q[:, 6], qd[:, :3], qd[:, 3:] = x, 1.0, v, spin
    sim.reset(joint_q=q, joint_qd=qd)
    for other in [s.name for s in model.shapes if s.kind == "plane"]:
        sim.set_contact("ball", other, restitution, friction)
    return sim


FAR = [
    plane("wall", "-1 0 0", "10 0 0"),
    plane("wall2", "1 0 0", "-0.5 0 0"),
    plane("roof", "0 0 -1", "0 0 30"),
    plane("ramp", "-1 0 1", "2 0 0"),
    '<geom name="step" type="box" size="1 1 0.1" pos="2.5 0 0.1" user="1 0.2 1e-5"/>',
    '<geom name="rail" type="capsule" size="0.1 1" pos="0 1 0.1" user="1 0.2 1e-5"/>',
    ball("other").replace('pos="0 0 1.0"', 'pos="0 -1 0.12"'),
]


@pytest.mark.parametrize("count", range(1, len(FAR) + 1))
def test_what_is_far_changes_nothing(count):
    """Apexes of e^2n within 0.1 %, whatever else stands about."""
    model = scene(ground() + ball() + "".join(FAR[:count]), H)
    sim = Simulation(model, 1)
    q = model.start_q.copy()
    q[2] = RADIUS + 1.3
    sim.reset(joint_q=q)
    sim.set_contact("ball", "ground", 0.8)
    gap = record(sim, 400)[:, 0, 2] - RADIUS
    np.testing.assert_allclose(apexes(gap, 4), 1.3 * 0.64 ** np.arange(1, 5), rtol=1e-3)


def test_it_ends_where_something_else_is_in_reach():
    """A box under the ball in the step of the impact: the ball bounces off both, by the solver's rule, and
    does not fly through."""
    model = scene(ground() + ball() + FAR[4], H)
    sim = thrown(model, [1.5 - RADIUS - 0.02, 0, RADIUS + 0.02], [3.0, 0, -3.0])
    sim.step(2)
    v = sim.joint_qd[0]
    assert v[0] < 0.1 and v[2] > -0.1 and sim.joint_q[0, 0] < 1.5 - RADIUS + 1e-3


def corner(angle_deg=90.0, gravity="0 0 0"):
    """A wall and another, `angle` apart, that meet in the z axis; the ball between them, x > 0."""
    a = np.radians(angle_deg)
    normals = "0 1 0", f"{np.sin(a)} {-np.cos(a)} 0"
    walls = plane("a", normals[0]) + plane("b", normals[1])
    return scene(walls + ball(), H, gravity=gravity)


def test_two_walls_within_a_step():
    """A billiard's corner, without friction: the way is that of a ball that flies on straight into the
    mirrored room, both coordinates turned round."""
    model = corner()
    random = np.random.default_rng(1)
    x = RADIUS + random.uniform(0.001, 0.02, (64, 2))
    v = -random.uniform(2.1, 8.0, (64, 2))
    sim = thrown(model, np.c_[x, np.zeros(64)], np.c_[v, np.zeros(64)], restitution=1.0, friction=0.0)
    sim.step()
    through = x + H * v - RADIUS
    both = (through < 0).all(axis=1)
    assert both.sum() > 20
    np.testing.assert_allclose(sim.joint_q[:, :2], RADIUS + np.abs(through), atol=1e-6)
    np.testing.assert_allclose(sim.joint_qd[:, :2], np.where(through < 0, -v, v), atol=1e-5)
    knock = sim.contacts().impulse[:, :, 0]  # of the walls a: y, and b: x
    np.testing.assert_allclose(knock, np.where(through < 0, -2 * MASS * v, 0)[:, ::-1], atol=1e-4)


@pytest.mark.parametrize("angle", [10.0, 30.0, 60.0, 75.0, 90.0, 120.0])
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_wedges_give_no_energy(angle, friction):
    """Thrown into the edge of a wedge, elastic: energy stays without friction, but for impacts below 0.1 m/s,
    and never grows with it."""
    model = corner(angle)
    random = np.random.default_rng(2)
    n, half = 64, np.radians(angle) / 2
    along = RADIUS / np.sin(half) + random.uniform(0.001, 0.1, n)
    x = np.c_[along * np.cos(half), along * np.sin(half), np.zeros(n)]
    v = np.c_[-random.uniform(0.5, 8.0, n), random.uniform(-2, 2, (n, 2))]
    spin = 10 * random.standard_normal((n, 3))
    sim = thrown(model, x, v, spin, 1.0, friction)

    def energy():
        M, qd = sim.mass_matrix().astype(float), sim.joint_qd.astype(float)
        return 0.5 * np.einsum("ni,nij,nj->n", qd, M, qd)

    start = least = energy()
    for _ in range(60):
        sim.step()
        now = energy()
        assert (now <= least * (1 + 1e-5)).all()
        least = now
        assert sim.contacts().gap.min() > -1e-3  # never inside a wall
    if friction == 0.0 and angle >= 30.0:
        np.testing.assert_allclose(least, start, rtol=2e-3)


def test_a_shaft_that_all_but_holds_it():
    """Between walls 4 mm farther apart than the ball is wide: more impacts in a step than are followed.
    Nothing grows, along the walls nothing is lost, and the ball stays inside."""
    walls = plane("left", "1 0 0") + plane("right", "-1 0 0", f"{2 * RADIUS + 0.004} 0 0")
    model = scene(walls + ball(), H, gravity="0 0 0")
    sim = thrown(model, [RADIUS + 0.001, 0, 0], [5.0, 0.3, 0], restitution=1.0, friction=0.0)
    speed = 5.0
    for _ in range(200):
        sim.step()
        now = abs(float(sim.joint_qd[0, 0]))
        assert now <= speed * (1 + 1e-5)
        speed = max(now, 0.3)
        assert -1e-3 < sim.joint_q[0, 0] - RADIUS < 5e-3
    assert sim.joint_qd[0, 1] == pytest.approx(0.3, abs=1e-5)


def test_floor_and_wall_at_once():
    """Dropped along a wall that it touches: the floor's bounce is as exact as without, and the wall gives
    nothing."""
    model = scene(ground() + ball() + plane("wall", "1 0 0"), H)
    sim = thrown(model, [RADIUS, 0, RADIUS + 1.0], [0, 0, 0], restitution=0.8)
    path = record(sim, 300)[:, 0]
    np.testing.assert_allclose(apexes(path[:, 2] - RADIUS, 4), 0.64 ** np.arange(1, 5), rtol=1e-3)
    assert np.abs(path[:, 0] - RADIUS).max() < 1e-4


def test_it_rolls_on_along_a_floor_and_off_a_wall():
    """A ball on the floor strikes a wall at 3 m/s: it leaves with e times that, less what friction does to
    its spin (2/5 of the slip at the wall, upward)."""
    model = scene(ground() + ball() + plane("wall", "-1 0 0", "1 0 0"), H)
    sim = thrown(model, [0.5, 0, RADIUS], [3.0, 0, 0], restitution=0.6, friction=0.0)
    sim.step(20)
    assert sim.joint_qd[0, 0] == pytest.approx(-1.8, abs=1e-4)
    assert abs(sim.joint_q[0, 2] - RADIUS) < 1e-3
    met = (1 - RADIUS - 0.5) / 3.0
    assert sim.joint_q[0, 0] == pytest.approx(1 - RADIUS - 1.8 * (0.2 - met), abs=1e-4)


def test_a_ramp():
    """Off an incline of 45 degrees, without friction: what came down leaves sideways."""
    model = scene(plane("ramp", "1 0 1") + ball(), H)
    v = np.sqrt(2 * GRAVITY * 1.0)
    sim = thrown(model, [0, 0, np.sqrt(2) * RADIUS + 1.0], [0, 0, 0], restitution=1.0, friction=0.0)
    steps = int(v / GRAVITY / H) + 3
    sim.step(steps)
    assert sim.joint_qd[0, 0] == pytest.approx(v, rel=1e-3)
    since = steps * H - v / GRAVITY
    assert sim.joint_qd[0, 2] == pytest.approx(-GRAVITY * since, abs=0.06)
