"""`Probe` against float64: what is felt of a player, wherever it stands and however it faces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.reference import scenes
from tests.sims.worlds.float64 import (
    Bodies,
    apart,
    centres,
    integrate,
    moved,
    moving,
    poses,
    speed,
    unit,
)
from warpdribble.sims import Simulation
from warpdribble.sims.worlds import Place, Probe, terms
from warpdribble.sims.worlds.places import tip
from warpdribble.sims.worlds.simulation import BAD_CONTACT, FALL, NONFINITE, OVERSPEED

FELT = ("l_foot", "r_foot", "head")
JUDGED = ("lower_back", "neck", "l_hip", "l_knee", "r_ankle", "r_toes", "l_elbow")
ARMS = ("l_elbow", "r_shoulder")
WORLDS, ROWS = 19, 7
HERE = Place("r_lower_arm", (0.1, -0.2, 0.3))
"""Off every axis."""


@pytest.fixture(scope="module", params=["all joints and a ball", "stiff hands"])
def model(request, stiff, player):
    return stiff if request.param == "stiff hands" else player


def goals(model, random):
    """Tables of goals, their quaternions of either sign."""
    q = poses(model, random, ROWS)
    for k in model.quaternions():
        q[:, k : k + 4] *= random.choice([-1, 1], (ROWS, 1))
    return q, random.standard_normal((ROWS, model.nv)).astype(np.float32)


def everything(model):
    """Terms of every kind, some twice, but for a ball's flight and the status, which have tests of their
    own."""
    return {
        "lean": terms.lean(),
        "height": terms.height(),
        "com": terms.com(),
        "com_velocity": terms.com_velocity(),
        "momentum": terms.momentum(),
        "spin": terms.spin(),
        "facing": terms.facing(),
        "miss": terms.miss(JUDGED),
        **{name: terms.point(name) for name in FELT},
        "palm": terms.point("r_palm"),
        "here": terms.point(HERE),
        "tip": terms.point(tip(model, "l_toes")),
        "over": terms.from_com("l_foot"),
        "reach": terms.from_com(HERE),
        "way": terms.between("r_palm", "head"),
        "back": terms.between(HERE, "l_palm"),
        "foot velocity": terms.velocity("l_foot"),
        "hand velocity": terms.velocity(HERE),
        "miss of arms": terms.miss(ARMS),
    }


def probe(model, goal_q, goal_qd, worlds=WORLDS, **how):
    sim = Simulation(model, worlds, **how)
    return sim, Probe(sim, everything(model), (goal_q, goal_qd))


def expected(bodies, q=None, qd=None, goal_q=None, goal_qd=None):
    """What the terms of `everything` should say, by name; velocities of places and misses only where the
    joints are given."""
    model, face, ground = bodies.model, bodies.facing, bodies.ground
    com, com_velocity, momentum = bodies.whole()
    end, level = tip(model, "l_toes"), bodies.R[:, bodies.own[0], :2, 0]
    out = {
        "lean": face(bodies.R[:, bodies.own[0], :, 2])[:, :2],
        "height": bodies.body_q[:, bodies.own[0], 2:3],
        "com": face(com - ground),
        "com_velocity": face(com_velocity),
        "momentum": face(momentum),
        "spin": face(bodies.spin[:, bodies.own[0]]),
        "facing": level / np.linalg.norm(level, axis=1, keepdims=True),
        **{name: face(bodies.at(name) - ground) for name in FELT},
        "palm": face(bodies.at("r_palm") - ground),
        "here": face(bodies.at(HERE) - ground),
        "tip": face(bodies.at(end) - ground),
        "over": face(bodies.at("l_foot") - com),
        "reach": face(bodies.at(HERE) - com),
        "way": face(bodies.at("head") - bodies.at("r_palm")),
        "back": face(bodies.at("l_palm") - bodies.at(HERE)),
    }
    if q is not None:
        out["foot velocity"] = face(speed(model, q, qd, "l_foot"))
        out["hand velocity"] = face(speed(model, q, qd, HERE))
        out["miss"] = apart(model, q, qd, goal_q, goal_qd, JUDGED)
        out["miss of arms"] = apart(model, q, qd, goal_q, goal_qd, ARMS)
    return out


def named(probe, felt):
    return {name: felt[:, columns] for name, columns in probe.columns.items()}


RATES = ("com_velocity", "spin", "foot velocity", "hand velocity")


def close(felt, expected):
    """By name. float32 carries places of some metres to about 1e-6; momenta are sums of 70 kg at some m/s."""
    for name in expected:
        tolerance = np.full(felt[name].shape[1], {"momentum": 1e-3}.get(name, 4e-6))
        if name in RATES:
            tolerance[:] = 2e-5
        if name.startswith("miss"):
            tolerance[1] = 2e-5
        for k in range(len(tolerance)):
            a, b = felt[name][:, k], expected[name][:, k]
            np.testing.assert_allclose(a, b, atol=tolerance[k], rtol=4e-6, err_msg=f"{name} {k}")


@pytest.mark.parametrize("lanes", [1, 16])
def test_every_term(model, lanes):
    """Each world has a goal of its own, and their number fills no vector unit."""
    random = np.random.default_rng(1)
    q, qd = poses(model, random, WORLDS), random.standard_normal((WORLDS, model.nv)).astype(np.float32)
    goal_q, goal_qd = goals(model, random)
    sim, felt_by = probe(model, goal_q, goal_qd, lanes=lanes)
    sim.reset(joint_q=q, joint_qd=qd)
    rows = random.integers(ROWS, size=WORLDS)
    felt = felt_by.read(rows)
    should = expected(moving(model, q, qd), q, qd, goal_q[rows], goal_qd[rows])
    assert list(should) and set(should) == set(felt_by.columns)
    assert felt.shape == (WORLDS, felt_by.size) == (WORLDS, sum(v.shape[1] for v in should.values()))
    for name, values in should.items():  # every column says something
        assert np.isfinite(values).all() and np.ptp(values, axis=0).min() > 0.05, name
    close(named(felt_by, felt), should)
    np.testing.assert_array_equal(sim.joint_q, unit(model, q))  # it only looks
    np.testing.assert_array_equal(sim.joint_qd, qd)


def test_momentum_of_a_moving_player_from_the_simulation_s_own_bodies(stiff):
    """After steps with contacts, from `body_q` and `body_qd`; masses differ between the worlds."""
    random = np.random.default_rng(2)
    q = np.tile(stiff.start_q, (WORLDS, 1))
    q[:, 2] += random.uniform(0.0, 0.05, WORLDS)
    sim, felt_by = probe(stiff, *goals(stiff, random))
    mass = random.uniform(2.0, 20.0, WORLDS)
    sim.set_mass("head", mass)
    sim.reset(joint_q=q, joint_qd=random.standard_normal((WORLDS, stiff.nv)))
    sim.step(10)
    body_q, body_qd = (x.astype(float) for x in sim.bodies())
    scale = np.ones((WORLDS, stiff.nbody))
    scale[:, stiff.body("head")] = mass / stiff.body_mass[stiff.body("head")]
    bodies = Bodies(stiff, body_q, body_qd[..., :3], body_qd[..., 3:], scale)
    close(named(felt_by, felt_by.read()), expected(bodies))


def test_a_heavier_head_raises_the_centre_of_mass(stiff):
    """By what a lever says, and in that world only."""
    sim = Simulation(stiff, 3)
    felt_by = Probe(sim, {"com": terms.com(), "momentum": terms.momentum(), "head": terms.from_com("head")})
    com = felt_by.columns["com"]
    before = felt_by.read()
    head = stiff.body("head")
    heavy, light = 30.0, stiff.body_mass[head]
    sim.set_mass("head", heavy, [1])
    after = felt_by.read()
    np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
    place = centres(stiff, sim.body_q.astype(float))[1, head]
    total = stiff.body_mass.sum()
    lever = (total * before[1, com] + (heavy - light) * place) / (total + heavy - light)
    np.testing.assert_allclose(after[1, com], lever, atol=2e-6)  # float32 of about a metre
    down = before[1, com] - after[1, com]
    np.testing.assert_allclose(after[1, felt_by.columns["head"]], before[1, 6:] + down, atol=2e-6)


@pytest.fixture(scope="module")
def felt_before(stiff):
    """What is felt of poses about the origin, and where they are."""
    random = np.random.default_rng(4)
    q = poses(stiff, random, WORLDS)
    q[:, :2] = 0.0
    qd = random.standard_normal((WORLDS, stiff.nv)).astype(np.float32)
    sim, felt_by = probe(stiff, *goals(stiff, random))
    rows = random.integers(ROWS, size=WORLDS)
    sim.reset(joint_q=q, joint_qd=qd)
    return sim, felt_by, rows, q, qd, named(felt_by, felt_by.read(rows))


ROUND = settings(max_examples=20, deadline=None, derandomize=True)
far = st.floats(-10.0, 10.0, width=32)


@ROUND
@given(turn=st.floats(-np.pi, np.pi), x=far, y=far, up=st.sampled_from([0.0, 0.5]), seed=st.integers(0, 99))
def test_neither_place_nor_heading_counts(felt_before, turn, x, y, up, seed):
    """But for which way it faces. Moved by up to 10 m, where float32 has steps of 1e-6 m, and turned, all
    worlds alike or each by itself: the same is felt. Lifted, it is not."""
    sim, felt_by, rows, q, qd, before = felt_before
    random = np.random.default_rng(seed)
    turns = turn + random.uniform(-np.pi, np.pi, WORLDS) * (seed > 0)
    shift = np.stack([np.full(WORLDS, v) for v in (x, y, up)], axis=1)
    shift[:, :2] = np.clip(shift[:, :2] + random.uniform(-5, 5, (WORLDS, 2)) * (seed > 0), -10, 10)
    sim.reset(**dict(zip(("joint_q", "joint_qd"), moved(sim.model, q, qd, turns, shift))))
    high = {"height", "com", *FELT, "palm", "here", "tip"}
    lifted = {
        name: v + up * (np.arange(v.shape[1]) == v.shape[1] - 1) * (name in high)
        for name, v in before.items()
        if name != "facing"
    }
    felt = named(felt_by, felt_by.read(rows))
    del felt["facing"]
    close(felt, lifted)


def test_lanes_agree(stiff):
    """A multiplication that is contracted with an addition in one and not the other differs by 6e-8 of it."""
    random = np.random.default_rng(5)
    q, qd = poses(stiff, random, WORLDS), random.standard_normal((WORLDS, stiff.nv))
    goal_q, goal_qd = goals(stiff, random)
    rows, felt = random.integers(ROWS, size=WORLDS), []
    for lanes in (1, 16):
        sim, felt_by = probe(stiff, goal_q, goal_qd, lanes=lanes)
        sim.reset(joint_q=q, joint_qd=qd)
        felt.append(named(felt_by, felt_by.read(rows)))
    close(*felt)


@pytest.mark.parametrize("lanes", [1, 16])
def test_status_bits(player, lanes):
    """One and several at once, as `Simulation.status` has them."""
    sim = Simulation(player, WORLDS, lanes=lanes)
    felt_by = Probe(sim, {"status": terms.status(), "height": terms.height()})
    q, qd = np.tile(player.start_q, (WORLDS, 1)), np.zeros((WORLDS, player.nv))
    root, ball = player.q_slice("root").start, player.q_slice("ball").start
    q[1, ball : ball + 3] = 0.0, 0.0, 2.2
    q[2, root : root + 7] = [0, 0, 0.3, 0, np.sqrt(0.5), 0, np.sqrt(0.5)]
    q[2:4, ball] = -2.0
    qd[3, player.dof_slice("l_elbow")] = 1e4
    q[4, root : root + 7], qd[4, player.dof_slice("l_elbow")] = q[2, root : root + 7], 1e4
    q[4, ball] = -2.0
    sim.reset(joint_q=q, joint_qd=qd)
    sim.step(50)
    sim._write("q", np.array([11, 4]), np.array([np.nan]), column=player.q_slice("r_elbow").start)
    sim.step(1)
    status = sim.status
    kinds = set(status.tolist())
    assert {0, BAD_CONTACT, FALL, NONFINITE} <= kinds and max(kinds) > OVERSPEED
    felt = felt_by.read()
    np.testing.assert_array_equal(felt[:, 0], status)
    well = status & NONFINITE == 0
    np.testing.assert_array_equal(felt[well, 1], sim.joint_q[well, 2])
    sim.reset()
    assert not felt_by.read()[:, 0].any()


def test_a_row_for_all_and_rows_of_the_wrong_number(stiff):
    random = np.random.default_rng(6)
    sim, felt_by = probe(stiff, *goals(stiff, random))
    sim.reset(joint_q=poses(stiff, random, WORLDS))
    np.testing.assert_array_equal(felt_by.read(3), felt_by.read(np.full(WORLDS, 3)))
    angle = felt_by.columns["miss"].start
    assert not np.array_equal(felt_by.read(3)[:, angle], felt_by.read(4)[:, angle])
    with pytest.raises(ValueError):
        felt_by.read(np.zeros(WORLDS + 1, int))
    for rows in (-1, ROWS, np.arange(WORLDS)):
        with pytest.raises(IndexError, match=r"rows must lie in 0 .. 6"):
            felt_by.read(rows)


def test_what_was_read_stays(stiff):
    """A later reading, or a step, does not write to it; the port of `measure` is live."""
    sim, felt_by = probe(stiff, *goals(stiff, np.random.default_rng(7)), worlds=3)
    first = felt_by.read()
    kept, live = first.copy(), felt_by.measure()
    sim.step(5)
    again = felt_by.read()
    np.testing.assert_array_equal(first, kept)
    assert not np.array_equal(again, first)
    np.testing.assert_array_equal(live.numpy(), again)


def test_unknown_names(stiff, player):
    sim = Simulation(stiff)
    nothing = np.zeros((1, stiff.nq)), np.zeros((1, stiff.nv))
    for term in (terms.point("tail"), terms.velocity("tail"), terms.between("head", "tail")):
        with pytest.raises(ValueError, match="the model has no body and no site named 'tail'"):
            Probe(sim, {"there": term})
    with pytest.raises(KeyError, match="no body named 'tail'"):
        Probe(sim, {"there": terms.point(Place("tail", (0.0, 0.0, 0.0)))})
    with pytest.raises(KeyError, match="no joint named 'tail'"):
        Probe(sim, {"miss": terms.miss(("tail",))}, nothing)
    with pytest.raises(ValueError, match="joint 'root' is free: it has no goal here"):
        Probe(sim, {"miss": terms.miss(("root",))}, nothing)
    with pytest.raises(ValueError, match="body 'l_foot' has no capsule, so no tip"):
        tip(player, "l_foot")


def test_goals_of_the_wrong_shape(stiff):
    """They are read by row: what is too short would be read beyond its end."""
    sim, of = Simulation(stiff, 2), {"miss": terms.miss(JUDGED)}
    q, qd = np.tile(stiff.start_q, (ROWS, 1)), np.zeros((ROWS, stiff.nv))
    with pytest.raises(ValueError, match="what is judged needs goals"):
        Probe(sim, of)
    with pytest.raises(ValueError, match=rf"goal_qd must have shape \(7, {stiff.nv}\)"):
        Probe(sim, of, (q, qd[:3]))
    with pytest.raises(ValueError, match=rf"goal_q must have shape \(7, {stiff.nq}\)"):
        Probe(sim, of, (q[:, 1:], qd))


def test_a_body_without_a_shape():
    """It has no middle, but places."""
    lone = scenes.scene(
        '<body name="b"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    )
    sim = Simulation(lone, 2)
    with pytest.raises(ValueError, match="body 'b' of the model has no shape"):
        Probe(sim, {"there": terms.point("b")})
    q = np.array([[1.0, 2.0, 3.0, 0, 0, np.sqrt(0.5), np.sqrt(0.5)]] * 2)
    sim.reset(joint_q=q, joint_qd=[1.0, 0, 0, 0, 0, 0])
    felt = Probe(sim, {"x": terms.point(Place("b", (0.5, 0.0, 0.0))), "v": terms.com_velocity()}).read()
    np.testing.assert_allclose(felt, [[0.5, 0, 3, 0, -1, 0]] * 2, atol=1e-6)


def test_a_ball_beside_a_player(player):
    """Its place and velocity; it is no part of the player, but of the model's second tree."""
    random = np.random.default_rng(8)
    q, qd = poses(player, random, WORLDS), random.standard_normal((WORLDS, player.nv)).astype(np.float32)
    q = integrate(player, q, 0.3 * random.standard_normal((WORLDS, player.nv))).astype(np.float32)
    sim = Simulation(player, WORLDS)
    felt_by = Probe(sim, {"v": terms.velocity("ball"), "way": terms.between("r_palm", "ball")})
    sim.reset(joint_q=q, joint_qd=qd)
    bodies = moving(player, q, qd)
    felt = felt_by.read()
    np.testing.assert_allclose(felt[:, :3], bodies.facing(speed(player, q, qd, "ball")), atol=2e-5)
    way = bodies.facing(bodies.at("ball") - bodies.at("r_palm"))
    np.testing.assert_allclose(felt[:, 3:], way, atol=4e-6)
