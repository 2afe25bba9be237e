"""Where and when a flying ball comes down, and when it is met on its way up again: against a parabola in
float64, and against the ball that is simulated."""

import numpy as np
import pytest

from tests.reference.scenes import GRAVITY, RADIUS, ball, ground, record, scene
from warpdribble.sims import Simulation
from warpdribble.sims.worlds import Place, Probe, terms

H = 0.01
E, MEET = 0.8, 0.9
WORLDS = 64


@pytest.fixture(scope="module")
def model():
    """A ball, and a root that is out of its way; a probe faces with the first free joint."""
    root = (
        '<body name="root" pos="0 0 1"><freejoint name="root"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    )
    return scene(ground() + root + ball(), H)


def flights(random, count=WORLDS):
    """(count, 14) joint_q and (count, 12) joint_qd: balls that rise and fall, some of them so slowly, or so
    low, that they never come to MEET, in any place up to 10 m away; roots that face anywhere."""
    q, qd = np.zeros((count, 14)), np.zeros((count, 12))
    q[:, :2], q[:, 2] = random.uniform(-10, 10, (count, 2)), 1.0
    heading = random.uniform(-np.pi, np.pi, count)
    q[:, 5], q[:, 6] = np.sin(heading / 2), np.cos(heading / 2)
    q[:, 7:9], q[:, 9] = random.uniform(-10, 10, (count, 2)), random.uniform(RADIUS + 0.02, 1.5, count)
    q[:, 13] = 1.0
    qd[:, 6:8], qd[:, 8] = random.uniform(-3, 3, (count, 2)), random.uniform(-6, 4, count)
    return q.astype(np.float32), qd.astype(np.float32), heading


def start(model, lanes, q, qd, restitution=E, meet=MEET):
    sim = Simulation(model, len(q), lanes=lanes)
    sim.set_contact("ball", "ground", restitution=restitution)
    sim.reset(joint_q=q, joint_qd=qd)
    return sim, Probe(sim, {"flight": terms.ballistic("ball", RADIUS, meet, restitution)})


def facing(x, heading):
    """(n, 2) along the world's axes, in the facing frame."""
    c, s = np.cos(heading), np.sin(heading)
    return np.stack([c * x[:, 0] + s * x[:, 1], c * x[:, 1] - s * x[:, 0]], axis=1)


def foretold(q, qd, heading, restitution=E, meet=MEET):
    """Time to the ground, where that is, and time to the meeting height, by formulas in float64. The velocity
    of semi-implicit Euler is half a step behind: the parabola that places lie on has v - g h / 2."""
    z, v = q[:, 9].astype(float) - RADIUS, qd[:, 8] - GRAVITY * H / 2
    up = meet - RADIUS
    lands = (v + np.sqrt(v**2 + 2 * GRAVITY * z)) / GRAVITY
    place = facing(q[:, 7:9] + lands[:, None] * qd[:, 6:8] - q[:, :2], heading)
    rise = restitution * np.sqrt(v**2 + 2 * GRAVITY * z)
    with np.errstate(invalid="ignore"):
        now = (v - np.sqrt(v**2 - 2 * GRAVITY * (up - z))) / GRAVITY
        late = lands + (rise - np.sqrt(rise**2 - 2 * GRAVITY * up)) / GRAVITY
    highest = lands + rise / GRAVITY
    rising = (v > 0) & (now > 0)
    case = np.select([rising, np.isfinite(late)], ["now", "after a bounce"], "never")
    time = np.select([case == "now", case == "after a bounce"], [now, late], highest)
    return np.column_stack([lands, place, time]), case


@pytest.mark.parametrize("lanes", [1, 16])
def test_against_formulas(model, lanes):
    """To the rounding of places 20 m apart. Where a ball only just comes to MEET the root of a small number
    is taken: those are left out."""
    q, qd, heading = flights(np.random.default_rng(0), 500)
    _, probe = start(model, lanes, q, qd)
    expected, case = foretold(q, qd, heading)
    assert min(np.sum(case == kind) for kind in ("now", "after a bounce", "never")) > 30
    short = np.abs(foretold(q, qd, heading, meet=MEET + 1e-3)[0][:, 3] - expected[:, 3]) < 5e-3
    assert short.mean() > 0.95
    felt = probe.read()
    np.testing.assert_allclose(felt[:, 0], expected[:, 0], atol=1e-6)
    np.testing.assert_allclose(felt[:, 1:3], expected[:, 1:3], atol=8e-6)
    np.testing.assert_allclose(felt[short, 3], expected[short, 3], atol=5e-6)


@pytest.mark.parametrize("lanes", [1, 16])
def test_against_the_ball_itself(model, lanes):
    """What was foretold from the first state happens: times to 0.1 ms, places to 0.1 mm, from parabolas
    through what is simulated before and after the first bounce."""
    random = np.random.default_rng(1)
    q, qd, heading = flights(random)
    q[:, [0, 1, 7, 8]] /= 5  # near, so that rounding is less than a parabola through it shows
    sim, probe = start(model, lanes, q, qd)
    felt = probe.read()
    seen = record(
        sim, 250, lambda sim: np.column_stack([sim.joint_q[:, 7:10], sim.contacts().impulse[..., 0]])
    )
    cases = []
    for k in range(WORLDS):
        flight = observed(seen[:, k, :3], seen[:, k, 3])
        if flight is None:
            continue
        lands, at, met, case, top = flight
        cases.append(case)
        assert felt[k, 0] == pytest.approx(lands, abs=1e-4)
        np.testing.assert_allclose(felt[k, 1:3], facing(at - q[k, :2], heading[k : k + 1])[0], atol=1e-4)
        if case == "now" or abs(top - MEET) > 5e-3:  # else the root of a small number
            assert felt[k, 3] == pytest.approx(met, abs=2e-4), case
    assert len(cases) > 40 and min(cases.count(c) for c in ("now", "after a bounce", "never")) >= 3


def observed(x, knock):
    """Of a recorded ball: when [s] and where (1, 2) it first touches the ground, when it passes MEET upwards,
    how that came, and the highest point after the bounce [m]. None where too little is seen."""
    t, bounces = H * np.arange(len(x)), np.flatnonzero(knock > 0)
    if len(bounces) < 2 or bounces[0] < 3 or bounces[1] < bounces[0] + 3:
        return None
    before, after = slice(0, bounces[0]), slice(bounces[0], bounces[1])  # x[bounces[0]] is after it
    falling, rising = (np.polyfit(t[part], x[part, 2].astype(float), 2) for part in (before, after))
    lands = max(np.roots(falling - [0, 0, RADIUS]).real)
    at = [np.polyval(np.polyfit(t[before], x[before, c], 1), lands) for c in (0, 1)]
    top = rising[2] - rising[1] ** 2 / (4 * rising[0])
    now, late = upward(falling), upward(rising)
    if now is not None and 0 < now < lands:
        return lands, np.array([at]), now, "now", top
    if late is not None and late > lands:
        return lands, np.array([at]), late, "after a bounce", top
    return lands, np.array([at]), -rising[1] / (2 * rising[0]), "never", top


def upward(parabola):
    """When it passes MEET on its way up; None where it never does."""
    a, b, c = parabola
    inside = b**2 - 4 * a * (c - MEET)
    return (-b + np.sqrt(inside)) / (2 * a) if inside > 0 else None  # a < 0: the earlier of the two


def test_it_is_foretold_the_same_all_the_way_down(model):
    """A step later, a step less to go: what falls freely brings no news, to rounding."""
    q, qd, _ = flights(np.random.default_rng(2), 16)
    q[:, 9], qd[:, 8] = 2.0, -1.0
    sim, probe = start(model, 16, q, qd)
    felt = record(sim, 30, lambda sim: probe.read())
    lands = felt[..., 0] + H * np.arange(31)[:, None]
    np.testing.assert_allclose(lands, np.tile(lands[0], (31, 1)), atol=5e-6)
    met = felt[..., 3] + H * np.arange(31)[:, None]
    np.testing.assert_allclose(met, np.tile(met[0], (31, 1)), atol=5e-6)
    np.testing.assert_allclose(felt[..., 1:3], np.tile(felt[0, :, 1:3], (31, 1, 1)), atol=5e-5)


@pytest.mark.parametrize("lanes", [1, 16])
def test_a_ball_on_the_ground_is_there_already(model, lanes):
    """At rest, or a little inside: no time at all, and its highest point is now, as impacts below 0.1 m/s do
    not bounce."""
    q, qd, heading = flights(np.random.default_rng(3), 3)
    q[:, 9], qd[:] = [RADIUS, RADIUS - 1e-3, RADIUS - 0.01], 0.0
    _, probe = start(model, lanes, q, qd)
    felt = probe.read()
    np.testing.assert_allclose(felt[:, [0, 3]], 0.0, atol=1e-6)
    np.testing.assert_allclose(felt[:, 1:3], facing(q[:, 7:9] - q[:, :2], heading), atol=4e-6)


def test_of_a_place_on_a_body(model):
    """Any place can be followed as if it flew, and each term has numbers of its own."""
    q, qd, heading = flights(np.random.default_rng(4), 4)
    sim = Simulation(model, 4)
    sim.reset(joint_q=q, joint_qd=qd)
    of = {
        "ball": terms.ballistic("ball", RADIUS, MEET, E),
        "dull": terms.ballistic("ball", RADIUS, MEET, 0.5),
        "root": terms.ballistic(Place("root", (0.0, 0.0, 0.2)), 0.0, 5.0, 0.0),
    }
    felt = Probe(sim, of).read()
    np.testing.assert_allclose(felt[:, 3], foretold(q, qd, heading)[0][:, 3], atol=5e-6)
    np.testing.assert_allclose(felt[:, 7], foretold(q, qd, heading, 0.5)[0][:, 3], atol=5e-6)
    fall = -GRAVITY * H / 2
    lands = (fall + np.sqrt(fall**2 + 2 * GRAVITY * 1.2)) / GRAVITY
    np.testing.assert_allclose(felt[:, 8], lands, atol=1e-6)
    np.testing.assert_allclose(felt[:, 9:11], 0.0, atol=1e-6)
    np.testing.assert_allclose(felt[:, 11], lands, atol=1e-6)
