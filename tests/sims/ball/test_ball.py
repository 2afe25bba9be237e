import numpy as np
import pytest

from warpdribble.clips.read import read_clip
from warpdribble.sims import Model
from warpdribble.sims.authored.catalogue import authored_clip
from warpdribble.sims.ball.ball import (
    find_checkpoints,
    flights_of,
    inferred_ball,
    mirrored_ball,
    recorded_ball,
)
from warpdribble.sims.ball.contact_score import score_contacts
from warpdribble.sims.ball.flight import Bounce, speed_to_meet, speed_to_return, thrown
from warpdribble.sims.reference.reference import Cycle
from warpdribble.sims.retarget.retarget import retargeted

R = 0.1193


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def retargeted_clip(player, mocap, name):
    motion, _ = read_clip(mocap / name)
    return motion, retargeted(player, motion)


@pytest.mark.parametrize(
    ("height", "after", "duration"), [(0.8, 0.9, 0.45), (0.6, 0.6, 0.3), (1.0, 0.8, 0.8)]
)
def test_a_flight_ends_where_it_should(height, after, duration):
    bounce = Bounce(height, speed_to_meet(height, after, duration, R), R)
    assert bounce.at(np.array(duration)) == pytest.approx(after, abs=1e-6)
    before, behind = (bounce.at(np.array(bounce.down + d)) for d in (-1e-4, 1e-4))
    assert (behind - R) / (before - R) == pytest.approx(0.8, abs=0.01)


@pytest.mark.parametrize(
    ("height", "speed", "restitution"), [(1.0, 2.0, 0.8), (0.7, -1.5, 0.8), (0.9, 3.0, 0.6)]
)
def test_a_bounce_is_the_motion_under_gravity(height, speed, restitution):
    """Stepped in small times."""
    bounce, h, end = Bounce(height, speed, R, restitution), 1e-5, 0.5
    z, v, path = height, -speed, []
    for _ in range(round(end / h)):
        path.append(z)
        z, v = z + v * h - 0.5 * 9.81 * h * h, v - 9.81 * h
        if z < R:
            z, v = R, restitution * abs(v)
    since = np.arange(len(path)) * h
    second = bounce.down + 2.0 * restitution * bounce.impact / 9.81
    inside = since < min(end, second)
    np.testing.assert_allclose(bounce.at(since)[inside], np.array(path)[inside], atol=2e-4)


@pytest.mark.parametrize("height", [0.5, 1.0, R, 0.0])
def test_a_ball_comes_back(height):
    bounce = Bounce(height, speed_to_return(height, R), R)
    top = bounce.rising(np.linspace(0.0, 1.5, 100_001)).max()
    assert top == pytest.approx(max(height, R), abs=1e-6)


def test_a_flight_that_cannot_be_is_none():
    assert np.isnan(speed_to_meet(0.8, 3.0, 0.2, R))


def test_a_thrown_ball_bounces_lower_and_lower():
    path = thrown(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), np.arange(400) * 0.01, R)
    tops = path[1:-1, 2][(path[1:-1, 2] > path[:-2, 2]) & (path[1:-1, 2] >= path[2:, 2])]
    assert tops[0] - R == pytest.approx(0.64 * (1.0 - R), abs=0.005)
    assert np.all(np.diff(tops[:3]) < 0.0) and path[:, 2].min() >= R
    assert path[-1, 0] == pytest.approx(3.99)


def test_checkpoints_are_the_highest_rows_of_contacts():
    height = np.array([3.0, 2, 1, 1, 2, 4, 2, 1, 1, 2, 3])
    touch = np.zeros((11, 2), bool)
    touch[[0, 1, 4, 5, 6, 9, 10], 1] = True
    assert find_checkpoints(height, touch) == (5,)
    assert [(f.release, f.catch) for f in flights_of(touch)] == [(2, 4), (7, 9)]


