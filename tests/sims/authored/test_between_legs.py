"""The dribble between the legs: stance, the ball's way under the player, hands; read off poses alone."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from warpdribble.clips import read_clip
from warpdribble.sims import Model, authored_clip, retargeted
from warpdribble.sims.model import gaps, pose
from warpdribble.sims.model.slots import touch_points
from warpdribble.sims.planar import heading
from warpdribble.sims.signals import runs

STEP = 0.01
LEGS = [f"{side}_{part}" for side in "lr" for part in ("upper_leg", "lower_leg", "foot", "toes")]


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module")
def clip(player):
    return authored_clip(player, "between_legs")


@pytest.fixture(scope="module")
def body_q(player, clip):
    return pose.forward(player, clip.reference.joint_q)


@pytest.fixture(scope="module")
def at(player, body_q):
    """A function from a body's name to its places (frames, 3) [m]."""
    return lambda name: body_q[:, player.body(name), :3]


def test_it_stands_with_the_left_foot_in_front_and_over_both(player, body_q, at):
    apart = at("l_foot").mean(axis=0) - at("r_foot").mean(axis=0)
    assert 0.5 < apart[0] < 0.8 and 0.4 < apart[1] < 0.8
    own, centres = pose.centres_of_mass(player, body_q)
    share = player.body_mass[own] / player.body_mass[own].sum()
    along = (np.einsum("b,fbk->fk", share, centres) - at("r_foot")) @ apart / (apart @ apart)
    assert along.min() > 0.3 and along.max() < 0.8


def test_its_weight_is_on_its_feet_all_the_time(player, body_q):
    """The point about which gravity and accelerations have no moment over the ground, bodies taken as points,
    stays inside the hull of what touches the ground, as a hand lets go too."""
    own, centres = pose.centres_of_mass(player, body_q[:-1])
    mass = player.body_mass[own][None, :, None]
    pull = np.roll(centres, -1, axis=0) - 2.0 * centres + np.roll(centres, 1, axis=0)
    force = mass * (pull / STEP**2 + [0.0, 0.0, 9.81])
    total, moment = force.sum(axis=1), np.cross(centres, force).sum(axis=1)
    point = np.column_stack([-moment[:, 1], moment[:, 0]]) / total[:, 2:]
    feet = [player.body(f"{side}_{part}") for side in "lr" for part in ("foot", "toes")]
    soles = []
    for shape in (shape for shape in player.shapes if shape.body in feet):
        turn = Rotation.from_quat(body_q[:-1, shape.body, 3:])
        soles += [
            body_q[:-1, shape.body, :3] + turn.apply(place) - [0.0, 0.0, radius]
            for place, radius in touch_points(shape)
        ]
    for at, under in zip(point, np.stack(soles, axis=1)):
        sides = ConvexHull(under[under[:, 2] < 0.003, :2]).equations
        assert (sides[:, :2] @ at + sides[:, 2]).max() < -0.004


def test_the_front_foot_lies_flat_and_the_other_is_on_its_toes(player, body_q, at):
    assert np.ptp(at("l_foot"), axis=0).max() < 1e-9
    for side in "lr":
        both = [player.body(f"{side}_foot"), player.body(f"{side}_toes")]
        assert np.abs(gaps.lowest_point(player, body_q, both)).max() < 1e-6
        assert np.nanmax(gaps.sliding(player, body_q, both, STEP, 1e-3)) < 1e-3
    heel = at("r_foot")[:, 2]
    assert heel.min() > 0.07 and 0.01 < np.ptp(heel) < 0.05
    assert np.ptp(at("r_toes"), axis=0).max() < 1e-9


def test_the_ball_goes_through_between_the_legs_and_touches_neither(player, clip, body_q, at):
    """Over the ground, between both feet, and from one side of the line through them to the other; it has
    2 cm of room."""
    path, touch = clip.ball.path, clip.ball.touch
    legs = [player.body(name) for name in LEGS]
    assert gaps.gap_to_bodies(player, body_q, legs, path).min() - player.ball_radius > 0.02
    line = (at("l_foot") - at("r_foot"))[:, :2]
    off = (path - at("r_foot"))[:, :2]
    side = line[:, 0] * off[:, 1] - line[:, 1] * off[:, 0]
    assert side[touch[:, 0]].min() > 0.0 > side[touch[:, 1]].max()
    crossed = np.flatnonzero(np.diff(np.sign(side)))
    assert len(crossed) == 2
    share = np.sum(off * line, axis=1)[crossed] / np.sum(line**2, axis=1)[crossed]
    assert np.all((share > 0.3) & (share < 0.7))
    assert path[crossed, 2].max() < at("pelvis")[:, 2].min() - 0.15


