"""How deep soles are pressed in: against roots found numerically, springs counted by hand, and a player that
stands in the simulation."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model, Simulation
from warpdribble.sims.model import gaps
from warpdribble.sims.reference.reference import Reference
from warpdribble.sims.reference.soles import depth, pressed, sink

SPRING = 80e3
"""[N/m] of each of the twelve points on which both feet stand (`assets.player.SOLE`)"""


@pytest.fixture(scope="module")
def player():
    return Model.load("player", without=("ball",))


@pytest.fixture(scope="module")
def weight(player):
    return player.body_mass.sum() * 9.81


def at_heights(player, up):
    """The zero pose, flat on its feet, with its soles at heights up (frames,) [m]."""
    joint_q = np.tile(player.zero_q, (len(up), 1)).astype(float)
    everything = range(player.nbody)
    joint_q[:, 2] += up - gaps.lowest_point(player, player.zero_pose[None], everything)[0]
    return Reference(joint_q, player.timestep)


def test_springs_carry_the_force():
    random = np.random.default_rng(0)
    heights, springs = random.uniform(0.0, 0.01, (50, 7)), random.uniform(1e4, 1e5, 7)
    force = random.uniform(0.0, 3e3, 50)

    def missing(d, row):
        return np.sum(springs * np.maximum(d - heights[row], 0.0)) - force[row]

    expected = [brentq(missing, 0.0, 1.0, args=(row,), xtol=1e-12) for row in range(50)]
    np.testing.assert_allclose(sink(heights, springs, force), expected, atol=1e-9)


def test_who_stands_sinks_in_and_who_flies_does_not(player, weight):
    standing, flying = at_heights(player, np.zeros(60)), at_heights(player, np.full(60, 0.1))
    np.testing.assert_allclose(depth(player, standing), weight / (12 * SPRING), rtol=1e-3)
    np.testing.assert_allclose(depth(player, flying), 0.0, atol=1e-12)
    lowered = standing.joint_q - pressed(player, standing).joint_q
    np.testing.assert_allclose(lowered[:, 2], weight / (12 * SPRING), rtol=1e-3)
    assert np.count_nonzero(lowered.any(axis=0)) == 1


def test_who_is_thrown_upward_sinks_in_more(player, weight):
    """By half as much again while accelerated upward by half of g, on the ground in the middle."""
    t = np.arange(-40, 41) * player.timestep
    found = depth(player, at_heights(player, 0.5 * 4.905 * t**2))
    assert found[40] == pytest.approx(1.5 * weight / (12 * SPRING), rel=0.1)
    assert np.abs(found[[0, -1]]).max() < 1e-4


def test_a_player_that_stands_in_the_simulation_sinks_in_as_much(player):
    """On the mean of the points under both feet, as springs of one stiffness do wherever the weight is."""
    stand = at_heights(player, np.zeros(60))
    sim = Simulation(player, 1)
    sim.reset(joint_q=stand.joint_q[0])
    sim.set_targets(stand.joint_q[0])
    sim.step(50)
    shapes = [s for s in player.shapes if s.name in ("l_foot", "r_foot", "l_toes", "r_toes")]
    under = [p for s in shapes for p in points_under(s, sim.body_q[0, s.body].astype(float))]
    assert len(under) == 12 and max(under) < 0.0
    assert -np.mean(under) == pytest.approx(depth(player, stand)[30], rel=0.1)


def points_under(shape, at):
    """Heights [m] of the points of a sole that are its lowest in the zero pose; at (7,) of its body."""
    turn, own = Rotation.from_quat(at[3:]), Rotation.from_quat(shape.quat)
    if shape.kind == "box":
        local = [shape.pos + shape.size * [x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
        radius = 0.0
    else:
        local = [shape.pos + own.apply([0.0, 0.0, z * shape.size[1]]) for z in (-1.0, 1.0)]
        radius = shape.size[0]
    return [at[2] + turn.apply(point)[2] - radius for point in local]
