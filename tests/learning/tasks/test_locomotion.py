"""Locomotion: what a policy feels, what a fragment costs written out, and who has failed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.learning.starts import Starts, reference_starts
from warpdribble.learning.tasks.locomotion import (
    FALLEN,
    FELT,
    HEADING_UNIT,
    HEIGHT_UNIT,
    STEERED,
    TURN_UNIT,
    UNITS,
    CostWeights,
)
from warpdribble.sims.model import pose
from warpdribble.sims.planar import heading, wrapped


def put(worlds, joint_q, joint_qd=None):
    """Reset to these states, in fragment 0."""
    joint_qd = np.zeros((len(joint_q), worlds.model.nv)) if joint_qd is None else joint_qd
    worlds.reset(Starts(np.zeros(len(joint_q), int), joint_q, joint_qd))


def test_a_policy_feels_nothing_on_the_reference(task, graph):
    """In any fragment; 20 numbers, and what it moves are 17."""
    worlds, starts = task(graph.count), reference_starts(graph)
    assert (worlds.obs, worlds.actions) == (FELT, STEERED) == (20, 17)
    worlds.reset(starts)
    np.testing.assert_allclose(worlds.observe(starts.k), 0.0, atol=1e-3)
    assert np.abs(worlds.observe((starts.k + 5) % graph.count)).max() > 0.1


def test_a_policy_feels_only_the_heading_of_where_the_player_is_and_faces(task, graph):
    """To rounding, in units of deviation."""
    worlds, starts, random = task(graph.count), reference_starts(graph), np.random.default_rng(1)
    q, qd = starts.joint_q.copy(), starts.joint_qd.copy()
    turn = Rotation.from_euler("z", random.uniform(-3, 3, (len(q), 1)))
    q[:, :3] = turn.apply(q[:, :3]) + random.uniform(-5, 5, (len(q), 3)) * [1, 1, 0]
    q[:, 3:7] = (turn * Rotation.from_quat(q[:, 3:7])).as_quat()
    qd[:, :3] = turn.apply(qd[:, :3])
    worlds.reset(Starts(starts.k, q, qd))
    felt = worlds.observe(starts.k)
    np.testing.assert_allclose(felt[:, :-1], 0.0, atol=5e-3)
    off = wrapped(heading(q[:, 3:7]) - heading(starts.joint_q[:, 3:7]))
    np.testing.assert_allclose(felt[:, -1], off / HEADING_UNIT, atol=1e-4)


def test_each_world_keeps_the_heading_of_its_reference(task, graph):
    """Round and round a graph that turns; copies keep it, and states to start from are as far off it."""
    turning, k = graph.goal_q.copy(), np.arange(4)
    turning[:, 3:7] = (Rotation.from_euler("z", 0.7) * Rotation.from_quat(graph.goal_q[:, 3:7])).as_quat()
    turns = wrapped(heading(turning[:, 3:7]) - heading(graph.start_q[:, 3:7]))
    worlds = task(4, graph=replace(graph, goal_q=turning))
    worlds.reset(Starts(k, graph.start_q[k], graph.start_qd[k]))
    faces = heading(graph.start_q[k, 3:7])
    for _ in range(12):
        worlds.advance(k, np.zeros((4, worlds.actions)))
        faces, k = faces + turns[k], graph.follow(k)
        left = wrapped(heading(worlds.sim.joint_q[:, 3:7]) - faces)
        np.testing.assert_allclose(wrapped(worlds.astray - left), 0.0, atol=1e-5)
    kept = worlds.astray
    worlds.become(np.array([1, 1, 3, 0]))
    np.testing.assert_array_equal(worlds.astray, kept[[1, 1, 3, 0]])
    again = worlds.states(graph.follow(k))
    before = worlds.astray
    worlds.reset(again)
    np.testing.assert_allclose(worlds.astray, before, atol=1e-5)


def test_what_a_policy_feels(task, graph, player):
    """Higher by 5 cm, so are the centre of mass and the feet: a unit each; faster by 0.3 m/s, another; a bent
    knee moves its foot, and hardly anything else."""
    worlds, k = task(4), np.zeros(4, int)
    q, qd = (np.tile(x[0], (4, 1)) for x in (graph.start_q, graph.start_qd))
    q[0, 2] += UNITS["height"]
    ahead = Rotation.from_euler("z", heading(q[1, 3:7])).apply([1.0, 0.0, 0.0])
    qd[1, :3] += UNITS["com_velocity"] * ahead
    q[2, player.q_slice("l_knee")] += 0.2
    qd[3, player.dof_slice(player.root)][3:] += Rotation.from_quat(q[3, 3:7]).inv().apply([0, 0, TURN_UNIT])
    worlds.reset(Starts(k, q, qd))
    felt, columns = worlds.observe(k), worlds.columns
    left, right = (columns[foot] for foot in player.roles.both("feet"))
    higher, faster = np.zeros(20), np.zeros(20)
    higher[[columns[name].stop - 1 for name in ("height", "com")]] = 1.0
    higher[[left.stop - 1, right.stop - 1]] = 1.0
    faster[columns["com_velocity"].start] = 1.0
    np.testing.assert_allclose(felt[0], higher, atol=2e-3)
    np.testing.assert_allclose(felt[1], faster, atol=5e-3)
    assert felt[3, -2] == pytest.approx(1.0, abs=1e-4)
    assert np.linalg.norm(felt[2, left]) > 1.0
    assert np.abs(np.delete(felt[2], np.r_[left])).max() < 0.1 and not np.round(felt[2, right], 3).any()


def ends_of(worlds, joint_q):
    """(n, ends, 3) [m] in the world, float64."""
    model, out = worlds.model, []
    body_q = pose.forward(model, joint_q)
    for name in worlds.ends:
        body = model.body(name)
        middle = next(s.pos for s in model.shapes if s.body == body)
        out.append(body_q[:, body, :3] + Rotation.from_quat(body_q[:, body, 3:]).apply(middle))
    return np.stack(out, axis=1)


ZERO = CostWeights(*[0.0] * 6)


def costs(task, joint_q, **weights):
    """Of states at the end of fragment 0, with these weights alone."""
    worlds = task(len(joint_q), weights=replace(ZERO, **weights))
    step = worlds.course.step
    worlds.course.step = lambda count, rows: None
    put(worlds, joint_q)
    k = np.zeros(len(joint_q), int)
    worlds.advance(k, np.zeros((len(k), worlds.actions)))
    worlds.course.step = step
    return worlds, worlds.judge(k)[0]


@pytest.fixture(scope="module")
def bent(graph, player):
    """States about the end of fragment 0, with joints off by up to 0.2 rad."""
    random, q = np.random.default_rng(2), np.tile(graph.goal_q[0], (19, 1))
    for name in player.joint_names[1:]:
        place = player.q_slice(name)
        off = random.uniform(-0.2, 0.2, (len(q), 3))
        if player.joint_type(name) == "hinge":
            q[:, place] += off[:, :1]
        else:
            q[:, place] = (Rotation.from_quat(q[:, place]) * Rotation.from_rotvec(off)).as_quat()
    return q


def test_the_cost_of_the_pose(task, graph, bent):
    """The mean over the joints of legs and trunk of the angle, and a tenth of the rate."""
    worlds, cost = costs(task, bent, pose=2.0)
    model, angle, rate = worlds.model, [], []
    for name in worlds.judged:
        place, dofs = model.q_slice(name), model.dof_slice(name)
        if model.joint_type(name) == "hinge":
            angle.append(np.abs(bent[:, place] - graph.goal_q[0][place])[:, 0])
        else:
            now, goal = (Rotation.from_quat(x) for x in (bent[:, place], graph.goal_q[0][place]))
            angle.append((now * goal.inv()).magnitude())
        rate.append(np.full(len(bent), np.linalg.norm(graph.goal_qd[0][dofs])))
    expected = 2.0 * (np.mean(angle, axis=0) + 0.1 * np.mean(rate, axis=0))
    np.testing.assert_allclose(cost, expected, rtol=1e-4)


def test_the_cost_of_the_ends(task, graph, bent):
    """The mean of the heights by which feet and head are off."""
    worlds, cost = costs(task, bent, ends=3.0)
    off = ends_of(worlds, bent)[:, :, 2] - ends_of(worlds, graph.goal_q[:1])[:, :, 2]
    np.testing.assert_allclose(cost, 3.0 * np.abs(off).mean(axis=1), rtol=1e-4, atol=1e-6)


def test_the_cost_of_balance(task, graph, bent):
    """Where the centre of mass is over feet and head, in heights of a player, as it faces."""
    worlds, cost = costs(task, bent, balance=4.0)
    model = worlds.model

    def over(joint_q):
        body_q = pose.forward(model, joint_q)
        turned = Rotation.from_quat(body_q[..., 3:].reshape(-1, 4))
        centres = turned.apply(np.tile(model.body_com, (len(joint_q), 1))).reshape(*body_q.shape[:2], 3)
        com = np.average(body_q[..., :3] + centres, axis=1, weights=model.body_mass)
        forward = Rotation.from_quat(joint_q[:, 3:7]).apply([1.0, 0.0, 0.0])
        back = Rotation.from_euler("z", -np.arctan2(forward[:, 1], forward[:, 0])[:, None])
        apart = com[:, None] - ends_of(worlds, joint_q)
        return np.stack([back.apply(apart[:, i]) for i in range(apart.shape[1])], axis=1)[..., :2]

    off = np.linalg.norm(over(bent) - over(graph.goal_q[:1]), axis=-1).mean(axis=1)
    np.testing.assert_allclose(cost, 4.0 * off / HEIGHT_UNIT, rtol=2e-3)


def test_costs_add_up(task, bent):
    """Every weight by itself, and all of them."""
    parts = [costs(task, bent, **{name: value})[1] for name, value in vars(CostWeights()).items()]
    _, whole = costs(task, bent, **vars(CostWeights()))
    assert all(part.min() > 0.0 for part in parts)
    np.testing.assert_allclose(np.sum(parts, axis=0), whole, rtol=1e-5)


@pytest.mark.parametrize("off", [-FALLEN - 0.01, FALLEN + 0.01, np.nan])
def test_who_has_failed(task, graph, off):
    """Too low, too high or broken: at an infinite cost, and nobody else."""
    q = np.tile(graph.goal_q[0], (3, 1))
    worlds = task(3)

    def step(count, rows):
        place = worlds.sim.port("joint_q").numpy()
        place[:] = q
        place[1, 2] += off

    worlds.course.step = step
    k = np.zeros(3, int)
    put(worlds, q)
    worlds.advance(k, np.zeros((3, worlds.actions)))
    cost, failed = worlds.judge(k)
    np.testing.assert_array_equal(failed, [False, True, False])
    np.testing.assert_array_equal(np.isinf(cost), failed)


def test_who_lies_has_failed(task, graph):
    """Whatever the height of the root says; by contact with the ground."""
    q = np.tile(graph.start_q[0], (2, 1))
    lying = Rotation.from_euler("y", 85, degrees=True) * Rotation.from_quat(q[1, 3:7])
    q[1, 2:7] = [0.2, *lying.as_quat()]
    worlds, k = task(2), np.zeros(2, int)
    put(worlds, q)
    for _ in range(6):
        worlds.advance(k, np.zeros((2, worlds.actions)))
    np.testing.assert_array_equal(worlds.judge(k)[1], [False, True])
