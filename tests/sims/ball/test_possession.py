"""Who has the ball, told from hands whose motion is written here, and from authored clips, whose ball is
known: nothing was chosen on either."""

import numpy as np
import pytest

from warpdribble.clips.read import read_clip
from warpdribble.sims import Model
from warpdribble.sims.authored.catalogue import authored_clip
from warpdribble.sims.ball.ball import inferred_ball
from warpdribble.sims.ball.contact_score import score_contacts
from warpdribble.sims.ball.hands import Hands, find_hands
from warpdribble.sims.ball.possession import infer
from warpdribble.sims.reference.reference import Cycle, Reference
from warpdribble.sims.retarget.retarget import retargeted

R, STEP = 0.1193, 0.01
INWARD = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def hands(palms, normal=INWARD, body=(0.0, 0.0, 0.0)):
    """Hands from the places of both palms (frames, 2, 3) [m] and where these look."""
    normal = np.broadcast_to(normal, palms.shape).astype(float)
    centre = palms + R * normal
    velocity = np.gradient(centre, STEP, axis=0)
    shoulder = np.full(palms.shape[:2], 1.45)
    return Hands(centre, velocity, normal, shoulder, np.tile(body, (len(palms), 1)), R, STEP)


def held(apart, seconds=2.0):
    """Palms that look at each other, `apart` [m], and go up, down and about together."""
    time = np.arange(round(seconds / STEP))[:, None] * STEP
    middle = np.hstack([0.3 + 0.1 * np.sin(3 * time), 0 * time, 1.1 + 0.15 * np.sin(4 * time)])
    return np.stack([middle + [0, apart / 2, 0], middle - [0, apart / 2, 0]], axis=1)


@pytest.mark.parametrize("apart", [0.24, 0.28, 0.34])
def test_a_held_ball_counts_for_both(apart):
    assert infer(hands(held(apart))).touch.all()


@pytest.mark.parametrize("apart", [0.1, 0.6])
def test_hands_between_which_no_ball_fits_hold_none(apart):
    """Folded, or farther apart."""
    assert not infer(hands(held(apart))).touch.any()


def test_hands_that_pass_each_other_hold_none():
    """A runner's: a ball apart at times, but never for long."""
    time = np.arange(300) * STEP
    swing = 0.35 * np.sin(2 * np.pi * 1.4 * time)
    palms = np.zeros((300, 2, 3))
    for hand, side in enumerate((1, -1)):
        palms[:, hand] = np.stack([side * swing, 0 * time + side * 0.16, 1.05 + abs(swing)], axis=1)
    assert not infer(hands(palms)).touch.any()


def test_a_ball_is_measured_with_the_person_who_moved(player):
    """A child's hands hold the same ball, though the player's that do as much are farther apart."""
    clip = authored_clip(player, "carry")
    own = find_hands(player, clip.reference)
    child = find_hands(player, clip.reference, scale=1.5)
    np.testing.assert_allclose(child.palms, own.palms / 1.5, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(child.centre - child.palms, axis=2), R)
    assert infer(own).touch.all()


def test_a_resting_ball_lies_on_the_palm_with_its_weight():
    still = held(0.24) * 0 + [0.3, 0.0, 1.0]
    up = hands(still, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(up.grip, 1.0)
    np.testing.assert_allclose(hands(still, [0.0, 0.0, -1.0]).grip, -1.0)
    fall = still.copy()
    fall[..., 2] = 5.0 - 0.5 * 9.81 * (np.arange(len(still)) * STEP)[:, None] ** 2
    assert np.abs(hands(fall, [0.0, 0.0, 1.0]).grip[20:-20]).max() < 0.01


@pytest.mark.parametrize("name", ["carry", "dribble_right", "switch_hands"])
def test_hands_of_authored_clips(player, name):
    """Each hand for itself, within the reach of the fingers: they hold on longer than the authored palm."""
    clip = authored_clip(player, name)
    ball = inferred_ball(player, Cycle(clip.reference).repeat(player, 4))
    true = np.concatenate([np.tile(clip.ball.touch[:-1], (4, 1)), clip.ball.touch[-1:]])
    for hand in (0, 1):
        score = score_contacts(ball.touch[:, hand], true[:, hand], player.timestep)
        assert score.recall == 1.0 and score.missed == 0
        assert ball.touch[:, hand].any() == true[:, hand].any()
    if name == "switch_hands":
        assert all(flight.hand != flight.next_hand for flight in ball.flights)
    assert len(ball.flights) == {"carry": 0, "dribble_right": 4, "switch_hands": 8}[name]


def test_a_player_who_stands_has_no_ball(player):
    rows = np.tile(player.start_q, (200, 1))
    assert inferred_ball(player, Reference(rows, player.timestep)) is None


@pytest.mark.parametrize("name", ["02_01", "02_03", "06_01", "07_01", "08_01", "09_01", "09_11", "09_12"])
def test_walks_and_runs_have_no_ball(player, mocap, name):
    result = retargeted(player, read_clip(mocap / "cmu" / f"{name}.bvh")[0])
    assert inferred_ball(player, result.reference, result.scale) is None


def test_a_crossover_while_walking(player, mocap):
    """CMU 06_12, as read off its pictures: from the right hand to the left at 1.2 s, and back at 1.9 s."""
    motion, _ = read_clip(mocap / "cmu" / "06_12.bvh")
    result = retargeted(player, motion)
    ball = inferred_ball(player, result.reference, result.scale)
    over = [f for f in ball.flights if f.hand != f.next_hand]
    assert [f.hand for f in over] == [1, 0]
    assert [f.release * player.timestep for f in over] == pytest.approx([1.2, 1.95], abs=0.15)
