"""Nothing at rest gains energy or sinks, however heavy on however light; overlap is taken back quietly."""

import numpy as np
import pytest

from tests.reference.scenes import GRAVITY, ground, record, scene
from warpdribble.sims import Simulation

H = 0.01


def geom(name, kind, size, mass, friction=0.8, **more):
    """A body of one shape with nothing bouncy about it."""
    at = " ".join(f'{key}="{value}"' for key, value in more.items())
    return (
        f'<body name="{name}"><freejoint/><geom name="{name}" type="{kind}" size="{size}" mass="{mass}"'
        f' friction="{friction}" user="0 0.2 1e-5" {at}/></body>'
    )


def energy(sim):
    """(worlds,) [J], of bodies whose frames are their principal axes."""
    pose, velocity = (x.astype(float) for x in sim.bodies())
    m, inertia = sim.model.body_mass, sim.model.body_inertia
    x, y, z, w = np.moveaxis(pose[..., 3:], -1, 0)
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    spin = np.einsum("ijwb,wbi->wbj", R, velocity[..., 3:])
    turning = 0.5 * np.einsum("wbi,bij,wbj->w", spin, inertia, spin)
    moving = 0.5 * np.einsum("b,wbi->w", m, velocity[..., :3] ** 2)
    return turning + moving + GRAVITY * pose[..., 2] @ m


@pytest.mark.parametrize("lanes", [1, 16])
def test_heavy_rests_on_light(lanes):
    """From 1 to 1000 times as heavy, it sinks in by what its contacts yield, cfm m g h / erp each, within
    0.2 mm, and never rises."""
    ratio = np.array([1, 10, 31, 45, 122, 300, 1000.0])
    yields = 1e-5 * 0.62 * ratio * GRAVITY * H / 0.2
    model = scene(ground() + geom("light", "sphere", 0.12, 0.62) + geom("heavy", "sphere", 0.12, 0.62), H)
    q = np.zeros((len(ratio), 14))
    q[:, [2, 9]], q[:, [6, 13]] = [0.12, 0.36], 1
    sim = Simulation(model, len(ratio), lanes=lanes)
    sim.reset(joint_q=q)
    sim.set_mass("heavy", 0.62 * ratio)
    z = record(sim, 300, lambda sim: sim.joint_q[:, [2, 9]])
    belongs = np.array([0.12, 0.36]) - yields[:, None] * [1, 2]
    print("highest", (z - [0.12, 0.36]).max((0, 2)), "lowest", (z - belongs).min((0, 2)))
    assert (z - [0.12, 0.36]).max() <= 1e-5
    assert (z - belongs).min() >= -2e-4
    np.testing.assert_allclose(z[-1], belongs, atol=2e-4)


def tower(random, overlap):
    """A column of 2 to 6 bodies, each up to 100 times as heavy as another, that touch or overlap by up to
    `overlap` [m]: (xml, joint_q)."""
    boxed, bodies, q, top, below = random.random() < 0.4, [], [], 0.0, "plane"
    for k in range(random.integers(2, 7)):
        fits = {"plane": ["sphere", "box" if boxed else "capsule"], "sphere": ["sphere", "capsule"]}
        kind = random.choice(fits.get(below, ["sphere"] if boxed else ["sphere", "capsule"]))
        if boxed and kind == "capsule":  # boxes with capsules are not simulated
            kind = "sphere"
        radius = random.uniform(0.05, 0.12)
        wide = f"{random.uniform(0.1, 0.3)} {random.uniform(0.1, 0.3)} {radius}"
        size = {"sphere": f"{radius}", "capsule": f"{radius} {random.uniform(0.1, 0.3)}", "box": wide}[kind]
        lies = {"euler": f"1.5707963 {random.choice([0, 1.5707963, random.uniform(0, 3)])} 0"}
        mass = 100 ** random.random()
        bodies.append(geom(f"b{k}", kind, size, mass, **(lies if kind == "capsule" else {})))
        middle = top + radius - overlap * random.random()
        q += [0, 0, middle, 0, 0, 0, 1]
        top, below = middle + radius, kind
    return "".join(bodies), q


@pytest.mark.parametrize("overlap", [0.0, 0.005])
def test_towers_only_fall(overlap):
    """Random towers for 3 s: they may topple, but energy stays below the start's and what taking overlap back
    lifts, within 1 %; and whatever comes to rest has sunk in by less than 1 mm."""
    random = np.random.default_rng(1)
    for _ in range(25):
        xml, q = tower(random, overlap)
        model = scene(ground() + xml, H)
        sim = Simulation(model, 1, lanes=1)
        sim.reset(joint_q=q)
        # every body is lifted by what overlaps below it, at most
        lift = overlap * GRAVITY * np.arange(1, model.nbody + 1) @ model.body_mass
        start = energy(sim)
        e = record(sim, 300, energy)
        slow = np.abs(sim.body_qd).max() < 0.05
        assert e.max() <= 1.01 * start + lift
        assert sim.body_q[0, :, 2].min() > 0.045
        if slow:
            assert sim.contacts().gap.min() > -1e-3


@pytest.mark.parametrize("deep", [0.01, 0.05, 0.11])
def test_overlap_is_not_shot_out(deep):
    """A ball and a box that start deep in the floor, and a ball in a ball: they come out, and rise no further
    than to touch, plus what a push too small to care for lifts: 1 mm."""
    low, other = geom("b", "sphere", 0.12, 5), geom("c", "sphere", 0.12, 0.1)
    for xml, q in (
        (geom("b", "sphere", 0.12, 5), [0, 0, 0.12 - deep, 0, 0, 0, 1]),
        (geom("b", "box", "0.2 0.15 0.12", 5), [0, 0, 0.12 - deep, 0, 0, 0, 1]),
        (low + other, [0, 0, 0.12, 0, 0, 0, 1, 0, 0, 0.36 - deep, 0, 0, 0, 1]),
    ):
        sim = Simulation(scene(ground() + xml, H), 1)
        sim.reset(joint_q=q)
        z = record(sim, 200, lambda sim: sim.body_q[0, :, 2])
        belongs = 0.12 + 0.24 * np.arange(z.shape[1])
        assert (z - belongs).max() <= 1e-3
        assert z[-1] == pytest.approx(belongs, abs=1e-3)


