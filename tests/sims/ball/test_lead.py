from dataclasses import replace

import numpy as np
import pytest

from warpdribble.sims import Model
from warpdribble.sims.authored.catalogue import AUTHORED, authored_clip
from warpdribble.sims.ball.ball import Ball, ball_path, flights_of
from warpdribble.sims.ball.flight import BOUNCE, GRAVITY, GRIP
from warpdribble.sims.ball.hands import find_hands
from warpdribble.sims.ball.lead import led, led_once, place_hands
from warpdribble.sims.reference.reference import Cycle, Reference
from warpdribble.skills import Skill, stage_skill


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def authored(player, name):
    clip = authored_clip(player, name)
    flights = tuple(way for way in flights_of(clip.ball.touch) if way.release > 0)
    return Cycle.of(player, clip.reference), replace(clip.ball, flights=flights)


def pulled(player, cycle, ball, height):
    """The cycle with a hand that rises by so much [m] more while it has the ball, and is turned to the side,
    as no palm could pull a ball up."""
    shift, turn = np.zeros((2, cycle.reference.frame_count, 2, 3))
    for way in ball.flights:
        hold = np.arange(way.catch, cycle.reference.frame_count)
        shift[hold, way.next_hand, 2] = height * np.sin(np.pi * (hold - hold[0]) / (hold[-1] - hold[0])) ** 2
    joint_q = place_hands(player, cycle.reference.joint_q, shift, turn)
    return replace(cycle, reference=Reference(joint_q, cycle.reference.timestep))


def test_hands_are_put_where_they_are_asked_to_be(player):
    cycle, _ = authored(player, "dribble_right")
    rng, joint_q = np.random.default_rng(0), cycle.reference.joint_q
    before = find_hands(player, cycle.reference)
    shift = 0.05 * rng.uniform(-1.0, 1.0, (1, 2, 3)) * np.array([0.0, 1.0])[:, None]
    turn = 0.3 * rng.uniform(-1.0, 1.0, (1, 2, 3)) * np.array([0.0, 1.0])[:, None]
    shift, turn = (np.repeat(v, len(joint_q), axis=0) for v in (shift, turn))
    joint_q = place_hands(player, joint_q, shift, turn)
    after = find_hands(player, Reference(joint_q, cycle.reference.timestep))
    np.testing.assert_allclose(after.centre - before.centre, shift, atol=1e-6)
    angle = np.arccos(np.sum(after.normal[:, 1] * before.normal[:, 1], axis=1))
    assert np.all(angle <= np.linalg.norm(turn[0, 1]) + 1e-6) and np.all(angle > 0.05)
    np.testing.assert_array_equal(after.normal[:, 0], before.normal[:, 0])


@pytest.mark.parametrize(("early", "restitution"), [(0.0, 0.8), (0.03, 0.75)])
def test_a_ball_flies_as_balls_do_and_lies_on_the_palm_that_pushes_it(player, early, restitution):
    """Of a hand that rises 15 cm higher than its ball could."""
    cycle, ball = authored(player, "dribble_right")
    wrong = pulled(player, cycle, ball, 0.15)
    cycle, ball, note = led(player, wrong, ball, early, restitution)
    (way,), step = ball.flights, cycle.reference.timestep
    count, ahead = len(ball.path) - 1, cycle.ahead(player, ball.path)
    path = np.concatenate([ball.path[:-1], ahead[:-1], cycle.ahead(player, ahead)])
    free = path[way.release : way.catch]
    speed, change = np.gradient(free, step, axis=0), np.diff(free, n=2, axis=0) / step**2
    bounce = int(np.argmin(free[:, 2]))
    falls = np.abs(np.arange(1, len(free) - 1) - bounce) > 1
    np.testing.assert_allclose(change[falls][:, 2], -GRAVITY, atol=1e-6)
    np.testing.assert_allclose(change[falls][:, :2], 0.0, atol=1e-6)
    before, behind = speed[bounce - 3], speed[bounce + 3]
    low = player.ball_radius
    impact = np.sqrt(before[2] ** 2 + 2.0 * GRAVITY * (free[bounce - 3, 2] - low))
    back = np.sqrt(behind[2] ** 2 + 2.0 * GRAVITY * (free[bounce + 3, 2] - low))
    assert back / impact == pytest.approx(restitution, abs=1e-6)
    np.testing.assert_allclose(behind[:2], GRIP * before[:2], atol=1e-9)

    hold = np.arange(way.catch, way.release + count)
    force = np.gradient(np.gradient(path, step, axis=0), step, axis=0)[hold] / GRAVITY + [0.0, 0.0, 1.0]
    hands = find_hands(player, cycle.repeat(player, 3))
    assert np.linalg.norm(hands.centre[hold, 1] - path[hold], axis=1).max() < 0.01
    assert ball.touch[hold % count, 1].all() and not ball.touch[way.release : way.catch].any()
    inside = slice(3, -3)
    along = np.sum(force * hands.normal[hold, 1], axis=1)[inside]
    aside = np.linalg.norm(force[inside] - along[:, None] * hands.normal[hold, 1][inside], axis=1)
    pulls = np.maximum(aside - along, 0.0)
    assert pulls.max() < 0.3
    recorded = find_hands(player, wrong.repeat(player, 3))
    rows = hold[inside] + count
    assert recorded.grip[rows, 1].min() < -0.8  # it would have had to pull
    assert "hands led" in note


def test_hands_that_are_right_stay_as_they_are(player):
    cycle, ball = authored(player, "dribble_right")
    found = led(player, cycle, ball, early=0.0, restitution=BOUNCE)
    if found is not None:
        moved = find_hands(player, found[0].reference).centre - find_hands(player, cycle.reference).centre
        assert np.abs(moved).max() < 0.03


@pytest.mark.parametrize("name", sorted(AUTHORED))
def test_whatever_is_told_of_the_ball_hands_stay_whole(player, name):
    """Contacts at random, that no hands were moved for."""
    rng, reference = np.random.default_rng(5), authored_clip(player, name).reference
    hands, frames = find_hands(player, reference), reference.frame_count
    for _ in range(2):
        touch = np.zeros((frames, 2), bool)
        for hand in (0, 1, 0, 1):
            first = rng.integers(0, frames)
            touch[first : first + rng.integers(1, 40), hand] = True
        flights = flights_of(touch)
        ball = Ball(ball_path(hands, touch, flights), touch, (), (), flights)
        once, again = led_once(player, reference, ball), led(player, Cycle.of(player, reference), ball)
        found = [] if once is None else [(once[0].joint_q, once[1])]
        found += [] if again is None else [(again[0].reference.joint_q, again[1])]
        for q, one in found:
            assert np.isfinite(q).all() and np.isfinite(one.path).all()
            turns = q[:, player.coordinates.turn_q]
            np.testing.assert_allclose(np.linalg.norm(turns, axis=-1), 1.0, atol=1e-9)
            assert np.all(one.touch <= touch)


def test_two_hands_that_hold_it_are_left_alone(player):
    assert led(player, *authored(player, "carry")) is None


def test_a_recorded_walk_is_led(player, mocap):
    """The palm of a walking dribble looks sideways where the ball has to be carried up."""
    clip = {"clip": str(mocap / "cmu/06_02.bvh"), "frames": (413, 533), "cyclic": True}
    staged = stage_skill(player, Skill("walk", "walk.toml", **clip), mocap)
    assert any("hands led" in note for note in staged.notes)