def test_the_authored_dribble_s_ball_is_found_from_its_hand(player):
    clip = authored_clip(player, "dribble_right")
    reference = Cycle(clip.reference).repeat(player, 4)
    ball = inferred_ball(player, reference)
    assert not ball.touch[:, 0].any()
    true = np.concatenate([np.tile(clip.ball.touch[:-1].any(axis=1), 4), [True]])
    score = score_contacts(ball.touch.any(axis=1), true, player.timestep)
    assert score.recall > 0.95 and score.missed == 0
    assert [f.release for f in ball.flights] == pytest.approx([1 + 70 * k for k in range(4)], abs=8)
    assert ball.heights[1:-1] == pytest.approx([clip.ball.heights[0]] * len(ball.heights[1:-1]), abs=0.03)


@pytest.mark.parametrize(
    "name",
    [
        "ballplay_m/044_006pickle_lleg_2.pt",
        "ballplay_m/041_018pickle_pick2back_7.pt",
        "ballplay_m/040_018pickle_rturnover_30.pt",
        "ballplay_m/013_018pickle_run_3.pt",
        "ballplay_m/001_007pickle_pick_002.pt",
    ],
)
def test_contacts_agree_with_the_recorded_ball(player, mocap, name):
    motion, result = retargeted_clip(player, mocap, name)
    ball, true = inferred_ball(player, result.reference, result.scale), recorded_ball(player, result, motion)
    for hand in (0, 1):
        score = score_contacts(ball.touch[:, hand], true.touch[:, hand], player.timestep)
        assert score.precision > 0.9 and score.recall > 0.8
        assert score.missed == 0 and np.abs([0.0, *score.timing]).mean() < 0.15
    assert np.linalg.norm(np.diff(ball.path, axis=0), axis=1).max() < 0.25
    assert ball.path[:, 2].min() > 0.1


def test_checkpoints_and_heights_agree_with_the_recorded_ball(player, mocap):
    motion, result = retargeted_clip(player, mocap, "ballplay_m/044_006pickle_lleg_2.pt")
    ball, true = inferred_ball(player, result.reference, result.scale), recorded_ball(player, result, motion)
    assert len(ball.checkpoints) == len(true.checkpoints) == 3
    assert np.abs(np.subtract(ball.checkpoints, true.checkpoints)).max() < 10
    assert np.abs(np.subtract(ball.heights, true.heights)).max() < 0.03


def test_hands_that_push_are_told_from_arms_that_swing(player, mocap):
    for name in ("cmu/02_01.bvh", "cmu/09_01.bvh", "cmu/09_11.bvh"):
        _, result = retargeted_clip(player, mocap, name)
        assert inferred_ball(player, result.reference, result.scale) is None, name
    _, result = retargeted_clip(player, mocap, "cmu/06_10.bvh")
    ball = inferred_ball(player, result.reference, result.scale)
    pushes = [f for f in ball.flights if f.hand == 1]
    assert len(pushes) >= 10  # 1.21 Hz for 7.7 s, and what comes before and after


def test_scores_add_up():
    a = np.zeros(100, bool)
    a[20:50] = True
    b = np.roll(a, 3)
    one = score_contacts(b, a, 0.01)
    assert one.precision == one.recall == 1.0
    assert one.timing == pytest.approx((0.03, 0.03)) and one.missed == 0
    far = score_contacts(np.roll(a, 40), a, 0.01)
    assert far.precision < 0.2 and (one + far).inferred == 60
    nothing = score_contacts(np.zeros(100, bool), a, 0.01)
    assert nothing.precision == 1.0 and nothing.recall == 0.0 and nothing.missed == 2


def test_the_ball_changes_hands(player):
    ball = authored_clip(player, "dribble_right").ball
    twin = mirrored_ball(ball)
    assert np.array_equal(twin.touch[:, 0], ball.touch[:, 1]) and not twin.touch[:, 1].any()
    assert np.allclose(twin.path[:, 1], -ball.path[:, 1])