def test_the_ball_falls_bounces_and_is_gripped_by_the_ground(clip):
    path, free = clip.ball.path, ~clip.ball.touch.any(axis=1)
    speed = np.diff(path, axis=0) / STEP
    flights = [span for span in runs(free)]
    assert len(flights) == 2
    for first, last in flights:
        low = first + int(np.argmin(path[first : last + 1, 2]))
        before, after = speed[low - 2], speed[low + 2]
        fall = np.diff(speed[first : low - 2, 2])
        assert np.allclose(fall / STEP, -9.81, atol=1e-6) and len(fall) > 3
        assert np.allclose(after[:2] / before[:2], 0.6, atol=1e-6)
        # where both flights meet the ground, from their heights and speeds a row from the bounce
        impact = np.sqrt((before[2] - 4.905 * STEP) ** 2 + 19.62 * (path[low - 1, 2] - 0.1193))
        back = np.sqrt((after[2] + 4.905 * STEP) ** 2 + 19.62 * (path[low + 2, 2] - 0.1193))
        assert back / impact == pytest.approx(0.8, abs=0.005)


def test_palms_swing_the_ball_from_outside(player, clip, body_q):
    """What a hand adds to gravity, at its most, it gives through its palm or by rubbing, not by pulling."""
    path = clip.ball.path[:-1]
    force = np.roll(path, -1, axis=0) - 2.0 * path + np.roll(path, 1, axis=0)
    force = force / STEP**2 + [0.0, 0.0, 9.81]
    for hand, name in enumerate(("l_palm", "r_palm")):
        body, _, turn = player.sites[name]
        normal = (Rotation.from_quat(body_q[:-1, body, 3:]) * Rotation.from_quat(turn)).apply([0, 0, 1])
        touch = clip.ball.touch[:-1, hand]
        inside = touch & np.roll(touch, 1) & np.roll(touch, -1)
        pressed = np.sum(force * normal, axis=1)[inside]
        assert pressed.min() > 2.0
        assert (pressed / np.linalg.norm(force[inside], axis=1)).min() > 0.65
        outward = normal[:, 1] * (1.0 if hand == 0 else -1.0)
        assert outward[touch].max() < -0.3


def test_the_trunk_turns_to_the_ball_and_sinks_as_it_bounces(player, clip, body_q, at):
    yaw = np.degrees(heading(body_q[:, player.body("lower_back"), 3:]))
    left, right = (int(np.argmax(np.where(clip.ball.touch[:, hand], at("ball")[:, 2], 0))) for hand in (0, 1))
    assert yaw[left] > yaw[right] + 20.0
    height, free = at("pelvis")[:, 2], ~clip.ball.touch.any(axis=1)
    assert height[free].mean() < height[~free].mean() - 0.01
    assert 0.04 < np.ptp(height) < 0.1


def test_pelvis_and_hands_are_where_a_recorded_player_has_them(player, mocap, at):
    """BallPlay-M's 044 lleg_2, which stands lower and wider: within a hand's breadth or two of it."""
    motion = read_clip(mocap / "ballplay_m" / "044_006pickle_lleg_2.pt")[0]
    recorded = pose.forward(player, retargeted(player, motion).reference.joint_q)[90:236]
    back = Rotation.from_rotvec([0.0, 0.0, -np.mean(heading(recorded[:, 0, 3:]))])
    for side in "lr":
        hand = recorded[:, player.body(f"{side}_hand"), :3] - recorded[:, 0, :3]
        theirs, ours = back.apply(hand), at(f"{side}_hand") - at("pelvis")
        for pick in (np.min, np.mean, np.max):
            assert pick(ours, axis=0) == pytest.approx(pick(theirs, axis=0), abs=0.2)
    assert at("pelvis")[:, 2].mean() == pytest.approx(recorded[:, 0, 2].mean(), abs=0.06)
