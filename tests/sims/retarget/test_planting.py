import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model
from warpdribble.sims.retarget.planting import (
    Stand,
    find_foot,
    find_stands,
    planted,
    sole_heights,
    standing_foot,
)


@pytest.fixture(scope="module")
def foot():
    return find_foot(Model.load("player"), "l_foot")


def stand(pitch, yaw=0.0):
    pitch = np.atleast_1d(np.asarray(pitch, float))
    return Stand(0, len(pitch) - 1, np.array([0.4, 0.1]), np.full(len(pitch), yaw), pitch)


def test_the_sole_of_a_flat_foot_is_on_the_ground(foot):
    ankle, turn = standing_foot(foot, stand([0.0], yaw=0.7))
    assert sole_heights(foot, ankle, turn) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("pitch", [0.1, 0.6, 1.1])
def test_with_the_heel_up_the_toe_joint_stays(foot, pitch):
    ankle, turn = standing_foot(foot, stand([0.0, pitch], yaw=0.3))
    joint = ankle + turn.apply(foot.ball)
    assert joint[1] == pytest.approx(joint[0])
    assert sole_heights(foot, ankle, turn)[1, 0] > 0.0


@pytest.mark.parametrize("pitch", [-0.1, -0.4])
def test_with_the_toes_up_the_heel_stays(foot, pitch):
    ankle, turn = standing_foot(foot, stand([0.0, pitch]))
    heel = ankle + turn.apply(foot.heel)
    assert heel[1] == pytest.approx(heel[0])


def steps(foot, slide=0.0):
    """An ankle that stands 0.5 s, swings 0.5 s to 0.6 m ahead, and stands again; rows of 0.01 s."""
    times = np.arange(150) * 0.01
    share = np.clip((times - 0.5) / 0.5, 0.0, 1.0)
    ankle = np.zeros((150, 3))
    ankle[:, 0] = 0.6 * share**2 * (3.0 - 2.0 * share) + slide * times
    ankle[:, 2] = -foot.heel[2] + 0.1 * np.sin(np.pi * share) ** 2
    return ankle, Rotation.identity(150)


def test_stands_are_found(foot):
    found = find_stands(foot, *steps(foot), 0.01)
    assert [(s.first, s.last) for s in found] == [
        (0, pytest.approx(58, abs=6)),
        (pytest.approx(92, abs=6), 149),
    ]


def test_a_planted_foot_does_not_slide_and_moves_without_jumps(foot):
    ankle, turn = steps(foot, slide=0.08)
    stands = find_stands(foot, ankle, turn, 0.01)
    place, turn, _ = planted(foot, ankle, turn, stands)
    for one in stands:
        joint = (place + turn.apply(foot.ball))[one.first : one.last + 1]
        assert np.ptp(joint, axis=0).max() < 1e-9
    assert np.linalg.norm(np.diff(place, axis=0), axis=1).max() < 0.03
    assert np.abs(place - ankle).max() < 0.06
    assert sole_heights(foot, place, turn).min() > -1e-9


def test_no_stand_leaves_the_foot_as_it_is(foot):
    ankle, turn = steps(foot)
    ankle[:, 2] += 0.5
    assert find_stands(foot, ankle, turn, 0.01) == []
    assert np.array_equal(planted(foot, ankle, turn, [])[0], ankle)
