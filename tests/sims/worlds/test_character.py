"""`Character` against float64: what is felt, from places that `sims.pose` gives and their differences in
time; what is aimed at, from SciPy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model, Simulation
from warpdribble.sims.model import gaps, pose
from warpdribble.sims.reference.reference import integrate
from warpdribble.sims.worlds.character import (
    ANGLE,
    ANGULAR_MOMENTUM,
    COM,
    COM_VELOCITY,
    ENDS,
    HEIGHT,
    LEAN,
    RATE,
    SPIN,
    Character,
)

FELT = ("l_foot", "r_foot", "head")
JUDGED = ("lower_back", "neck", "l_hip", "l_knee", "r_ankle", "r_toes", "l_elbow")
STEERED = ("r_knee", "lower_back", "l_hip", "l_elbow")
HINGES = ("r_knee", "l_elbow")
WORLDS, ROWS = 19, 7


@pytest.fixture(scope="module")
def stiff():
    return Model.load("player", rigid=("*_mcp", "*_pip", "*_dip"), without=("ball",))


@pytest.fixture(scope="module", params=["all joints and a ball", "stiff hands"])
def model(request, stiff):
    """Where hands are stiff, one link carries several bodies."""
    return stiff if request.param == "stiff hands" else Model.load("player")


def poses(model, random, count, spread=0.5):
    """(count, nq) about the start pose, in any place, facing anywhere and leaning a little."""
    q = integrate(
        model, np.tile(model.start_q, (count, 1)), spread * random.standard_normal((count, model.nv))
    )
    q[:, :3] = random.uniform([-6, -6, 0.3], [6, 6, 2.0], (count, 3))
    lean = Rotation.from_rotvec(random.uniform(-0.5, 0.5, (count, 3)))
    q[:, 3:7] = (Rotation.from_euler("z", random.uniform(-np.pi, np.pi, (count, 1))) * lean).as_quat()
    return q.astype(np.float32)


def goals(model, random):
    """Tables of goals, their quaternions of either sign."""
    q = poses(model, random, ROWS)
    for k in model.quaternions():
        q[:, k : k + 4] *= random.choice([-1, 1], (ROWS, 1))
    return q, random.standard_normal((ROWS, model.nv)).astype(np.float32)


def character(model, goal_q, goal_qd, worlds=WORLDS, **how):
    sim = Simulation(model, worlds, **how)
    return sim, Character(sim, goal_q, goal_q, goal_qd, FELT, JUDGED, STEERED)


def moving(model, q, qd):
    """Frames of all bodies, the velocities of their centres of mass and their angular velocities, by
    differences in time: in float64 a step of 1e-5 s leaves errors of about 1e-9."""
    h, q = 1e-5, q.astype(float)
    for k in model.quaternions():
        q[:, k : k + 4] /= np.linalg.norm(q[:, k : k + 4], axis=1, keepdims=True)
    now, before, after = (
        pose.forward(model, integrate(model, q, t * h * qd.astype(float))) for t in (0, -1, 1)
    )

    def turns(body_q):
        return Rotation.from_quat(body_q[..., 3:].reshape(-1, 4))

    def centres(body_q):
        count = len(body_q)
        off = turns(body_q).apply(np.tile(model.body_com, (count, 1)))
        return body_q[..., :3] + off.reshape(count, -1, 3)

    velocity = (centres(after) - centres(before)) / (2 * h)
    spin = (turns(after) * turns(before).inv()).as_rotvec() / (2 * h)
    return now, centres(now), velocity, spin.reshape(velocity.shape)


def whole(model, body_q, centres, velocity, spin, scale=None):
    """Columns of `sense` up to SPIN, and those of the ends; scale: (worlds, nbody) of masses and inertias."""
    own = gaps.descendants(model, pose.joint_body(model, model.joint_names[0]))
    root, scale = own[0], np.ones(body_q.shape[:2]) if scale is None else scale
    R = Rotation.from_quat(body_q[..., 3:].reshape(-1, 4)).as_matrix().reshape(*body_q.shape[:2], 3, 3)
    mass = (scale * model.body_mass)[:, own, None]
    centres, velocity, spin = centres[:, own], velocity[:, own], spin[:, own]
    com = (mass * centres).sum(axis=1) / mass.sum(axis=1)
    com_velocity = (mass * velocity).sum(axis=1) / mass.sum(axis=1)
    inertia = scale[:, own, None, None] * (R @ model.body_inertia @ R.swapaxes(-1, -2))[:, own]
    L = np.cross(centres - com[:, None], mass * velocity).sum(axis=1)
    L = L + np.einsum("wbij,wbj->wi", inertia, spin)
    ground = body_q[:, root, :3] * [1, 1, 0]
    back = Rotation.from_euler("z", -np.arctan2(R[:, root, 1, 0], R[:, root, 0, 0])[:, None])
    out = np.full((len(body_q), ENDS + 3 * len(FELT)), np.nan)
    out[:, LEAN] = back.apply(R[:, root, :, 2])[:, :2]
    out[:, HEIGHT] = body_q[:, root, 2:3]
    out[:, COM] = back.apply(com - ground)
    out[:, COM_VELOCITY] = back.apply(com_velocity)
    out[:, ANGULAR_MOMENTUM] = back.apply(L)
    out[:, SPIN] = back.apply(spin[:, 0])
    for k, name in enumerate(FELT):
        body = model.body(name)
        middle = next(s.pos for s in model.shapes if s.body == body)
        out[:, ENDS + 3 * k :][:, :3] = back.apply(body_q[:, body, :3] + R[:, body] @ middle - ground)
    return out


def apart(model, q, qd, goal_q, goal_qd):
    """ANGLE and RATE (worlds, 2) with SciPy's rotations."""
    angle, rate = [], []
    for name in JUDGED:
        place = model.q_slice(name)
        if model.joint_type(name) == "hinge":
            angle.append(np.abs(q[:, place] - goal_q[:, place])[:, 0])
        else:
            now, goal = (Rotation.from_quat(x[:, place]) for x in (q, goal_q))
            angle.append((now * goal.inv()).magnitude())
        dofs = model.dof_slice(name)
        rate.append(np.linalg.norm(qd[:, dofs] - goal_qd[:, dofs], axis=1))
    return np.stack([np.mean(angle, axis=0), np.mean(rate, axis=0)], axis=1)


