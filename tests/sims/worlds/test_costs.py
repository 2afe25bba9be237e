"""What groups of observations cost, against NumPy in float64."""

import numpy as np
import pytest

from tests.sims.worlds.float64 import poses
from warpdribble.sims import Simulation
from warpdribble.sims.worlds import Group, Probe, terms

WORLDS, ROWS = 19, 5
OF = {
    "lean": terms.lean(),
    "height": terms.height(),
    "com": terms.com(),
    "foot": terms.point("l_foot"),
    "miss": terms.miss(("l_hip", "r_knee")),
}
GROUPS = (
    Group("com", 2.0),
    Group("foot", 30.0, (2, 3)),
    Group("foot", 0.5, (0, 2)),
    Group("miss", 5.0, (1, 2)),
    Group("lean", 0.0),
)


def by_numpy(probe, groups, felt, wanted):
    """(worlds,) of felt (worlds, size) and what is wanted of each."""
    cost = np.zeros(len(felt))
    for group in groups:
        first, end = group.part or (0, None)
        columns = np.arange(probe.size)[probe.columns[group.name]][first:end]
        cost += group.weight * np.linalg.norm(felt[:, columns].astype(float) - wanted[:, columns], axis=1)
    return cost


@pytest.fixture(scope="module", params=[1, 16])
def scene(request, stiff):
    """A probe of players in random poses, and what is wanted, by row."""
    random = np.random.default_rng(0)
    sim = Simulation(stiff, WORLDS, lanes=request.param)
    sim.reset(joint_q=poses(stiff, random, WORLDS))
    goals = poses(stiff, random, ROWS), random.standard_normal((ROWS, stiff.nv))
    probe = Probe(sim, OF, goals, GROUPS)
    return probe, random.standard_normal((ROWS, probe.size)).astype(np.float32), random


def test_cost(scene):
    """Each world by a row of its own, to the rounding of a dozen operations."""
    probe, wanted, random = scene
    probe.want(wanted)
    for _ in range(3):
        rows = random.integers(ROWS, size=WORLDS)
        felt, cost = probe.judge(rows)
        assert cost.shape == (WORLDS,) and cost.min() > 1.0
        np.testing.assert_allclose(cost, by_numpy(probe, GROUPS, felt, wanted[rows]), rtol=1e-6)
        np.testing.assert_array_equal(felt, probe.read(rows))


def test_one_row_for_all(scene):
    probe, wanted, _ = scene
    probe.want(wanted)
    felt, cost = probe.judge(2)
    np.testing.assert_allclose(cost, by_numpy(probe, GROUPS, felt, wanted[[2] * WORLDS]), rtol=1e-6)


def test_what_is_wanted_costs_nothing(stiff):
    sim = Simulation(stiff, WORLDS)
    sim.reset(joint_q=poses(stiff, np.random.default_rng(1), WORLDS))
    of = {"com": terms.com(), "momentum": terms.momentum()}
    probe = Probe(sim, of, groups=[Group("com", 1.0), Group("momentum", 3.0)])
    felt, cost = probe.judge()
    zeros = np.zeros_like(felt)  # what is wanted until anything is
    np.testing.assert_allclose(
        cost, by_numpy(probe, [Group("com", 1.0), Group("momentum", 3.0)], felt, zeros)
    )
    probe.want(felt)
    again, cost = probe.judge(np.arange(WORLDS))
    np.testing.assert_array_equal(again, felt)
    assert not cost.any()
    assert probe.judge(np.roll(np.arange(WORLDS), 1))[1].all()


def test_without_groups_nothing_costs(stiff):
    probe = Probe(Simulation(stiff, 3), {"com": terms.com()})
    assert not probe.judge()[1].any()


def test_refused(scene, stiff):
    """What has another shape would be read beyond its end."""
    probe, wanted, _ = scene
    shape = rf"wanted must have shape \({ROWS}, {probe.size}\)"
    for wrong in (wanted[1:], np.concatenate([wanted, wanted]), wanted[:, 1:], wanted[0], wanted[None]):
        with pytest.raises(ValueError, match=shape):
            probe.want(wrong)
    free = Probe(Simulation(stiff, 2), {"com": terms.com()})
    with pytest.raises(ValueError, match=r"wanted must have shape \(4, 3\)"):
        free.want(np.zeros((4, 2)))
    free.want(np.zeros((4, 3)))
    with pytest.raises(IndexError, match=r"rows must lie in 0 .. 3"):
        free.judge(4)
    with pytest.raises(KeyError):
        Probe(Simulation(stiff, 2), {"com": terms.com()}, groups=[Group("head", 1.0)])
