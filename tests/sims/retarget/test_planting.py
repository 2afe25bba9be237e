import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model
from warpdribble.sims.retarget.accuracy import skimming
from warpdribble.sims.retarget.planting import Stand, Tread, find_stands, standing, standing_foot
from warpdribble.sims.retarget.sole import find_foot, lowest, sole_heights
from warpdribble.sims.retarget.swings import swinging


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


def tread(foot, ankle, turn, toes=0.0):
    ball = ankle[:, 2] + turn.apply(foot.ball)[:, 2]
    return Tread(ankle, turn, ball, np.full(len(ankle), toes))


def steps(foot, slide=0.0, up=0.1, toes=0.0, pitch=0.0):
    """A foot that stands 0.5 s, swings 0.5 s to 0.6 m ahead, and stands again; rows of 0.01 s."""
    times = np.arange(150) * 0.01
    share = np.clip((times - 0.5) / 0.5, 0.0, 1.0)
    ankle = np.zeros((150, 3))
    ankle[:, 0] = 0.6 * share**2 * (3.0 - 2.0 * share) + slide * times
    ankle[:, 2] = -foot.heel[2] + up * np.sin(np.pi * share) ** 2
    turn = Rotation.from_euler("y", pitch * np.ones((150, 1)))
    return tread(foot, ankle, turn, toes)


def test_stands_are_found(foot):
    found = find_stands(foot, steps(foot), 0.01)
    assert [(s.first, s.last) for s in found] == [
        (0, pytest.approx(58, abs=6)),
        (pytest.approx(92, abs=6), 149),
    ]


def planted(foot, recorded):
    stands = find_stands(foot, recorded, 0.01)
    return stands, *swinging(foot, recorded, stands, 0.01)


def test_a_planted_foot_does_not_slide(foot):
    stands, place, turn, _ = planted(foot, steps(foot, slide=0.08))
    for one in stands:
        joint = (place + turn.apply(foot.ball))[one.rows]
        assert np.ptp(joint, axis=0).max() < 1e-9
    assert sole_heights(foot, place, turn).min() > -1e-9


def test_a_swing_begins_and_ends_without_jerks(foot):
    """Slid by 8 cm/s while it stood: what that makes up for is spread. The recording's own is 7 m/s^2."""
    recorded = steps(foot, slide=0.08)
    _, place, _, _ = planted(foot, recorded)
    acceleration = np.diff(place[:, :2], 2, axis=0) / 0.01**2
    assert np.abs(acceleration).max() < 25.0
    assert np.abs(place - recorded.ankle).max() < 0.06


def test_a_swing_is_as_high_as_it_was_recorded(foot):
    recorded = steps(foot)
    stands, place, _, _ = planted(foot, recorded)
    middle = ~standing(stands, 150)
    assert np.abs(place - recorded.ankle)[middle, 2].max() < 0.01


def test_toes_that_are_up_leave_room_for_the_heel(foot):
    """Who is recorded lands on a heel that ends 5 cm nearer to the ball of the foot: under toes as high as
    theirs and turned up as far, our heel would be in the ground; lifted off it, the ball is 2 cm higher."""
    recorded, times = steps(foot), np.arange(150) * 0.01
    pitch = -0.4 * np.interp(times, [0.6, 0.8, 1.0, 1.2], [0.0, 1.0, 1.0, 0.0])
    turn = Rotation.from_euler("y", pitch[:, None])
    lever = (foot.ball - foot.heel)[0] - 0.05
    ball = recorded.ankle + foot.ball
    ball[:, 2] = foot.drop + lever * np.sin(-pitch) + 0.03 * np.sin(np.pi * np.clip(2 * times - 1, 0, 1)) ** 2
    stands, place, own, _ = planted(foot, tread(foot, ball - turn.apply(foot.ball), turn))
    swing = (times > 0.65) & (times < 0.97)
    assert not standing(stands, 150)[swing].any()
    assert np.abs((place + own.apply(foot.ball) - ball)[swing, 2]).max() < 0.005
    assert np.degrees((own.inv() * turn).magnitude()).max() < 10.5
    assert lowest(foot, place, own, np.zeros(150)).min() > -1e-3


@pytest.mark.parametrize(("up", "toes"), [(0.0, 0.0), (0.02, 0.6), (0.03, -0.4)])
def test_what_moves_clears_the_ground(foot, up, toes):
    """A recorded foot that shuffles, or whose toes hang."""
    recorded = steps(foot, up=up, toes=toes)
    stands, place, turn, bent = planted(foot, recorded)
    moves = ~standing(stands, 150)
    assert lowest(foot, place, turn, bent)[moves][4:-4].min() > 0.005
    sole = np.stack([place + turn.apply(corner) for corner in foot.corners], axis=1)
    assert skimming(sole, 0.01).sum() <= 6


def test_toes_are_flat_in_stance_and_as_recorded_in_the_swing(foot):
    stands, _, _, bent = planted(foot, steps(foot, toes=-0.3))
    stood = standing(stands, 150)
    assert bent[stood] == pytest.approx(0.0, abs=1e-6)
    assert bent[~stood][8:-8] == pytest.approx(-0.3, abs=0.02)


@pytest.mark.parametrize(("pitch", "toes"), [(0.1, 0.2), (-0.15, -0.3)])
def test_a_recorded_foot_is_levelled(foot, pitch, toes):
    """Recorded 6 degrees toes down, say, throughout: it stands flat, and swings flat."""
    level = steps(foot, pitch=pitch, toes=toes).levelled(foot, 0.01)
    assert level.turn.magnitude().max() < 1e-9 and np.abs(level.toes).max() < 1e-9


def test_a_turned_foot_has_no_say_in_the_next_swing(foot):
    """A foot that still turns at touchdown is not turned the other way before: its rate is not carried on."""
    recorded = steps(foot)
    times = np.arange(150) * 0.01
    yaw = np.interp(times, [0.5, 0.97], [0.0, 1.5])
    turn = Rotation.from_euler("z", yaw[:, None])
    recorded = tread(foot, recorded.ankle - turn.apply(foot.ball) + foot.ball, turn)
    _, _, own, _ = planted(foot, recorded)
    heading = own.apply([1.0, 0.0, 0.0])
    assert np.arctan2(heading[:, 1], heading[:, 0]).min() > -0.05
    assert np.degrees((own.inv() * turn).magnitude()).max() < 12.0


def test_stands_leave_time_for_the_way_between(foot):
    """Slid by 3 cm within 0.05 s, at 0.6 m/s: no foot is accelerated like that."""
    times = np.arange(100) * 0.01
    ankle = np.zeros((100, 3))
    ankle[:, 0] = np.interp(times, [0.5, 0.55], [0.0, 0.03])
    ankle[:, 2] = -foot.heel[2]
    recorded = tread(foot, ankle, Rotation.identity(100))
    stands, place, _, _ = planted(foot, recorded)
    assert len(stands) == 2 and stands[1].first - stands[0].last >= 12
    assert np.abs(np.diff(place[:, 0], 2) / 0.01**2).max() < 15.0


def test_no_stand_leaves_the_foot_as_it_is(foot):
    recorded = steps(foot).above(np.full(150, -0.5))
    assert find_stands(foot, recorded, 0.01) == []
    assert np.array_equal(swinging(foot, recorded, [], 0.01)[0], recorded.ankle)