def close(felt, expected):
    """float32 carries places of some metres to about 1e-6; momenta are sums of 70 kg at some m/s."""
    tolerance = np.full(felt.shape[1], 4e-6)
    tolerance[COM_VELOCITY] = tolerance[SPIN] = tolerance[RATE] = 2e-5
    tolerance[ANGULAR_MOMENTUM] = 1e-3
    for k in range(felt.shape[1]):
        np.testing.assert_allclose(
            felt[:, k], expected[:, k], atol=tolerance[k], rtol=4e-6, err_msg=f"column {k}"
        )


def test_every_column(model):
    """Each world has a goal of its own, and their number fills no vector unit."""
    random = np.random.default_rng(1)
    q, qd = poses(model, random, WORLDS), random.standard_normal((WORLDS, model.nv)).astype(np.float32)
    goal_q, goal_qd = goals(model, random)
    sim, who = character(model, goal_q, goal_qd)
    assert sim.lanes == 1 or WORLDS % sim.lanes
    sim.reset(joint_q=q, joint_qd=qd)
    rows = random.integers(ROWS, size=WORLDS)
    felt = who.sense(rows)
    expected = whole(model, *moving(model, q, qd))
    expected[:, [ANGLE, RATE]] = apart(model, q, qd, goal_q[rows], goal_qd[rows])
    assert (
        np.isfinite(expected).all() and np.ptp(expected, axis=0).min() > 0.05
    )  # every column says something
    close(felt, expected)
    np.testing.assert_array_equal(sim.joint_q, q / _lengths(model, q))  # it only looks
    np.testing.assert_array_equal(sim.joint_qd, qd)


def _lengths(model, q):
    out = np.ones_like(q)
    for k in model.quaternions():
        out[:, k : k + 4] = np.linalg.norm(q[:, k : k + 4], axis=1, keepdims=True)
    return out


def test_momentum_of_a_moving_player_from_the_simulation_s_own_bodies(stiff):
    """After steps with contacts, from `body_q` and `body_qd`; masses differ between the worlds."""
    random = np.random.default_rng(2)
    q = np.tile(stiff.start_q, (WORLDS, 1))
    q[:, 2] += random.uniform(0.0, 0.05, WORLDS)
    goal_q, goal_qd = goals(stiff, random)
    sim, who = character(stiff, goal_q, goal_qd)
    mass = random.uniform(2.0, 20.0, WORLDS)
    sim.set_mass("head", mass)
    sim.reset(joint_q=q, joint_qd=random.standard_normal((WORLDS, stiff.nv)))
    sim.step(10)
    body_q, body_qd = (x.astype(float) for x in sim.bodies())
    scale = np.ones((WORLDS, stiff.nbody))
    scale[:, stiff.body("head")] = mass / stiff.body_mass[stiff.body("head")]
    turns = Rotation.from_quat(body_q[..., 3:].reshape(-1, 4))
    centres = body_q[..., :3] + turns.apply(np.tile(stiff.body_com, (WORLDS, 1))).reshape(WORLDS, -1, 3)
    expected = whole(stiff, body_q, centres, body_qd[..., :3], body_qd[..., 3:], scale)
    felt = who.sense(0)
    expected[:, [ANGLE, RATE]] = felt[:, [ANGLE, RATE]]
    close(felt, expected)


