"""States branch inside the batch: a copied world goes on as its source would have."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.sims.worlds.scene import WORLDS, carried, spare, varied
from warpdribble.sims import Simulation
from warpdribble.sims.worlds.batch import Batch
from warpdribble.sims.worlds.simulation import FALL, NONFINITE, OVERSPEED


@pytest.mark.parametrize("lanes", [1, 16])
def test_a_copy_goes_on_as_its_source(player, lanes):
    """Bit for bit, contact history included, wherever in the batch it lies."""
    model = player
    random = np.random.default_rng(0)
    sim = Simulation(model, 20, lanes=lanes)
    start = np.tile(model.keyframes["hold"], (20, 1))
    start[:, 2] += random.uniform(0, 0.02, 20)
    sim.reset(joint_q=start)
    sim.set_targets(model.keyframes["hold"])
    sim.step(30)
    sources = random.integers(0, 20, 20)
    sim.copy_worlds(sources)
    after = sim.joint_q
    assert len(np.unique(after, axis=0)) == len(np.unique(sources))
    sim.step(30)
    for source in np.unique(sources):
        copies = sim.joint_q[sources == source]
        np.testing.assert_array_equal(copies, np.tile(copies[:1], (len(copies), 1)))

    alone = Simulation(model, 20, lanes=lanes)
    alone.reset(joint_q=start)
    alone.set_targets(model.keyframes["hold"])
    alone.step(60)
    np.testing.assert_array_equal(sim.joint_q, alone.joint_q[sources])


def test_sources_are_checked(player):
    sim = Simulation(player, 2)
    with pytest.raises(ValueError, match="sources must have shape"):
        sim.copy_worlds([0])
    with pytest.raises(IndexError, match="worlds must lie in"):
        sim.copy_worlds([0, 2])


@pytest.fixture(scope="module")
def sim(player):
    return varied(player, threads=2)


def check(sim, sources):
    """Copying gives what indexing gives."""
    before = carried(sim)
    sim.copy_worlds(sources)
    for name, rows in carried(sim).items():
        np.testing.assert_array_equal(rows, before[name][sources], err_msg=name)
    unused = spare(sim)
    np.testing.assert_array_equal(unused, np.broadcast_to(sim.joint_q[-1], unused.shape))


def test_worlds_of_the_scene_differ(sim):
    """Else no copy could be told from its source."""
    status = sim.status
    assert {NONFINITE, FALL, OVERSPEED} <= {bit for bit in (1, 2, 4, 8) if (status & bit).any()}
    assert not status.all()
    rows = carried(sim)
    for name in ("joint_q", "joint_qd", "impulse"):
        assert len(np.unique(rows[name].reshape(WORLDS, -1), axis=0)) == WORLDS


def fixed(sources):
    """Sources that stay as they are, so that nothing is copied from what changes."""
    sources = np.array(sources)
    return np.where(np.isin(np.arange(WORLDS), sources), np.arange(WORLDS), sources)


SWAP = np.arange(WORLDS)
SWAP[[0, 36]] = 36, 0  # a world of the first group with one of the last, which the unused lanes follow


@pytest.mark.parametrize(
    "sources",
    [np.arange(WORLDS), SWAP, np.roll(np.arange(WORLDS), 1), np.arange(WORLDS)[::-1], np.full(WORLDS, 5)],
    ids=["each its own", "a swap", "one further", "backwards", "all the same"],
)
def test_permutations(sim, sources):
    """A world that is copied from may itself be overwritten."""
    start = sim.state()
    check(sim, sources)
    sim.place(start)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(sources=st.lists(st.integers(0, WORLDS - 1), min_size=WORLDS, max_size=WORLDS), in_place=st.booleans())
def test_any_sources(sim, sources, in_place):
    start = sim.state()
    check(sim, fixed(sources) if in_place else np.array(sources))
    sim.place(start)


def test_status_goes_along(sim):
    start, status = sim.state(), sim.status
    sources = np.roll(np.arange(WORLDS), 4)
    sim.copy_worlds(sources)
    np.testing.assert_array_equal(sim.status, status[sources])
    sim.place(start)
    np.testing.assert_array_equal(sim.status, status)


def test_targets_forces_and_masses_stay(sim):
    start = sim.state()
    before = [sim._read(getattr(sim._world, name)) for name in ("target", "force", "mass_scale")]
    assert all(len(np.unique(rows.reshape(WORLDS, -1), axis=0)) == WORLDS for rows in before)
    sim.copy_worlds(np.roll(np.arange(WORLDS), 1))
    for name, rows in zip(("target", "force", "mass_scale"), before):
        np.testing.assert_array_equal(sim._read(getattr(sim._world, name)), rows)
    sim.place(start)


@pytest.mark.parametrize("lanes", [1, 16])
def test_a_state_goes_on_the_same(player, lanes):
    """Bit for bit, from before falls, resets and copies; and a state is no view of what goes on."""
    sim = varied(player, lanes)
    start, before = sim.state(), carried(sim)
    sim.step(5)
    first = carried(sim)
    assert not np.array_equal(first["joint_q"], before["joint_q"])
    sim.copy_worlds(np.arange(WORLDS)[::-1])
    sim.reset([1, 2])
    for _ in range(2):
        sim.place(start)
        for name, rows in carried(sim).items():
            np.testing.assert_array_equal(rows, before[name], err_msg=name)
        sim.step(5)
        for name, rows in carried(sim).items():
            np.testing.assert_array_equal(rows, first[name], err_msg=name)


def test_worlds_side_by_side(player, monkeypatch):
    """The layout that CUDA uses: copies, and a state that worlds are put back into."""
    monkeypatch.setattr(Batch, "_side_by_side", property(lambda self: True, lambda self, value: None), False)
    columns = varied(player, lanes=1)
    assert columns._world.q.strides[0] < columns._world.q.strides[1]
    start, before = columns.state(), carried(columns)
    for sources in (SWAP, fixed(np.random.default_rng(3).integers(WORLDS, size=WORLDS)), np.full(WORLDS, 5)):
        check(columns, sources)
        columns.place(start)
        for name, rows in carried(columns).items():
            np.testing.assert_array_equal(rows, before[name], err_msg=name)


def test_a_mask_is_no_list_of_sources(player):
    with pytest.raises(ValueError, match="sources must have shape"):
        Simulation(player, 3).copy_worlds([True, False, True])
    with pytest.raises(ValueError, match="whole numbers"):
        Simulation(player, 2).copy_worlds([0.0, 1.0])
