"""Pushes: where they come from, whose falls they are blamed for, and which are survived."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.learning.evaluate import pushes
from warpdribble.learning.evaluate.pushes import DIRECTIONS, push_survival, push_table
from warpdribble.learning.evaluate.trials import run_trials
from warpdribble.learning.starts import Starts, reference_starts
from warpdribble.learning.tasks.follow import OpenLoop
from warpdribble.sims.planar import planar


def open_loop(task):
    return OpenLoop(task.actions)


@pytest.fixture
def pushed(task):
    """A function that makes worlds of the dribble which note the forces on the trunk, with where the player
    faced, fragment by fragment."""

    def make(count, **how):
        worlds = task(count, **how)
        worlds.forces, step = [], worlds.course.step

        def noted(steps, rows):
            assert not worlds.course.push[:, 1:].any()  # the hands are left alone
            worlds.forces.append((worlds.course.push[:, 0].copy(), planar(worlds.sim.joint_q)[:, 2]))
            step(steps, rows)

        worlds.course.step = noted
        return worlds

    return make


def test_no_push(task, graph):
    """A force of zero is no push: who stands without stands with it."""
    worlds = task(16)
    share = push_survival(worlds, open_loop(worlds), reference_starts(graph), 0.0)
    assert run_trials(worlds, open_loop(worlds), reference_starts(graph), 9).survived.all()
    np.testing.assert_array_equal(share, np.ones(len(DIRECTIONS)))


def test_an_absurd_push(task, graph):
    worlds = task(16)
    share = push_survival(worlds, open_loop(worlds), reference_starts(graph), 2e4)
    np.testing.assert_array_equal(share, np.zeros(len(DIRECTIONS)))
    assert not worlds.course.push.any()  # ended


def test_harder_pushes_are_survived_less(task, graph):
    worlds = task(64)
    shares = [
        push_survival(worlds, open_loop(worlds), reference_starts(graph), force).mean()
        for force in (50.0, 150.0, 300.0)
    ]
    assert shares[0] >= shares[1] >= shares[2] and shares[0] > shares[2] + 0.2


def test_pushes_come_from_where_they_should(pushed, graph):
    """Each world is pushed once, for the time said, with the force said, at a multiple of 45 degrees
    counterclockwise from where it faces then; wherever it faces in the world."""
    random = np.random.default_rng(4)
    states = reference_starts(graph)
    turn = Rotation.from_euler("z", random.uniform(-3, 3, (len(states), 1)))
    joint_q, joint_qd = states.joint_q.copy(), states.joint_qd.copy()
    joint_q[:, :3], joint_qd[:, :3] = turn.apply(joint_q[:, :3]), turn.apply(joint_qd[:, :3])
    joint_q[:, 3:7] = (turn * Rotation.from_quat(joint_q[:, 3:7])).as_quat()
    worlds = pushed(24)
    push_survival(worlds, open_loop(worlds), Starts(states.k, joint_q, joint_qd), 30.0, seed=5)
    force = np.array([force for force, _ in worlds.forces])
    facing = np.array([facing for _, facing in worlds.forces])
    on = np.linalg.norm(force, axis=-1) > 0
    assert (on.sum(axis=0) == 4).all()  # 0.2 s
    first = np.argmax(on, axis=0)
    assert (first >= round(1.0 / graph.period)).all() and len(set(first)) > 3
    for world, row in enumerate(first):
        assert on[row : row + 4, world].all()
        push = force[row : row + 4, world]
        assert (push == push[0]).all() and push[0, 2] == 0.0
        expected = 30.0 * np.exp(1j * (facing[row, world] + np.radians(45.0) * (world % 8)))
        assert abs(complex(*push[0, :2]) - expected) < 1e-3


@pytest.mark.parametrize(("row", "share"), [(3, 1.0), (40, 0.5)], ids=["before", "after"])
def test_only_falls_after_the_push_count(pushed, standing, row, share):
    """World 0 falls, world 8, pushed in the same direction, does not."""
    worlds, calls = pushed(16, graph=standing), []
    judge = worlds.judge

    def falls(k):
        calls.append(None)
        E, down = judge(k)
        down[0] |= len(calls) == row
        return E, down

    worlds.judge = falls
    shares = push_survival(worlds, open_loop(worlds), reference_starts(standing), 10.0)
    np.testing.assert_array_equal(shares, [share, *np.ones(len(DIRECTIONS) - 1)])
    on = np.array([np.any(force[8]) for force, _ in worlds.forces])
    assert 3 < np.argmax(on) < 40


def test_the_largest_push_is_the_last_before_the_first_that_is_lost(task, graph, monkeypatch):
    shares = {10: [1.0] * 8, 20: [0.95] * 7 + [0.5], 30: [np.nan] + [0.9] * 6 + [1.0], 40: [1.0] * 8}
    shares |= {50: [0.0] * 8, 60: [1.0] * 8}
    monkeypatch.setattr(pushes, "FORCES", tuple(shares))
    monkeypatch.setattr(pushes, "push_survival", lambda *a, **_: np.array(shares[a[3]]))
    worlds, seen = task(8), []
    table = push_table(
        worlds, open_loop(worlds), reference_starts(graph), progress=lambda *row: seen.append(row)
    )
    assert table.forces == [10, 20, 30]  # nobody survives all three; what is survived later does not count
    np.testing.assert_array_equal(table.largest(), [20.0] * 7 + [10.0])
    assert seen == [(1, " of 10 N"), (2, " of 20 N"), (3, " of 30 N")]


def test_a_world_that_breaks_is_not_pushed(pushed, standing):
    """It fell before its push, so nothing is known of it; the others are pushed as ever."""
    worlds = pushed(16, graph=standing)
    step = worlds.course.step

    def breaks(count, rows):
        if len(worlds.forces) == 3:
            worlds.sim.port("joint_q").numpy()[0, 3:7] = np.nan
        step(count, rows)

    worlds.course.step = breaks
    shares = push_survival(worlds, open_loop(worlds), reference_starts(standing), 10.0)
    np.testing.assert_array_equal(shares, np.ones(len(DIRECTIONS)))  # world 8 stands for the direction
    assert not any(np.any(force[0]) for force, _ in worlds.forces)
    assert any(np.any(force[8]) for force, _ in worlds.forces)


def test_a_direction_in_which_nobody_stood_to_be_pushed(pushed, standing):
    """Nothing is known of it."""
    worlds, calls = pushed(16, graph=standing), []
    judge = worlds.judge

    def falls(k):
        calls.append(None)
        E, down = judge(k)
        down[[3, 11]] |= len(calls) == 2
        return E, down

    worlds.judge = falls
    shares = push_survival(worlds, open_loop(worlds), reference_starts(standing), 10.0)
    np.testing.assert_array_equal(shares, [1.0, 1.0, 1.0, np.nan, 1.0, 1.0, 1.0, 1.0])