RAILS = (
    '<geom name="left" type="capsule" fromto="-1 -0.03 0 1 -0.03 0" size="0.05" user="0 0.2 1e-5"/>'
    '<geom name="right" type="capsule" fromto="-1 0.03 0 1 0.03 0" size="0.05" user="0 0.2 1e-5"/>'
)


@pytest.mark.parametrize("turn", [0, 0.003, 0.02, 0.1])
def test_log_between_rails(turn):
    """In the groove of two parallel rails it comes to rest, as deep as geometry says, along them; laid in it
    askew friction holds it as it lies."""
    model = scene(RAILS + geom("log", "capsule", "0.05 0.5", 1, euler="0 1.5707963 0"), H)
    depth = np.sqrt(0.1**2 - 0.03**2)
    sim = Simulation(model, 1)
    sim.reset(joint_q=[0.1, 0, depth + 0.002 + 0.05 * turn, 0, 0, np.sin(turn / 2), np.cos(turn / 2)])
    sim.step(400)
    assert np.abs(sim.joint_qd).max() <= (5e-3 if turn else 1e-3)  # askew it may creep, 0.2 mm/s
    assert sim.joint_q[0, 5] == pytest.approx(np.sin(turn / 2), abs=0.005)
    touch = sim.contacts()
    assert np.abs(touch.gap[touch.impulse[..., 0] > 0]).max() <= 1e-4
    if turn == 0:
        assert sim.joint_q[0, 2] == pytest.approx(depth, abs=1e-4)


def test_rod_on_a_capsule():
    """A rod balanced along another lies still: two contacts carry half each; across it, one carries all."""
    for angle, contacts in ((0.0, 2), (0.1, 2), (1.2, 1)):
        fixed = '<geom name="bar" type="capsule" fromto="-1 0 0 1 0 0" size="0.05" user="0 0.2 1e-5"/>'
        model = scene(fixed + geom("rod", "capsule", "0.05 0.3", 2, euler="0 1.5707963 0"), H)
        sim = Simulation(model, 1)
        sim.reset(joint_q=[0, 0, 0.1, 0, 0, np.sin(angle / 2), np.cos(angle / 2)])
        sim.step(20)
        push = sim.contacts().impulse[0, :, 0]
        assert (push > 0.01 * push.max()).sum() == contacts
        assert push.sum() / H == pytest.approx(2 * GRAVITY, rel=0.01)
        if contacts == 2:
            np.testing.assert_allclose(push, push.mean(), rtol=0.05)


def test_contacts_move_steadily_as_capsules_turn():
    """From parallel to crossed, neither end of their contact jumps."""
    bodies = geom("a", "capsule", "0.05 0.3", 1, euler="0 1.5707963 0") + geom(
        "b", "capsule", "0.06 0.2", 1, euler="0 1.5707963 0"
    )
    angles = np.linspace(-0.4, 0.4, 4001)
    q = np.zeros((len(angles), 14))
    q[:, 6], q[:, 7:10] = 1, [0.05, 0, 0.1097]
    q[:, 12], q[:, 13] = np.sin(angles / 2), np.cos(angles / 2)
    sim = Simulation(scene(bodies, H, gravity="0 0 0"), len(angles))
    sim.reset(joint_q=q)
    touch = sim.contacts()
    one, two = touch.point[:, 0], touch.point[:, 1]
    used = touch.gap[:, 1] < 1
    assert used[np.abs(angles) < 0.2].all() and not used[np.abs(angles) > 0.26].any()
    parallel = np.abs(angles).argmin()
    # as long as the shorter one's axis
    assert np.ptp([one[parallel, 0], two[parallel, 0]]) == pytest.approx(0.4, abs=1e-3)
    steps = np.abs(np.diff(one, axis=0)).max(), np.abs(np.diff(two, axis=0))[used[1:] & used[:-1]].max()
    print("largest steps [m]", steps)
    assert max(steps) <= 0.02
    at_end = np.flatnonzero(np.diff(used))
    assert np.abs(one - two)[at_end].max() <= 0.01


def test_worlds_stop_for_themselves():
    """A world that needs many sweeps changes no bit of its neighbours, whom few suffice."""
    model = scene(
        ground() + geom("light", "sphere", 0.12, 0.62) + geom("heavy", "box", "0.1 0.1 0.1", 0.62), H
    )
    q = np.array([0, 0, 0.12, 0, 0, 0, 1, 0.3, 0, 0.1, 0, 0, 0, 1])
    q = np.tile(q, (16, 1))
    q[:, 9] += np.linspace(0, 0.3, 16)
    q[8:, 7] = 0.02  # onto the ball
    mass = 0.62 * np.geomspace(1, 300, 16)

    def run(worlds):
        sim = Simulation(model, len(worlds), lanes=16)
        sim.reset(joint_q=q[worlds])
        sim.set_mass("heavy", mass[worlds])
        sim.set_contact("heavy", "ground", restitution=0.5)
        sim.step(100)
        return np.concatenate([sim.joint_q, sim.joint_qd], axis=1)

    together = run(np.arange(16))
    for world in (0, 3, 8, 12, 15):
        np.testing.assert_array_equal(run(np.array([world]))[0], together[world])
