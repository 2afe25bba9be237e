"""Worlds are put into states of a pool, whatever simulation these come from, and whatever became of them in
between."""

import pickle

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.sims.worlds.float64 import poses, unit
from tests.sims.worlds.scene import WORLDS, carried, spare, varied
from warpdribble.sims import Simulation, State
from warpdribble.sims.worlds.batch import Batch
from warpdribble.sims.worlds.simulation import FALL, NONFINITE, OVERSPEED
from warpdribble.sims.worlds.state import Layout

COUNT = 21  # worlds that are placed: two groups of 16, the last one not full
ROUND = settings(max_examples=20, deadline=None, derandomize=True)


def side_by_side(model):
    """A state of worlds in the layout that CUDA uses."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Batch, "_side_by_side", property(lambda self: True, lambda self, on: None), False)
        return varied(model, lanes=1).state()


@pytest.fixture(scope="module")
def pools(player):
    """States of the same kind of worlds, in every layout."""
    states = {f"{lanes} lanes": varied(player, lanes).state() for lanes in (1, 4, 16)}
    states["side by side"] = side_by_side(player)
    states["picked"] = states["16 lanes"].select(np.arange(WORLDS)[::-1])
    states["a copy"] = states["4 lanes"].clone()
    states["from a file"] = pickle.loads(pickle.dumps(states["16 lanes"]))
    states["fresh"] = State.of(player, *fresh(player, 5))
    return states


def fresh(model, count):
    random = np.random.default_rng(3)
    return poses(model, random, count), random.standard_normal((count, model.nv)).astype(np.float32)


@pytest.fixture(scope="module", params=[1, 16])
def sim(request, player):
    """Worlds with a past: contacts, a fall, targets."""
    sim = Simulation(player, COUNT, lanes=request.param)
    q = np.tile(player.start_q, (COUNT, 1))
    q[:, 2] += np.linspace(0, 0.01, COUNT)
    q[4, 2] -= 0.6
    sim.reset(joint_q=q)
    sim.step(3)
    assert sim.status.any()
    return sim


def has(pool, name, like):
    """(count, ...) of a quantity; zeros, shaped like an array, of one that the pool lacks."""
    return pool[name] if name in pool.names else np.zeros((len(pool), *like.shape[1:]), np.float32)


def check(sim, pool, rows):
    """Each world has its row's state, and one without a row all that it had, to the bit."""
    before = carried(sim)
    unused, others = spare(sim), [sim._read(getattr(sim._world, name)) for name in ("target", "force")]
    sim.place(pool, rows)
    for name, values in carried(sim).items():
        expected = np.where(
            np.reshape(rows, (-1, *[1] * (values.ndim - 1))) < 0,
            before[name],
            has(pool, name, values)[np.maximum(rows, 0)],
        )
        np.testing.assert_array_equal(values, expected, err_msg=name)
    follow = unused if rows[-1] < 0 else np.broadcast_to(sim.joint_q[-1], unused.shape)
    np.testing.assert_array_equal(spare(sim), follow)
    for part, name in zip(others, ("target", "force")):
        np.testing.assert_array_equal(sim._read(getattr(sim._world, name)), part)


POOLS = ("1 lanes", "4 lanes", "16 lanes", "side by side", "picked", "a copy", "from a file", "fresh")


@pytest.mark.parametrize("kind", POOLS)
def test_any_rows_of_any_pool(sim, pools, kind):
    pool, start = pools[kind], sim.state()

    @ROUND
    @given(st.lists(st.integers(-1, len(pool) - 1), min_size=COUNT, max_size=COUNT))
    def place(rows):
        sim.place(start)
        check(sim, pool, np.array(rows))

    place()
    sim.place(start)
    for rows in (np.full(COUNT, -1), np.zeros(COUNT, int), np.full(COUNT, len(pool) - 1)):
        check(sim, pool, rows)
        sim.place(start)


def test_the_pools_differ_where_they_should(player, pools):
    """Three layouts of the same worlds, none of them like another; what is picked is in another order."""
    layouts = [
        pools[name].layout for name in ("1 lanes", "4 lanes", "16 lanes", "side by side", "picked", "fresh")
    ]
    assert all(a != b for k, a in enumerate(layouts) for b in layouts[:k])
    for name in pools["16 lanes"].names:
        there = pools["16 lanes"][name]
        np.testing.assert_array_equal(pools["picked"][name], there[::-1], err_msg=name)
        np.testing.assert_array_equal(pools["from a file"][name], there, err_msg=name)
        np.testing.assert_array_equal(pools["a copy"][name], pools["4 lanes"][name], err_msg=name)
        assert there.shape == pools["side by side"][name].shape
    np.testing.assert_array_equal(pools["1 lanes"].joint_q, pools["side by side"].joint_q)
    assert pools["fresh"].names == ["joint_q", "joint_qd"]
    assert len(np.unique(pools["16 lanes"]["impulse"].reshape(WORLDS, -1), axis=0)) > WORLDS // 2