def test_a_heavier_head_raises_the_centre_of_mass(stiff):
    """By what a lever says, and in that world only."""
    random = np.random.default_rng(3)
    sim, who = character(stiff, *goals(stiff, random), worlds=3)
    before = who.sense(0)
    head = stiff.body("head")
    heavy, light = 30.0, stiff.body_mass[head]
    sim.set_mass("head", heavy, [1])
    after = who.sense(0)
    np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
    body_q = sim.body_q[1, head].astype(float)
    place = body_q[:3] + Rotation.from_quat(body_q[3:]).apply(stiff.body_com[head])
    total = stiff.body_mass.sum()
    expected = (total * before[1, COM] + (heavy - light) * place) / (total + heavy - light)
    np.testing.assert_allclose(after[1, COM], expected, atol=2e-6)  # float32 of about a metre


def test_neither_place_nor_heading_counts(stiff):
    """Moved by up to 10 m, where float32 has steps of 1e-6 m, and turned: the same is felt. Lifted, it is
    not."""
    random = np.random.default_rng(4)
    q = poses(stiff, random, WORLDS)
    q[:, :2] = 0.0
    qd = random.standard_normal((WORLDS, stiff.nv)).astype(np.float32)
    sim, who = character(stiff, *goals(stiff, random))
    sim.reset(joint_q=q, joint_qd=qd)
    rows = random.integers(ROWS, size=WORLDS)
    felt = who.sense(rows)
    turn = Rotation.from_euler("z", random.uniform(-np.pi, np.pi, (WORLDS, 1)))
    moved, moved_qd = q.copy(), qd.copy()
    moved[:, :3] = turn.apply(q[:, :3])
    moved[:, :2] += random.uniform(-10, 10, (WORLDS, 2))
    moved[:, 3:7] = (turn * Rotation.from_quat(q[:, 3:7])).as_quat()
    moved_qd[:, :3] = turn.apply(qd[:, :3])
    sim.reset(joint_q=moved, joint_qd=moved_qd)
    close(who.sense(rows), felt)
    moved[:, 2] += 0.5
    sim.reset(joint_q=moved, joint_qd=moved_qd)
    lifted = felt.copy()
    lifted[:, [2, 5, ENDS + 2, ENDS + 5, ENDS + 8]] += 0.5
    close(who.sense(rows), lifted)


def test_lanes_agree(stiff):
    """A multiplication that is contracted with an addition in one and not the other differs by 6e-8 of it."""
    random = np.random.default_rng(5)
    q, qd = poses(stiff, random, WORLDS), random.standard_normal((WORLDS, stiff.nv))
    goal_q, goal_qd = goals(stiff, random)
    rows, felt = random.integers(ROWS, size=WORLDS), []
    for lanes in (1, 16):
        sim, who = character(stiff, goal_q, goal_qd, lanes=lanes)
        sim.reset(joint_q=q, joint_qd=qd)
        felt.append(who.sense(rows))
    close(felt[0], felt[1])


def test_a_row_for_all_and_rows_of_the_wrong_number(stiff):
    random = np.random.default_rng(6)
    sim, who = character(stiff, *goals(stiff, random))
    sim.reset(joint_q=poses(stiff, random, WORLDS))
    np.testing.assert_array_equal(who.sense(3), who.sense(np.full(WORLDS, 3)))
    assert not np.array_equal(who.sense(3)[:, ANGLE], who.sense(4)[:, ANGLE])
    with pytest.raises(ValueError):
        who.sense(np.zeros(WORLDS + 1, int))


@pytest.mark.parametrize(
    ("ends", "judged", "steered"),
    [(("tail",), JUDGED, STEERED), (FELT, ("tail",), STEERED), (FELT, JUDGED, ("tail",))],
)
def test_unknown_names(stiff, ends, judged, steered):
    q, qd = np.zeros((1, stiff.nq)), np.zeros((1, stiff.nv))
    with pytest.raises(KeyError, match=r"no (body|joint) named 'tail'"):
        Character(Simulation(stiff), q, q, qd, ends, judged, steered)


# ------------------------------------------------------------------------------------------- steering


def table(model, random, rows=ROWS):
    """Targets about the start pose, in float32 and of such quaternions that normalising changes no bit."""
    bend = 0.1 * random.standard_normal((rows, model.nv))
    q = integrate(model, np.tile(model.start_q, (rows, 1)), bend).astype(np.float32)
    for _ in range(20):
        q = q / _lengths(model, q)
    same = q / _lengths(model, q) == q
    for k in model.quaternions():  # the few that go to and fro between two neighbours
        q[~same[:, k : k + 4].all(axis=1), k : k + 4] = [0, 0, 0, 1]
    return q


