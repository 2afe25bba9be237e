"""States branch inside the batch: a copied world goes on as its source would have."""

import numpy as np
import pytest

from warpdribble.sims import Model, Simulation


@pytest.mark.parametrize("lanes", [1, 16])
def test_a_copy_goes_on_as_its_source(lanes):
    """Bit for bit, contact history included, wherever in the batch it lies."""
    model = Model.load("player")
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


def test_sources_are_checked():
    sim = Simulation(Model.load("player"), 2)
    with pytest.raises(ValueError, match="sources must have shape"):
        sim.copy_worlds([0])
    with pytest.raises(IndexError, match="worlds must lie in"):
        sim.copy_worlds([0, 2])
