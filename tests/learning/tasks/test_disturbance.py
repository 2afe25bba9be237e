"""Disturbances: their sizes, how long they last and how often they come, on a task that only takes notes; and
that they end, on a real one."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from warpdribble.learning.choose import Ahead
from warpdribble.learning.rollout import Rollout
from warpdribble.learning.starts import Starts, Streams
from warpdribble.learning.tasks.disturbance import Disturbance, Disturber
from warpdribble.learning.tasks.follow import OpenLoop

WORLDS, ACTIONS, ARMS, PERIOD = 12, 4, 5, 0.05
PUSHED, HANDS = "trunk", ("left hand", "right hand")
BODIES = (PUSHED, *HANDS)
"""In the order in which a course pushes them."""


class Notes:
    """A task whose forces and offsets are kept, a row per fragment."""

    def __init__(self, worlds=WORLDS, period=PERIOD):
        self.graph, self.actions = SimpleNamespace(period=period), ACTIONS
        offset = np.zeros((worlds, ACTIONS + ARMS), np.float32)
        push = np.zeros((worlds, len(BODIES), 3), np.float32)
        self.course = SimpleNamespace(columns=ACTIONS + ARMS, offset=offset, push=push)
        self.others = offset[:, ACTIONS:]


def streams(seed=1, worlds=WORLDS, group=1):
    seeds = np.random.SeedSequence(seed).spawn(worlds // group)
    return Streams([np.random.default_rng(s) for s in seeds], group=group)


def run(what, rows=2000, drawn=None, **how):
    """Forces {body: (rows, worlds, 3)} and arm offsets (rows, worlds, ARMS)."""
    task = Notes(**how)
    disturber = Disturber(what, streams() if drawn is None else drawn)
    forces, arms = [], []
    for _ in range(rows):
        disturber.apply(task)
        forces.append(task.course.push.astype(float))
        arms.append(task.course.offset[:, ACTIONS:].copy())
        assert not task.course.offset[:, :ACTIONS].any()  # that is the policy's
    forces = np.array(forces)
    return {name: forces[:, :, i] for i, name in enumerate(BODIES)}, np.array(arms)


def stretches(force):
    """Lengths of the stretches of one force that is not zero, in all worlds; those cut off at the ends are
    left out."""
    out = []
    for rows in force.transpose(1, 0, 2):
        cuts = np.flatnonzero((np.diff(rows, axis=0) != 0).any(axis=1)) + 1
        out += [b - a for a, b in pairwise(cuts) if rows[a].any()]
    return np.array(out)


def test_none():
    forces, arms = run(Disturbance(), rows=50)
    assert not arms.any() and not any(force.any() for force in forces.values())


@pytest.mark.parametrize(("seconds", "rows"), [(0.2, 4), (0.05, 1), (0.33, 7), (0.01, 1)])
def test_a_push_lasts_its_time(seconds, rows):
    """In whole fragments, at least one; a new one may follow at once, in another direction."""
    forces, _ = run(Disturbance(push=100.0, push_time=seconds, push_every=1.0))
    assert set(stretches(forces[PUSHED])) == {rows}


def test_pushes_are_level_bounded_and_from_everywhere():
    force = run(Disturbance(push=80.0, push_every=0.3))[0][PUSHED]
    size = np.linalg.norm(force, axis=-1)
    assert not force[..., 2].any() and size.max() <= 80.0 * (1 + 1e-6)
    assert size.max() > 78.0 and 0.0 < size[size > 0].min() < 2.0  # of some thousand, evenly drawn
    angle = np.arctan2(force[..., 1], force[..., 0])[size > 0]
    often = np.histogram(angle, 8, (-np.pi, np.pi))[0]
    assert often.min() > 0.7 * often.mean()
    assert np.abs(force[size > 0].mean(axis=0)).max() < 3.0


def test_pushes_come_as_often_as_said():
    """The mean time from the end of one to the beginning of the next: 1 s, of some hundred, to a fifth. Said
    is the time between pushes."""
    force = run(Disturbance(push=80.0, push_time=0.2, push_every=1.0))[0][PUSHED]
    on = (force != 0).any(axis=-1)
    begins = (np.diff(on.astype(int), axis=0) == 1).sum()
    assert (~on).sum() * PERIOD / begins == pytest.approx(1.0, rel=0.2)


def test_hands_are_pulled_to_all_sides_and_each_by_itself():
    forces, _ = run(Disturbance(hands=18.0, hands_time=0.25))
    for name in HANDS:
        size = np.linalg.norm(forces[name], axis=-1)
        assert size.max() <= 18.0 * (1 + 1e-6) and size.max() > 17.5
        assert (np.abs(forces[name].reshape(-1, 3).mean(axis=0)) < 1.0).all()
        assert (forces[name].reshape(-1, 3).std(axis=0) > 3.0).all()
        lengths = stretches(forces[name]) * PERIOD
        assert lengths.mean() == pytest.approx(0.25, rel=0.1)  # of some thousand
    assert not np.array_equal(forces[HANDS[0]], forces[HANDS[1]])
    assert not forces[PUSHED].any()


def test_arms_wave_anew_in_every_fragment():
    arms = run(Disturbance(arms=0.3), rows=400)[1]
    assert arms.std() == pytest.approx(0.3, rel=0.03) and abs(arms.mean()) < 0.01
    assert (np.diff(arms, axis=0) != 0).all()


@pytest.mark.parametrize("group", [1, 3, 12])
def test_a_group_feels_the_same_and_groups_do_not(group):
    what = Disturbance(push=50.0, push_every=0.2, arms=0.2, hands=10.0)
    forces, arms = run(what, 100, streams(group=group))
    for rows in (*forces.values(), arms):
        groups = rows.reshape(100, WORLDS // group, group, -1)
        np.testing.assert_array_equal(groups, np.broadcast_to(groups[:, :, :1], groups.shape))
        assert (
            len(np.unique(groups[:, :, 0].transpose(1, 0, 2).reshape(WORLDS // group, -1), axis=0))
            == WORLDS // group
        )


def test_a_unit_feels_what_it_would_alone():
    """Whoever is beside it: the third of four as the first of two."""
    what = Disturbance(push=50.0, push_every=0.2, arms=0.2, hands=10.0)
    seeds = np.random.SeedSequence(5).spawn(4)

    def felt(some):
        drawn = Streams([np.random.default_rng(s) for s in some], group=3)
        return run(what, 100, drawn, worlds=3 * len(some))

    (forces, arms), (own, waved) = felt(seeds), felt(seeds[2:])
    np.testing.assert_array_equal(arms[:, 6:], waved)
    for name in BODIES:
        np.testing.assert_array_equal(forces[name][:, 6:], own[name])


def test_the_seed_decides():
    what = Disturbance(push=50.0, push_every=0.2, arms=0.2, hands=10.0)
    (one, arms), (two, same), (three, other) = (run(what, 50, streams(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(arms, same)
    assert all(
        np.array_equal(one[name], two[name]) and not np.array_equal(one[name], three[name]) for name in one
    )
    assert not np.array_equal(arms, other)


# ------------------------------------------------------------------------------------------- a real task


def go(worlds, graph, disturber=None, fragments=6):
    k = np.zeros(worlds.worlds, int)
    begin = Starts(k, graph.start_q[k], graph.start_qd[k])
    for _ in Rollout(worlds, OpenLoop(worlds.actions), Ahead(), begin, disturber).fragments(fragments):
        pass
    return worlds.sim.joint_q


def test_calm_ends_everything(task, graph, player):
    """Afterwards the same happens, bit for bit, as where there was no disturbance; during it, something
    else."""
    quiet, worlds = go(task(5), graph), task(5)
    what = Disturbance(push=300.0, push_every=0.05, arms=0.3, hands=20.0, hands_time=0.05)
    assert worlds.course.pushed == (player.roles.one("trunk"), *player.roles.both("hands"))
    assert (np.abs(go(worlds, graph, Disturber(what, streams(worlds=5))) - quiet).max(axis=1) > 1e-3).all()
    np.testing.assert_array_equal(go(worlds, graph), quiet)
    Disturber(what, streams(worlds=5)).apply(worlds)
    assert worlds.course.push.any(axis=(0, 2)).all() and worlds.course.offset[:, worlds.actions :].all()
    worlds.calm()
    assert not worlds.course.push.any() and not worlds.course.offset.any()


def test_pushes_move_who_is_pushed(task, graph, player):
    """The trunk to where it is pushed, a hand to where it is pulled; nothing else is pushed."""
    for i, body in enumerate((player.roles.one("trunk"), *player.roles.both("hands"))):
        worlds = task(2)

        class Push:
            def apply(self, task, i=i):
                task.course.push[1, i] = [0.0, 60.0 if i == 0 else 15.0, 0.0]

        go(worlds, graph, Push(), fragments=3)
        moved = np.diff(worlds.sim.body_q, axis=0)[0, :, :3]
        assert moved[player.body(body), 1] > 0.01
        assert np.argmax(np.abs(moved[:, 1])) in player.descendants(player.body(body))


def test_arm_offsets_reach_arms_and_no_other_joint(task, graph, player):
    worlds = task(5)
    k = np.zeros(5, int)
    begin = Starts(k, graph.start_q[k], graph.start_qd[k])
    waving = Disturber(Disturbance(arms=0.3), streams(worlds=5))
    rollout = Rollout(worlds, OpenLoop(worlds.actions), Ahead(), begin, waving)
    next(rollout.fragments(1))
    target = worlds.sim.port("joint_target_q").numpy()
    moved = np.flatnonzero((np.abs(target - graph.targets[4]) > 1e-6).all(axis=0))
    names = {name for name in player.joint_names if set(np.r_[player.q_slice(name)]) & set(moved)}
    assert names == {f"{side}_{joint}" for side in "lr" for joint in ("shoulder", "elbow", "wrist")}
    assert not worlds.sim.forced
