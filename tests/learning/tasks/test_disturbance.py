"""Disturbances: their sizes, how long they last and how often they come, on a task that only takes notes; and
that they end, on a real one."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from warpdribble.learning.tasks.disturbance import HANDS, PUSHED, Disturbance, Disturber

WORLDS, ACTIONS, ARMS, PERIOD = 12, 4, 5, 0.05


class Notes:
    """A task whose forces and offsets are kept, a row per fragment."""

    def __init__(self, worlds=WORLDS, period=PERIOD):
        self.graph = SimpleNamespace(period=period)
        self.sim = SimpleNamespace(world_count=worlds, apply_force=self._apply)
        self.action_size, self.arm_columns = ACTIONS, ARMS
        self.offset = np.zeros((worlds, ACTIONS + ARMS), np.float32)
        self.force = {name: np.zeros((worlds, 3)) for name in (PUSHED, *HANDS)}
        self.calmed = 0

    def _apply(self, body, force):
        assert np.shape(force) == (self.sim.world_count, 3)
        self.force[body] = np.array(force)

    def calm(self):
        self.calmed += 1


def run(what, rows=2000, group=1, seed=1, **how):
    """Forces {body: (rows, worlds, 3)} and arm offsets (rows, worlds, ARMS)."""
    task = Notes(**how)
    disturber = Disturber(what, task, np.random.default_rng(seed), group)
    assert task.calmed == 1  # nothing is left of what was before
    forces, arms = {name: [] for name in task.force}, []
    for _ in range(rows):
        disturber.apply()
        for name, force in task.force.items():
            forces[name].append(force)
        arms.append(task.offset[:, ACTIONS:].copy())
        assert not task.offset[:, :ACTIONS].any()  # that is the policy's
    return {name: np.array(rows) for name, rows in forces.items()}, np.array(arms)


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
    assert not force[..., 2].any() and size.max() <= 80.0
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
        assert size.max() <= 18.0 * (1 + 1e-12) and size.max() > 17.5
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
    forces, arms = run(Disturbance(push=50.0, push_every=0.2, arms=0.2, hands=10.0), rows=100, group=group)
    for rows in (*forces.values(), arms):
        groups = rows.reshape(100, WORLDS // group, group, -1)
        np.testing.assert_array_equal(groups, np.broadcast_to(groups[:, :, :1], groups.shape))
        assert (
            len(np.unique(groups[:, :, 0].transpose(1, 0, 2).reshape(WORLDS // group, -1), axis=0))
            == WORLDS // group
        )


def test_the_seed_decides():
    what = Disturbance(push=50.0, push_every=0.2, arms=0.2, hands=10.0)
    (one, arms), (two, same), (three, other) = (run(what, 50, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(arms, same)
    assert all(
        np.array_equal(one[name], two[name]) and not np.array_equal(one[name], three[name]) for name in one
    )
    assert not np.array_equal(arms, other)


# ------------------------------------------------------------------------------------------- a real task


def go(worlds, graph, fragments=6):
    k = np.zeros(worlds.sim.world_count, int)
    worlds.reset(k, graph.start_q[k], graph.start_qd[k])
    for _ in range(fragments):
        worlds.advance(k, np.zeros((len(k), worlds.action_size)))
        k = (k + 1) % graph.count
    return worlds.sim.joint_q


def test_calm_ends_everything(task, graph):
    """Afterwards the same happens, bit for bit, as where there was no disturbance; during it, something
    else. A new `Disturber` begins calm."""
    quiet, worlds = go(task(5), graph), task(5)
    what = Disturbance(push=300.0, push_every=0.05, arms=0.3, hands=20.0)
    disturber = Disturber(what, worlds, np.random.default_rng(1))
    disturber.apply()
    assert all(
        worlds.sim._read(worlds.sim._world.force)[:, worlds.model.body(b)].any() for b in (PUSHED, *HANDS)
    )
    assert (np.abs(go(worlds, graph) - quiet).max(axis=1) > 1e-3).all()
    for end in (worlds.calm, lambda: Disturber(Disturbance(), worlds, np.random.default_rng(1))):
        disturber.apply()
        end()
        assert (
            not worlds.sim._read(worlds.sim._world.force).any()
            and not worlds.offset[:, worlds.action_size :].any()
        )
        np.testing.assert_array_equal(go(worlds, graph), quiet)


def test_arm_offsets_reach_arms_and_no_other_joint(task, graph, player):
    worlds = task(5)
    Disturber(Disturbance(arms=0.3), worlds, np.random.default_rng(1)).apply()
    k = np.zeros(5, int)
    worlds.reset(k, graph.start_q[k], graph.start_qd[k])
    worlds.advance(k, np.zeros((5, worlds.action_size)))
    target = worlds.sim._read(worlds.sim._world.target)
    moved = np.flatnonzero((np.abs(target - graph.targets[4]) > 1e-6).all(axis=0))
    names = {name for name in player.joint_names if set(np.r_[player.q_slice(name)]) & set(moved)}
    assert names == {f"{side}_{joint}" for side in "lr" for joint in ("shoulder", "elbow", "wrist")}
    assert not worlds.sim.forced