def offsets(model, targets, steered, offset):
    """Targets (n, nq) with the steered joints' moved by (n, columns), by SciPy."""
    out, column = targets.copy(), 0
    for name in steered:
        place, width = model.q_slice(name), len(range(*model.dof_slice(name).indices(model.nv)))
        by = offset[:, column : column + width]
        if width == 1:
            out[:, place] += by
        else:
            out[:, place] = (Rotation.from_quat(out[:, place]) * Rotation.from_rotvec(by)).as_quat()
        column += width
    assert column == offset.shape[1]
    return out


def steered_and_by_hand(model, random, steered, offset, lanes=None, after=0):
    """joint_q, joint_qd and targets after `ROWS - 3` steps along a table: by `Character.step`, and by
    `set_targets` and `step` row by row."""
    targets = table(model, random)
    start = np.tile(model.start_q, (WORLDS, 1))
    start[:, 2] += random.uniform(0.0, 0.01, WORLDS)
    rows, count = random.integers(3, size=WORLDS), ROWS - 3
    one, two = (Simulation(model, WORLDS, lanes=lanes) for _ in range(2))
    who = Character(one, targets, targets, np.zeros((ROWS, model.nv)), FELT, JUDGED, steered)
    for sim in (one, two):
        sim.reset(joint_q=start)
    who.step(count, rows, offset)
    for k in range(count):
        two.set_targets(offsets(model, targets[rows + k], steered, offset))
        two.step()
    for sim in (one, two):
        sim.step(after)
    assert (np.abs(one.joint_q - start).max(axis=1) > 1e-3).all()
    return ((sim.joint_q, sim.joint_qd, sim._read(sim._world.target)) for sim in (one, two))


@pytest.mark.parametrize("after", [0, 4], ids=["", "then four steps more"])
def test_hinges_are_steered_bit_for_bit(stiff, after):
    """An addition in float32 is the same everywhere. The last targets stay, offsets and all."""
    random = np.random.default_rng(7)
    offset = (0.2 * random.standard_normal((WORLDS, len(HINGES)))).astype(np.float32)
    for one, two in zip(*steered_and_by_hand(stiff, random, HINGES, offset, after=after)):
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("lanes", [1, 16])
def test_balls_are_steered_by_rotation_vectors_in_the_turned_axes(stiff, lanes):
    """Products of quaternions differ from SciPy's by a rounding of 1e-7, which a kp of 500 over 1 kg m^2 and
    some steps make 1e-6 of angles and 1e-4 of rates."""
    random = np.random.default_rng(8)
    offset = (0.4 * random.standard_normal((WORLDS, 8))).astype(np.float32)
    offset[0] = 0.0
    offset[1, 1:4] = 1e-6  # next to none
    one, two = steered_and_by_hand(stiff, random, STEERED, offset, lanes, after=1)
    for k in stiff.quaternions():  # a target says the same with either sign
        same = np.sign(np.sum(one[2][:, k : k + 4] * two[2][:, k : k + 4], axis=1, keepdims=True))
        two[2][:, k : k + 4] *= same
    np.testing.assert_allclose(one[2], two[2], atol=5e-7)
    np.testing.assert_allclose(one[0], two[0], atol=5e-6)
    np.testing.assert_allclose(one[1], two[1], atol=5e-4)


def test_nothing_but_steered_joints_is_moved(stiff):
    random = np.random.default_rng(9)
    targets = table(stiff, random)
    sim = Simulation(stiff, WORLDS)
    who = Character(sim, targets, targets, np.zeros((ROWS, stiff.nv)), FELT, JUDGED, STEERED)
    assert who.columns == 8
    rows = random.integers(ROWS, size=WORLDS)
    who.step(1, rows, random.standard_normal((WORLDS, 8)))
    moved = sim._read(sim._world.target) != targets[rows]
    places = np.concatenate([np.r_[stiff.q_slice(name)] for name in STEERED])
    assert moved[:, places].any(axis=0).all()
    assert not np.delete(moved, places, axis=1).any()


def test_an_offset_of_the_wrong_shape(stiff):
    q, qd = np.tile(stiff.start_q, (ROWS, 1)), np.zeros((ROWS, stiff.nv))
    who = Character(Simulation(stiff, WORLDS), q, q, qd, FELT, JUDGED, STEERED)
    for shape in ((WORLDS, 7), (WORLDS, 9), (WORLDS + 1, 8)):
        with pytest.raises(ValueError):
            who.step(1, 0, np.zeros(shape))
