"""Trials of policies: what became of each trial against an account kept by hand, poses over the ground as
complex numbers."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.learning.evaluate.trials import record_starts, run_trials
from warpdribble.learning.graph import STEPS, cyclic_graph
from warpdribble.learning.policies.linear import LinearPolicy
from warpdribble.learning.starts import Starts, Streams, reference_starts
from warpdribble.learning.tasks.disturbance import Disturbance
from warpdribble.learning.tasks.follow import OpenLoop
from warpdribble.learning.tasks.locomotion import FALLEN
from warpdribble.sims import Simulation
from warpdribble.sims.model import pose
from warpdribble.sims.planar import planar
from warpdribble.sims.worlds.simulation import FALL


def complex_of(a):
    """Place and unit direction."""
    return a[:, 0] + 1j * a[:, 1], np.exp(1j * a[:, 2])


# --------------------------------------------------------------------------------------------- trials


def open_loop(task):
    return OpenLoop(task.actions)


def offsets(task):
    """A policy that adds nothing yet."""
    return LinearPolicy.zero(task.graph.count, task.actions, task.obs)


def facing_ends(model, names, joint_q):
    """(n, ends, 3) in the facing frame, float64."""
    body_q = pose.forward(model, joint_q)
    out = []
    for name in names:
        body = model.body(name)
        middle = next(s.pos for s in model.shapes if s.body == body)
        place = body_q[:, body, :3] + Rotation.from_quat(body_q[:, body, 3:]).apply(middle)
        out.append(place - joint_q[:, :3] * [1, 1, 0])
    back = Rotation.from_euler("z", -planar(joint_q)[:, 2:])
    return np.stack([back.apply(place) for place in out], axis=1)


def by_hand(task, states, seed, cycles, speed_noise):
    """Open loop with `set_targets` and `step` alone: survived, lived, the mean angle and end errors of who
    stands, and drift and turn per cycle."""
    model, graph, n = task.model, task.graph, task.worlds
    start = states.draw(Streams([np.random.default_rng(seed)], n), speed_noise)
    sim, k = Simulation(model, n), start.k
    sim.reset(joint_q=start.joint_q, joint_qd=start.joint_qd)
    stands, lived = np.ones(n, bool), np.zeros(n)
    angles, ends, drifts, turns = [], [], [], []
    begun, way = start.joint_q.astype(float), np.zeros(n, complex)
    bearing, fragments = np.zeros(n), cycles * graph.count
    ends_of = facing_ends(model, task.ends, graph.goal_q)
    for row in range(fragments):
        for j in range(STEPS):
            sim.set_targets(graph.targets[k * STEPS + j])
            sim.step()
        q = sim.joint_q.astype(float)
        high = q[:, 2] > graph.goal_q[k, 2] - FALLEN
        stands &= high & ((sim.status & FALL) == 0)
        lived += stands
        off = []
        for name in task.judged:
            place = model.q_slice(name)
            if model.joint_type(name) == "hinge":
                off.append(np.abs(q[:, place] - graph.goal_q[k][:, place])[:, 0])
            else:
                now, goal = (Rotation.from_quat(x[:, place]) for x in (q, graph.goal_q[k]))
                off.append((now * goal.inv()).magnitude())
        angles.extend(np.mean(off, axis=0)[stands])
        miss = np.linalg.norm(facing_ends(model, task.ends, q) - ends_of[k], axis=-1).mean(axis=1)
        ends.extend(miss[stands])
        place, turn = complex_of(planar(graph.start_q[k]))
        after, turned = complex_of(planar(graph.goal_q[k]))
        way += np.exp(1j * bearing) * (after - place) / turn
        bearing += np.angle(turned / turn)
        if (row + 1) % graph.count == 0:
            place, turn = complex_of(planar(begun))
            after, turned = complex_of(planar(q))
            drifts.extend(np.abs((after - place) / turn - way)[stands])
            turns.extend(np.abs(np.angle(turned / turn * np.exp(-1j * bearing)))[stands])
            begun, way, bearing = q, np.zeros(n, complex), np.zeros(n)
        k = (k + 1) % graph.count
    return stands, lived / fragments, [np.mean(x) for x in (angles, ends, drifts, turns)]


def check(trials, expected):
    """Rounding of the targets, 1e-7, through two seconds of contacts."""
    survived, lived, errors = expected
    np.testing.assert_array_equal(trials.survived, survived)
    np.testing.assert_allclose(trials.lived, lived, atol=1e-12)
    found = [trials.angle_error, trials.end_error, trials.drift, trials.turn]
    np.testing.assert_allclose(found, errors, rtol=0.02, atol=1e-4)


def test_a_player_that_stands(task, standing):
    """For ten cycles of 0.25 s in the held pose: all survive, and stay where they are to a few cm, as
    soles give way, and hundredths of a rad."""
    worlds = task(19, graph=standing)
    trials = run_trials(worlds, open_loop(worlds), reference_starts(standing), 10, seed=3)
    assert trials.survived.all() and (trials.lived == 1.0).all()
    assert 0.0 < trials.angle_error < 0.02 and 0.0 < trials.end_error < 0.025
    assert trials.drift < 0.01 and trials.turn < 0.01 and 0.0 < trials.cost < 1.0
    check(trials, by_hand(worlds, reference_starts(standing), 3, 10, 0.0))


def test_some_fall(task, graph):
    """Of the dribble begun with all joints at up to some rad/s: who falls, when, and how the others do."""
    worlds = task(19)
    trials = run_trials(worlds, open_loop(worlds), reference_starts(graph), 2, seed=6, speed_noise=0.5)
    assert 2 < trials.survived.sum() < 17
    np.testing.assert_array_equal(trials.fell, ~trials.survived)  # there is no ball to lose
    assert ((trials.lived == 1.0) == trials.survived).all() and len(np.unique(trials.lived)) > 3
    check(trials, by_hand(worlds, reference_starts(graph), 6, 2, 0.5))


def moved(joint_q, poses):
    """joint_q (n, nq) with their roots moved and turned over the ground to planar poses (n, 3)."""
    joint_q = np.array(joint_q, float)
    turn = Rotation.from_euler("z", (poses - planar(joint_q))[:, 2:])
    joint_q[:, 3:7] = (turn * Rotation.from_quat(joint_q[:, 3:7])).as_quat()
    joint_q[:, :2] = poses[:, :2]
    return joint_q


def carry(worlds, slip=0.0, turn=0.0):
    """Make a task put each player where its fragment leads, from where it is; and `slip` further ahead [m],
    turned by `turn` [rad]."""
    graph = worlds.graph

    def step(count, rows):
        k = rows // STEPS
        place, facing = complex_of(planar(worlds.sim.joint_q.astype(float)))
        start, before = complex_of(planar(graph.start_q[k]))
        goal, after = complex_of(planar(graph.goal_q[k]))
        place = place + facing * ((goal - start) / before + slip)
        facing = np.angle(facing * after / before * np.exp(1j * turn))
        poses = np.stack([place.real, place.imag, facing], axis=1)
        worlds.sim.reset(joint_q=moved(graph.goal_q[k], poses))

    worlds.course.step = step
    return worlds


@pytest.mark.parametrize(("slip", "turn"), [(0.0, 0.0), (0.01, 0.0), (0.0, 0.02), (0.01, -0.02)])
def test_the_way_of_the_reference_is_no_drift(task, player, curve, slip, turn):
    """A player who is carried along a curve, from anywhere in the world: nothing is missed but what it slips
    and turns besides, which float32 adds up to 1e-5."""
    graph = cyclic_graph(player, curve, player.roles.both("feet"))
    worlds, random = carry(task(19, graph=graph), slip, turn), np.random.default_rng(1)
    poses = random.uniform(-3, 3, (graph.count, 3))
    states = Starts(np.arange(graph.count), moved(graph.start_q, poses), graph.start_qd)
    trials = run_trials(worlds, open_loop(worlds), states, 2, seed=1)
    assert trials.survived.all()
    assert trials.angle_error < 2e-4 and trials.end_error < 1e-5
    assert trials.turn == pytest.approx(graph.count * abs(turn), abs=1e-4)
    off = []
    for start in states.draw(Streams([np.random.default_rng(1)], 19)).k:
        right = left = 0j
        facing = bearing = 1.0 + 0j
        for j in (start + np.arange(graph.count)) % graph.count:
            (a, b), (c, d) = (complex_of(planar(x[j : j + 1])) for x in (graph.start_q, graph.goal_q))
            right, facing = right + facing * (c - a) / b, facing * d / b
            left, bearing = left + bearing * ((c - a) / b + slip), bearing * d / b * np.exp(1j * turn)
        off.append(abs(left - right))
    assert trials.drift == pytest.approx(np.mean(off), abs=1e-4)


def test_nobody_stands(task, graph):
    """From a height at which all fall at once: no time lived, no errors."""
    worlds = task(4)
    joint_q = graph.start_q.copy()
    joint_q[:, 2] -= 0.5
    trials = run_trials(worlds, open_loop(worlds), Starts(np.arange(graph.count), joint_q, graph.start_qd), 1)
    assert not trials.survived.any() and not trials.lived.any()
    for value in (trials.cost, trials.angle_error, trials.end_error, trials.drift, trials.turn):
        assert np.isnan(value)


def test_a_world_that_breaks_does_so_alone(task, graph):
    """It counts as fallen; the others end as they would have."""
    worlds, calls = task(4), []
    whole = run_trials(worlds, open_loop(worlds), reference_starts(graph), 2, seed=1)
    step = worlds.course.step

    def breaks(count, rows):
        calls.append(None)
        if len(calls) == 5:
            worlds.sim.port("joint_q").numpy()[2, worlds.model.q_slice("root").start + 3] = np.nan
        step(count, rows)

    worlds.course.step = breaks
    trials = run_trials(worlds, open_loop(worlds), reference_starts(graph), 2, seed=1)
    np.testing.assert_array_equal(trials.survived, [True, True, False, True])
    np.testing.assert_array_equal(trials.lived[[0, 1, 3]], whole.lived[[0, 1, 3]])
    assert trials.lived[2] == 4 / (2 * graph.count) and np.isfinite(trials.drift)


def test_who_fell_once_does_not_stand_again(task, graph):
    worlds, calls = task(4), []
    judge = worlds.judge

    def falls(k):
        calls.append(None)
        E, failed = judge(k)
        failed[1] |= len(calls) == 7
        return np.where(failed, np.inf, E), failed

    worlds.judge = falls
    trials = run_trials(worlds, open_loop(worlds), reference_starts(graph), 2)
    np.testing.assert_array_equal(trials.survived, [True, False, True, True])
    np.testing.assert_allclose(trials.lived, [1.0, 6 / (2 * graph.count), 1.0, 1.0])


def test_progress_and_less_than_a_cycle(task, graph):
    worlds, seen = task(3), []
    trials = run_trials(worlds, open_loop(worlds), reference_starts(graph), 0.5, progress=seen.append)
    assert seen == list(range(1, graph.count // 2 + 1))
    assert np.isnan(trials.drift) and trials.survived.all()


def test_trials_repeat_and_seeds_differ(task, graph):
    """Also after other trials in the same worlds, disturbed ones."""
    worlds = task(16)
    what = Disturbance(push=200.0, arms=0.2, hands=18.0)

    def tried(seed, disturbance=what):
        return run_trials(
            worlds, open_loop(worlds), reference_starts(graph), 3, seed, 0.05, disturbance=disturbance
        )

    calm = tried(1, Disturbance())
    first, other, again = tried(1), tried(2), tried(1)
    assert vars(first)["cost"] == again.cost != other.cost
    np.testing.assert_array_equal(first.lived, again.lived)
    assert (first.drift, first.turn) == (again.drift, again.turn)
    assert first.cost > 1.3 * calm.cost  # of eight seeds the least is 1.8 times
    after = tried(1, Disturbance())
    assert (after.cost, after.drift, after.end_error) == (calm.cost, calm.drift, calm.end_error)


def test_a_policy_s_offsets_are_carried_out(task, graph):
    """One that bends a knee by 0.3 rad shows it in the mean angle, and takes the state it is in."""
    worlds = task(8)
    bent = offsets(worlds)
    bent.a_hat[:, -1] = 0.3
    plain = run_trials(worlds, open_loop(worlds), reference_starts(graph), 1)
    assert run_trials(worlds, bent, reference_starts(graph), 1).angle_error > plain.angle_error + 0.005


# --------------------------------------------------------------------------------------- recorded states


def test_states_that_a_policy_lives_on_from(task, graph):
    """Every seventh fragment of those who stand, from settled to so long before the end; each with the
    fragment that comes next."""
    worlds = task(8)
    states = record_starts(
        worlds, open_loop(worlds), reference_starts(graph), seed=2, every=7, settled=8, ahead=4
    )
    rows = [row for row in range(8, 8 + graph.count) if row % 7 == 0]
    assert len(states) == 8 * len(rows)
    begin = reference_starts(graph).draw(Streams([np.random.default_rng(2)], 8))
    np.testing.assert_array_equal(
        states.k.reshape(len(rows), 8), (begin.k + np.array(rows)[:, None]) % graph.count
    )
    trials = run_trials(worlds, open_loop(worlds), states, 1)
    assert trials.survived.all()
    worlds.reset(states[:8])
    away = np.abs(worlds.observe(states.k[:8]))
    others = np.abs(worlds.observe((states.k[:8] + 7) % graph.count))
    assert away.mean() < others.mean()  # of the reference where it says it is, and half a cycle from there


def test_those_who_fall_leave_no_states(task, graph):
    """Nobody: the given ones; the states of who stands to the end otherwise, all of them."""
    worlds, reference = task(8), reference_starts(graph)
    gone = reference.joint_q - np.eye(1, worlds.model.nq, 2) * 0.5
    lying = Starts(reference.k, gone, reference.joint_qd)
    assert record_starts(worlds, open_loop(worlds), lying, settled=2, ahead=2) is lying
    judge = worlds.judge

    def falls(k):
        E, failed = judge(k)
        failed[[2, 5]] = True
        return E, failed

    worlds.judge = falls
    some = record_starts(worlds, open_loop(worlds), reference, every=7, settled=8, ahead=4)
    assert len(some) == 6 * 2
