"""Walks of Guided SAMCON: who survives, who descends from whom, islands that know nothing of each other."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.learning.methods.small import ISLANDS, PARTICLES, SMALL
from warpdribble.learning.methods.samcon import (
    RECORD_EVERY,
    SETTLED,
    Moments,
    descendants,
    explore,
    select,
)
from warpdribble.learning.policies.linear import LinearPolicy
from warpdribble.learning.starts import reference_starts
from warpdribble.learning.tasks.disturbance import Disturbance

CALM = Disturbance()

# ------------------------------------------------------------------------------------------ selection


@st.composite
def costs(draw):
    """(islands, particles) with ties, fallen particles and lost islands."""
    islands, particles = draw(st.integers(1, 5)), draw(st.integers(1, 12))
    one = st.integers(0, 4).map(float) | st.just(np.inf)
    E = np.array(draw(st.lists(one, min_size=islands * particles, max_size=islands * particles)))
    E = E.reshape(islands, particles)
    E[list(draw(st.sets(st.integers(0, islands - 1))))] = np.inf
    return E


def check_selection(E, keep, parent, lost):
    islands, particles = E.shape
    assert parent.shape == (islands, particles)
    np.testing.assert_array_equal(lost, np.isinf(E).all(axis=1))
    assert parent.min() >= 0 and parent.max() < particles
    for own, there in zip(parent[~lost], E[~lost]):
        assert np.isfinite(there[own]).all()  # the fallen have no children
        np.testing.assert_array_equal(own[own], own)  # who is copied stays, so copying in place is right
        stay = np.unique(own)
        count = min(np.isfinite(there).sum(), max(1, round(keep * particles)))
        assert len(stay) == count
        worst = there[stay].max()
        assert (there < worst).sum() < count  # none that is better was passed over
        children = np.bincount(own)[stay]
        assert np.ptp(children) <= 1 and children.sum() == particles


@settings(max_examples=300, deadline=None, derandomize=True)
@given(E=costs(), keep=st.floats(0.01, 1.0))
def test_selection(E, keep):
    check_selection(E, keep, *select(E, keep))


def test_survivors_stay_themselves():
    """Also where nobody has fallen; with keep = 1 nothing moves."""
    E = np.random.default_rng(1).random((3, 8))
    parent, lost = select(E, 0.5)
    best = np.argsort(E, axis=1)[:, :4]
    np.testing.assert_array_equal(np.take_along_axis(parent, best, axis=1), best)
    assert not lost.any()
    for own, stay in zip(parent, best):
        assert set(own) == set(stay)
    np.testing.assert_array_equal(select(E, 1.0)[0], np.tile(np.arange(8), (3, 1)))


def test_more_copies_are_made_of_the_better():
    """Five that stay have eight children: the best three two each."""
    E = np.array([[3.0, 0.0, 7.0, 1.0, 6.0, 2.0, 5.0, 4.0]])
    (parent,), _ = select(E, 0.6)
    np.testing.assert_array_equal(np.bincount(parent, minlength=8), [1, 2, 0, 2, 0, 2, 0, 1])


# ------------------------------------------------------------------------------------------- genealogy


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    rows=st.integers(1, 9),
    particles=st.integers(1, 7),
    lag=st.integers(0, 10),
    lost=st.sets(st.integers(0, 8), max_size=2),
)
def test_descendants(seed, rows, particles, lag, lost):
    """Against a family tree: after each row, every particle is somebody's copy, and remembers whose it was
    at every row before; who begins anew has no ancestors."""
    random = np.random.default_rng(seed)
    parent = random.integers(particles, size=(rows, particles))
    parent[[row for row in lost if row < rows]] = -1
    memory = [[] for _ in range(particles)]
    expected = np.zeros((rows, particles), int)
    for now in range(rows):
        if parent[now, 0] < 0:
            memory = [[None] * (now + 1) for _ in range(particles)]
        else:
            memory = [[*memory[mother], mother] for mother in parent[now]]
        for row in range(rows):
            if now == min(row + lag, rows - 1):
                for line in memory:
                    if line[row] is not None:
                        expected[row, line[row]] += 1
    np.testing.assert_array_equal(descendants(parent, lag), expected)


# ------------------------------------------------------------------------------------------------ walks


class Watched:
    """A task that notes what is asked of it, and in which all particles of some islands fall when told."""

    def __init__(self, task, falls=lambda call: (), particles=PARTICLES):
        self.task, self.falls, self.particles = task, falls, particles
        self.S, self.A, self.k, self.E, self.lost = [], [], [], [], []
        self.parents, self.after, self.restarts = [], [], []

    def __getattr__(self, name):
        return getattr(self.task, name)

    def observe(self, k):
        self.S.append(self.task.observe(k))
        return self.S[-1]

    def advance(self, k, action):
        self.A.append(action.copy())
        self.k.append(k.copy())
        self.task.advance(k, action)

    def judge(self, k):
        E, failed = self.task.judge(k)
        E = E.reshape(-1, self.particles)
        E[list(self.falls(len(self.E)))] = np.inf
        self.E.append(E.ravel())
        self.lost.append(np.isinf(E).all(axis=1))
        return E.ravel(), failed | np.isinf(E.ravel())

    def become(self, sources):
        self.parents.append(sources.reshape(-1, self.particles) % self.particles)
        home = sources.reshape(-1, self.particles) // self.particles
        assert (home == np.arange(len(home))[:, None]).all()  # nobody leaves an island
        self.task.become(sources)
        self.after.append((self.task.sim.joint_q, self.task.sim.joint_qd))

    def reset(self, starts, which=None):
        if which is not None:
            self.restarts.append((len(self.E) - 1, starts, which))
        self.task.reset(starts, which)

    def seen(self, name, island):
        """Rows (rows, particles, ...) of an island."""
        rows = np.array(getattr(self, name))
        return rows.reshape(len(rows), -1, self.particles, *rows.shape[2:])[:, island]


def seeds(count=ISLANDS, seed=1):
    return np.random.SeedSequence(seed).spawn(count)


def run_walk(task, falls=lambda call: (), who=None, particles=PARTICLES, **changes):
    """(watched, islands); who: their seeds."""
    calm = {"walk": 60, "disturbance": CALM, "speed_noise": 0.02}
    config = replace(SMALL, particles=particles, **(calm | changes))
    who = seeds() if who is None else who
    watched = Watched(task(len(who) * particles), falls, particles)
    graph = watched.graph
    policy = LinearPolicy.zero(graph.count, watched.actions, watched.obs, 0.05)
    return watched, explore(watched, policy, config, reference_starts(graph), who), config


def assert_same_island(one, two):
    for a, b in zip(vars(one.moments).values(), vars(two.moments).values()):
        np.testing.assert_array_equal(a, b)
    assert (one.cost, one.stood, one.falls) == (two.cost, two.stood, two.falls)
    assert (one.starts is None) == (two.starts is None)
    if one.starts is not None:
        for a, b in zip(vars(one.starts).values(), vars(two.starts).values()):
            np.testing.assert_array_equal(a, b)


def check_island(watched, island, i, config, lost=()):
    """What it says is what was asked of the task: sums over samples with descendants, costs, and states."""
    S, A, k, E = (watched.seen(name, i) for name in ("S", "A", "k", "E"))
    parents = np.array([rows[i] for rows in watched.parents])
    parents[list(lost)] = -1
    W = descendants(parents, config.lag)
    n, count = len(k) * watched.particles, watched.graph.count
    expected = Moments.of(S.reshape(n, -1), A.reshape(n, -1), k.ravel(), W.ravel(), count)
    for one, two in zip(vars(island.moments).values(), vars(expected).values()):
        np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-12)
    stood = np.isfinite(E)
    assert island.cost == pytest.approx(E[stood].sum()) and island.stood == stood.sum()
    assert island.falls == len(lost)
    return W


def typical(config, rows, lost=()):
    """Rows after which a state was recorded that counts."""
    ends = [-1, *lost, rows]
    return [
        row
        for row in range(RECORD_EVERY - 1, rows, RECORD_EVERY)
        if row - max(e for e in ends if e <= row) >= SETTLED
        and row + config.lag < min(e for e in ends if e > row)
    ]


def test_walks_that_nothing_happens_to(task, graph):
    """Each row is what was asked for; a fragment follows the one before it."""
    watched, islands, config = run_walk(task)
    assert len(islands) == ISLANDS and len(watched.S) == 60
    for i, island in enumerate(islands):
        k = watched.seen("k", i)
        assert (np.ptp(k, axis=1) == 0).all()
        np.testing.assert_array_equal(k[1:], (k[:-1] + 1) % graph.count)
        W = check_island(watched, island, i, config)
        assert (W.sum(axis=1) == PARTICLES).all() and island.moments.w.sum() == 60 * PARTICLES
    for row, E in enumerate(watched.E):
        check_selection(E.reshape(ISLANDS, -1), config.keep, watched.parents[row], watched.lost[row])
    assert not watched.restarts


def test_islands_differ(task):
    """In starts, actions and what becomes of them."""
    watched, _, _ = run_walk(task)
    first = np.array(watched.S[0]).reshape(ISLANDS, PARTICLES, -1)
    np.testing.assert_array_equal(first, np.broadcast_to(first[:, :1], first.shape))
    assert len(np.unique(first[:, 0], axis=0)) == ISLANDS
    assert len(np.unique(watched.A[0], axis=0)) == ISLANDS * PARTICLES


def test_recorded_states_are_those_of_the_best_that_come_next(task, graph):
    watched, islands, config = run_walk(task)
    rows = typical(config, 60)
    assert rows[0] == SETTLED - 1 and rows[-1] == 54
    for i, island in enumerate(islands):
        assert len(island.starts) == len(rows)
        for n, row in enumerate(rows):
            E = watched.seen("E", i)[row][watched.parents[row][i]]
            best = i * PARTICLES + np.argmin(E)
            q, qd = watched.after[row][0][best], watched.after[row][1][best]
            np.testing.assert_array_equal(island.starts.joint_q[n, 7:], q[7:])
            np.testing.assert_array_equal(island.starts.joint_qd[n, 3:], qd[3:])
            assert np.linalg.norm(island.starts.joint_qd[n, :3]) == pytest.approx(np.linalg.norm(qd[:3]))
            assert island.starts.k[n] == (watched.seen("k", i)[row, 0] + 1) % graph.count


@pytest.mark.parametrize("call", [0, 3, 22, 59])
def test_an_island_that_loses_all_begins_anew_on_its_own(task, graph, call):
    """From another start of its own; its descendants of before count for nothing; the others go on as if
    nothing had been, to the bit."""
    quiet, islands, config = run_walk(task)
    watched, fallen, _ = run_walk(task, lambda now: (1,) if now == call else ())
    for i in (0, 2, 3):
        assert_same_island(fallen[i], islands[i])
    W = check_island(watched, fallen[1], 1, config, [call])
    assert not W[max(0, call - config.lag) : call + 1].any() and W[call + 1 :].all(axis=None) == (call == 59)
    ((row, start, which),) = watched.restarts
    assert row == call and which.reshape(ISLANDS, -1).tolist() == [[i == 1] * PARTICLES for i in range(4)]
    assert len(start) == PARTICLES and (np.ptp(start.joint_qd, axis=0) == 0).all()
    assert start.k[0] in range(graph.count)
    np.testing.assert_array_equal(start.joint_q[0], graph.start_q[start.k[0]])
    assert (start.joint_qd[0] != graph.start_qd[start.k[0]]).any()
    if call < 59:
        np.testing.assert_array_equal(watched.seen("k", 1)[call + 1], start.k)
        assert np.abs(watched.seen("S", 1)[call + 1]).max() < 5.0
    np.testing.assert_array_equal(watched.seen("A", 1)[: call + 1], quiet.seen("A", 1)[: call + 1])


@pytest.mark.parametrize("call", [22, 24, 28, 29, 30, 35])
def test_states_count_that_are_settled_and_live_on(task, call):
    """`SETTLED` fragments after the walk began, or began anew, and `lag` before it ends or is lost."""
    config = replace(SMALL, walk=60)
    rows = typical(config, 60, [call])
    _, islands, _ = run_walk(task, lambda now: (1,) if now == call else ())
    whole = run_walk(task)[1][1].starts
    starts = islands[1].starts
    before = [row for row in rows if row < call]
    assert len(starts) == len(rows) and len(before) == sum(row + config.lag < call for row in (19, 24, 29))
    np.testing.assert_array_equal(starts.joint_q[: len(before)], whole.joint_q[: len(before)])
    assert all(row >= call + SETTLED for row in rows[len(before) :])


def test_falling_again_and_again(task):
    """Each time from another start."""
    falls = (20, 23, 26)
    watched, islands, config = run_walk(task, lambda now: (1, 2) if now in falls else ())
    for i in (1, 2):
        check_island(watched, islands[i], i, config, falls)
    assert [row for row, *_ in watched.restarts] == list(falls)
    begun = np.array([start.joint_qd[[0, PARTICLES]] for _, start, _ in watched.restarts])
    assert len(np.unique(begun.reshape(6, -1), axis=0)) == 6
    assert {island.falls for island in islands} == {0, 3}


def test_always_falling_nothing_is_learned(task):
    watched, islands, config = run_walk(task, lambda now: range(ISLANDS), walk=30)
    for i, island in enumerate(islands):
        check_island(watched, island, i, config, range(30))
        assert island.starts is None and island.stood == 0 and island.cost == 0.0
        assert not any(part.any() for part in vars(island.moments).values())


@pytest.mark.parametrize("particles", [PARTICLES, 10])
def test_an_island_is_what_it_would_be_alone(task, particles):
    """To the bit, wherever its worlds lie, disturbed and falling."""
    felt = Disturbance(push=400.0, arms=0.3, hands=18.0, push_every=0.5)
    who = seeds(3)
    together = run_walk(task, who=who, particles=particles, walk=30)[1]
    config = replace(SMALL, disturbance=felt, particles=particles, walk=30)

    def explored(some):
        worlds = task(len(some) * particles)
        policy = LinearPolicy.zero(worlds.graph.count, worlds.actions, worlds.obs, 0.2)
        return explore(worlds, policy, config, reference_starts(worlds.graph), some)

    whole, parts = explored(who), explored(who[:1]) + explored(who[1:])
    for one, two in zip(whole, parts):
        assert_same_island(one, two)
    assert whole[0].cost > together[0].cost