def test_what_a_state_shows(player):
    """By name, as the simulation itself has it; copies, none of them a view."""
    sim = varied(player)
    state = sim.state()
    assert len(state) == WORLDS
    for name, values in carried(sim).items():
        np.testing.assert_array_equal(state[name], values, err_msg=name)
        state[name][:] = 99.0
        np.testing.assert_array_equal(state[name], values, err_msg=name)
    np.testing.assert_array_equal(state.joint_q, sim.joint_q)
    np.testing.assert_array_equal(state.joint_qd, sim.joint_qd)
    bits = ("broken", NONFINITE), ("fallen", FALL), ("hurried", OVERSPEED)
    for name, bit in bits:
        assert state[name].any()
        np.testing.assert_array_equal(state[name][:, 0] > 0, sim.status & bit > 0)
    with pytest.raises(KeyError):
        state["joint_target_q"]


def test_a_clone_is_no_view(player):
    state = varied(player).state()
    other, q = state.clone(), state.joint_q
    state.data.zero_()
    np.testing.assert_array_equal(other.joint_q, q)
    assert not state.joint_q.any()


@pytest.mark.parametrize("kind", ["1 lanes", "16 lanes", "side by side", "fresh"])
def test_picked_states(pools, kind):
    """By number, as often as asked for, and by mask."""
    pool = pools[kind]
    for rows in ([3, 3, 0], np.arange(len(pool)) % 5 == 2, [-1], []):
        picked = pool.select(np.asarray(rows, None if len(rows) else int))
        for name in pool.names:
            np.testing.assert_array_equal(
                picked[name], pool[name][np.asarray(rows, None if len(rows) else int)]
            )


@pytest.mark.parametrize("way", ["as it is", "cloned", "picked", "pickled"])
@pytest.mark.parametrize("lanes", [1, 16])
def test_a_placed_world_goes_on_as_its_source(player, lanes, way):
    """Bit for bit, contact history included, in a batch of another size and in any place of it."""
    source = Simulation(player, WORLDS, lanes=lanes)
    q = np.tile(player.keyframes["hold"], (WORLDS, 1))
    q[:, 2] += np.linspace(0, 0.02, WORLDS)
    source.reset(joint_q=q)
    other = Simulation(player, COUNT, lanes=lanes)
    for sim in (source, other):
        sim.set_targets(player.keyframes["hold"])
    source.step(25)
    state = source.state()
    pool = {
        "as it is": lambda: state,
        "cloned": state.clone,
        "picked": lambda: state.select(np.arange(WORLDS)),
        "pickled": lambda: pickle.loads(pickle.dumps(state)),
    }[way]()
    rows = np.random.default_rng(4).integers(WORLDS, size=COUNT)
    other.step(7)
    other.place(pool, rows)
    for sim in (source, other):
        sim.step(15)
    for name, values in carried(source).items():
        np.testing.assert_array_equal(carried(other)[name], values[rows], err_msg=name)


def test_lanes_go_on_as_one_another(player):
    """To the rounding that one width contracts and another does not."""
    source = Simulation(player, 5, lanes=1)
    source.step(20)
    other = Simulation(player, 5, lanes=16)
    other.place(source.state())
    np.testing.assert_array_equal(other.joint_q, source.joint_q)
    np.testing.assert_array_equal(other.contacts().impulse, source.contacts().impulse)
    for sim in (source, other):
        sim.step(10)
    np.testing.assert_allclose(other.joint_q, source.joint_q, atol=1e-5)


def test_what_a_state_lacks_becomes_zero(player, sim):
    """Velocities, contact history and status: of fresh poses, and of states that have but one quantity."""
    start = sim.state()
    q = unit(player, poses(player, np.random.default_rng(5), COUNT))
    assert all(start[name].any() for name in ("joint_qd", "impulse", "fallen"))
    only = State(
        wp.array(q.ravel(), dtype=float, device="cpu"), Layout.plain(COUNT, {"joint_q": (player.nq, 1)})
    )
    for pool in (State.of(player, q), only):
        sim.place(start)
        sim.place(pool)
        for name, values in carried(sim).items():
            np.testing.assert_array_equal(values, q if name == "joint_q" else 0.0, err_msg=name)
        assert not sim.status.any() and not sim.contacts().impulse.any()
    sim.place(start)


def test_a_reset_places_fresh_states(player, sim):
    """Bit for bit, of all worlds and of some, by number and by mask, a pose for each or one for all."""
    start = sim.state()
    q, qd = fresh(player, 3)
    mask = np.zeros(COUNT, bool)
    mask[[2, 7, 20]] = True
    by_world = np.full(COUNT, -1)
    by_world[[2, 7, 20]] = [0, 1, 2]
    for worlds, rows, pool in (
        ([2, 7, 20], by_world, State.of(player, unit(player, q.astype(float)), qd)),
        (mask, by_world, State.of(player, unit(player, q.astype(float)), qd)),
        ([20, 2], np.where(np.isin(np.arange(COUNT), [20, 2]), 0, -1), State.of(player, player.start_q)),
        (None, np.zeros(COUNT, int), State.of(player, player.start_q)),
    ):
        sim.place(start)
        sim.reset(worlds, *((q, qd) if len(pool) == 3 else ()))
        after = carried(sim)
        sim.place(start)
        sim.place(pool, rows)
        for name, values in carried(sim).items():
            np.testing.assert_allclose(values, after[name], atol=1e-7, err_msg=name)
    sim.place(start)


