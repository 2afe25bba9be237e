"""The running dribble: feet, flights, ground forces and the ball's way, read off poses alone."""

import numpy as np
import pytest

from warpdribble.sims import Model, authored_clip
from warpdribble.sims.model import gaps, pose
from warpdribble.sims.reference.reference import Cycle
from warpdribble.sims.signals import runs

PERIOD, SPEED, STEP = 70, 2.5, 0.01


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module")
def clip(player):
    return authored_clip(player, "run_dribble")


@pytest.fixture(scope="module")
def body_q(player, clip):
    """Three cycles."""
    return pose.forward(player, Cycle.of(player, clip.reference).repeat(player, 3).joint_q)


@pytest.fixture(scope="module")
def low(player, body_q):
    """(2, frames) [m] over the ground of the lowest points of both feet."""
    return np.array([gaps.lowest_point(player, body_q, _foot(player, side)) for side in "lr"])


def _foot(player, side):
    return [player.body(f"{side}_{part}") for part in ("foot", "toes")]


def _pushed(player, body_q):
    """(frames - 2, 3) [m/s^2] of the centre of mass."""
    own, centres = pose.centres_of_mass(player, body_q)
    share = player.body_mass[own] / player.body_mass[own].sum()
    return np.diff(np.einsum("b,fbk->fk", share, centres), 2, axis=0) / STEP**2


def test_it_runs_two_steps_a_cycle_and_flies_after_each(clip, low):
    down = low < 1e-4
    assert clip.reference.timestep == STEP and low.shape[1] == 3 * PERIOD + 1
    for foot, first in ((0, PERIOD), (1, PERIOD // 2)):
        landed, left = next(span for span in runs(down[foot]) if span[0] > 10)
        assert (landed, left) == (first, first + 25)
    flights = runs(~down.any(axis=0))
    assert len(flights) == 6 and all(last - first == 8 for first, last in flights)
    assert not down.all(axis=0).any()


def test_a_foot_on_the_ground_neither_slides_nor_sinks(player, body_q, low):
    assert low.min() > -1e-4
    for side in "lr":
        assert np.nanmax(gaps.sliding(player, body_q, _foot(player, side), STEP, 1e-3)) < 0.002


def test_a_foot_in_the_air_clears_the_ground(low):
    """It leaves and lands without grazing: from 40 ms after it has left to 40 ms before it lands."""
    for foot in low:
        for first, last in runs(foot > 1e-4):
            if first > 0 and last < len(foot) - 1:
                assert foot[first + 4 : last - 3].min() > 0.015
                assert foot[first:last].max() > 0.12


def test_in_flight_the_centre_of_mass_falls(player, body_q, low):
    pushed, air = _pushed(player, body_q), (low > 1e-4).all(axis=0)
    inside = air[:-2] & air[1:-1] & air[2:]
    assert inside.sum() > 30
    assert np.allclose(pushed[inside, 2], -9.81, atol=0.02)
    assert np.abs(pushed[inside, 0]).max() < 0.15 and np.abs(pushed[inside, 1]).max() < 0.5


def test_the_ground_pushes_as_it_pushes_runners(player, body_q, low):
    """Up all the time, twice to three times the weight at most, and on the whole just the weight; against the
    run first, then with it."""
    force = _pushed(player, body_q)[:PERIOD] + [0.0, 0.0, 9.81]
    on = (low < 1e-4).any(axis=0)[1 : PERIOD + 1]
    assert force[:, 2].min() > -0.02
    assert 2.0 < force[on, 2].max() / 9.81 < 3.0
    assert force.mean(axis=0) == pytest.approx([0.0, 0.0, 9.81], abs=0.02)
    assert force[1:11, 0].max() < 0.0 < force[14:23, 0].min()


def test_knees_bend_as_a_runner_s(clip, player, low):
    for foot, side in zip(low, "lr"):
        knee = np.degrees(clip.reference.joint_q[:-1, player.q_slice(f"{side}_knee")][:, 0])
        down = foot[:PERIOD] < 1e-4
        assert knee.min() > 15.0 and 85.0 < knee[~down].max() < 115.0 and 40.0 < knee[down].max() < 60.0
        assert np.abs(np.diff(np.append(knee, knee[:3]), 2)).max() / STEP < 360.0  # [degrees/s]


def test_shoulders_turn_against_the_hips_and_the_free_arm_with_the_other_leg(player, body_q):
    from warpdribble.sims.planar import heading

    cycle = body_q[:PERIOD]
    yaw = {name: heading(cycle[:, player.body(name), 3:]) for name in ("pelvis", "torso")}
    assert np.corrcoef(yaw["pelvis"], yaw["torso"])[0, 1] < 0.2
    hand, knee = (cycle[:, player.body(name), 0] for name in ("l_hand", "r_lower_leg"))
    along = SPEED * STEP * np.arange(PERIOD)
    assert np.corrcoef(hand - along, knee - along)[0, 1] > 0.7


def test_the_ball_bounces_once_beside_the_left_foot_and_the_ground_grips_it(player, clip, body_q):
    path, touch = clip.ball.path, clip.ball.touch[:, 1]
    speed = np.diff(path, axis=0) / STEP
    bounce = int(np.argmin(path[:, 2]))
    assert len(runs(path[:, 2] < 0.2)) == 1
    left = body_q[bounce, player.body("l_foot"), :3]
    assert 0.1 < path[bounce, 0] - left[0] < 0.6 and 0.2 < left[1] - path[bounce, 1] < 0.5
    before, after = speed[bounce - 3], speed[bounce + 3]
    down, up = before[2] - 9.81 * 2.5 * STEP, after[2] + 9.81 * 3.5 * STEP
    assert -up / down == pytest.approx(0.8, abs=0.04)
    assert after[0] / before[0] == pytest.approx(0.6, abs=1e-6)
    free = np.flatnonzero(~touch)
    assert (free[0], free[-1]) == (1, 44)
    assert path[-1] - path[0] == pytest.approx([SPEED * PERIOD * STEP, 0.0, 0.0])


def test_the_hand_drives_the_ball_forward_and_never_pulls_it_up(player, clip):
    """What it adds to gravity, while it has the ball, points out of the palm or along it."""
    path, touch = clip.ball.path, clip.ball.touch[:, 1]
    push = np.diff(path, 2, axis=0) / STEP**2 + [0.0, 0.0, 9.81]
    held = (touch[:-2] & touch[1:-1] & touch[2:]).nonzero()[0]
    assert push[held, 2].max() < 0.1 and push[held, 0].min() > 0.0


def test_the_ball_keeps_off_the_legs(player, body_q):
    legs = [player.body(f"{side}_{part}") for side in "lr" for part in ("upper_leg", "lower_leg", "foot")]
    centre = body_q[:, player.body("ball"), :3]
    assert gaps.gap_to_bodies(player, body_q, legs, centre).min() - player.ball_radius > 0.02