def test_states_of_poses(player):
    """One pose or many, at rest, with one velocity for all or each its own."""
    q, qd = fresh(player, 4)
    for got, count in ((State.of(player, q[0]), 1), (State.of(player, q), 4)):
        assert len(got) == count and not got.joint_qd.any()
        np.testing.assert_array_equal(got.joint_q, q[:count])
    np.testing.assert_array_equal(State.of(player, q, qd[0]).joint_qd, np.tile(qd[0], (4, 1)))
    np.testing.assert_array_equal(State.of(player, q, qd).joint_qd, qd)
    with pytest.raises(ValueError, match=rf"joint_q must have shape \(count, {player.nq}\)"):
        State.of(player, q[:, 1:])
    with pytest.raises(ValueError):
        State.of(player, q, qd[:3])


def test_wrong_rows_are_refused(player, sim, pools):
    """And nothing has changed then."""
    pool, before = pools["16 lanes"], carried(sim)
    good = np.arange(COUNT)
    shape = f"rows must be {COUNT} whole numbers, one for each world"
    for rows in (good[1:], np.arange(COUNT + 1), good[:, None], good.astype(float), good > 3, 0):
        with pytest.raises(ValueError, match=shape):
            sim.place(pool, rows)
    for wrong in (-2, len(pool), len(pool) + 7):
        with pytest.raises(IndexError, match=f"rows must lie in -1 .. {len(pool) - 1}"):
            sim.place(pool, np.where(good == 5, wrong, good))
    with pytest.raises(ValueError, match=f"the pool has {len(pool)} states for {COUNT} worlds: give rows"):
        sim.place(pool)
    for name, values in carried(sim).items():
        np.testing.assert_array_equal(values, before[name], err_msg=name)


def test_states_of_another_model_are_refused(stiff, player, sim):
    """They would be read beyond their end."""
    other = Simulation(stiff, COUNT)
    for pool in (other.state(), State.of(stiff, stiff.start_q)):
        with pytest.raises(ValueError, match="states are of another model: joint_q differs in size"):
            sim.place(pool, np.zeros(COUNT, int))
    with pytest.raises(ValueError, match="states are of another model"):
        other.place(sim.state())


# ------------------------------------------------------------------------------------------- one launch


@pytest.fixture
def launched(monkeypatch):
    """Names of the kernels that are launched, in order."""
    names, original = [], wp.Launch.launch

    def launch(self, *args, **how):
        names.append(self.kernel.key)
        return original(self, *args, **how)

    monkeypatch.setattr(wp.Launch, "launch", launch)
    return names


def test_ten_of_a_thousand_worlds_are_placed_in_one_launch(player, launched):
    """And reset, and copied; worlds that are not meant keep their bits."""
    sim = Simulation(player, 1024, lanes=16, threads=1)
    sim.set_targets(player.start_q)
    pool = State.of(player, *fresh(player, 10))
    some = np.random.default_rng(6).permutation(1024)[:10]
    others = np.setdiff1d(np.arange(1024), some)
    rows = np.full(1024, -1)
    rows[some] = np.arange(10)
    sim.step()
    before = sim.joint_q
    launched.clear()
    sim.place(pool, rows)
    assert launched == ["place"]
    np.testing.assert_array_equal(sim.joint_q[some], pool.joint_q)
    np.testing.assert_array_equal(sim.joint_q[others], before[others])

    launched.clear()
    sim.reset(some)
    assert launched == ["place"]
    np.testing.assert_allclose(sim.joint_q[some], np.tile(player.start_q, (10, 1)), atol=1e-6)
    np.testing.assert_array_equal(sim.joint_q[others], before[others])

    in_place = np.arange(1024)
    in_place[some[:5]] = others[:5]
    for sources in (in_place, np.roll(in_place, 1)):  # the latter by way of a state
        before = sim.joint_q
        launched.clear()
        sim.copy_worlds(sources)
        assert launched == ["place"]
        np.testing.assert_array_equal(sim.joint_q, before[sources])

    state = sim.state()
    launched.clear()
    sim.place(state)
    assert launched == []  # nothing but a copy of memory


def test_no_launch_for_ports_that_are_not_open(player, launched):
    """An open one costs two a step; one lane has none."""
    for lanes, each in ((16, ["read", "step", "show"]), (1, ["step"])):
        sim = Simulation(player, 20, lanes=lanes, threads=1)
        launched.clear()
        sim.step(3)
        assert launched == ["step"]
        sim.port("joint_q")
        launched.clear()
        sim.step(3)
        assert launched == each
