"""The ball of a cycle: it comes back to the hand that has it when the next cycle begins, wherever the cycle
is cut."""

from dataclasses import replace

import numpy as np
import pytest

from warpdribble.sims.ball.hands import find_hands
from warpdribble.sims.model import pose
from warpdribble.sims.reference.reference import Cycle, Reference
from warpdribble.skills import read_skill
from warpdribble.skills.draft import draft
from warpdribble.skills.skill import parse_skill
from warpdribble.skills.staged import cycle_ball, stage_skill

FASTEST = 9.0
"""[m/s] of a ball that is dribbled"""


@pytest.fixture(scope="module")
def dribble(shipped_player):
    return stage_skill(shipped_player, read_skill("dribble-right-authored"))


def rolled(cycle, by):
    """The cycle of somebody who stays in place, cut `by` rows later."""
    rows = cycle.reference.joint_q[:-1]
    rows = np.concatenate([rows[by:], rows[:by], rows[by : by + 1]])
    return replace(cycle, reference=replace(cycle.reference, joint_q=rows))


def well(model, cycle, ball):
    """Whether a ball goes round with its cycle: without a jump, in the hands that have it."""
    path, step = ball.path, cycle.reference.timestep
    np.testing.assert_allclose(cycle.ahead(model, path[:1])[0], path[-1], atol=1e-9)
    np.testing.assert_array_equal(ball.touch[0], ball.touch[-1])
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() < FASTEST * step
    hands = find_hands(model, cycle.reference)
    for hand in (0, 1):
        alone = ball.touch[:, hand] & ~ball.touch[:, 1 - hand]
        off = np.linalg.norm(path - hands.centre[:, hand], axis=1)[alone]
        assert not len(off) or off.max() < 1e-6
    assert all(ball.touch[row % (len(path) - 1)].any() for row in ball.checkpoints)


@pytest.mark.parametrize("by", [0, 9, 23, 40, 61])
def test_it_does_not_matter_where_a_cycle_is_cut(shipped_player, dribble, by):
    """The same ball, as much later; the hand has it once a cycle, flights end in the hand."""
    whole = cycle_ball(shipped_player, dribble.cycle)
    cycle = rolled(dribble.cycle, by)
    ball = cycle_ball(shipped_player, cycle)
    well(shipped_player, cycle, ball)
    count = len(ball.touch) - 1
    np.testing.assert_array_equal(ball.touch[:-1], np.roll(whole.touch[:-1], -by, axis=0))
    np.testing.assert_allclose(ball.path[:-1], np.roll(whole.path[:-1], -by, axis=0), atol=1e-9)
    assert sorted((m + by) % count for m in ball.checkpoints) == sorted(m % count for m in whole.checkpoints)
    (flight,) = ball.flights
    assert ball.touch[(flight.release - 1) % count].any() and ball.touch[flight.catch % count].any()
    assert not ball.touch[np.arange(flight.release, flight.catch) % count].any()


def test_it_bounces_when_the_author_says(shipped_player, dribble):
    """Within 60 ms; the hand lets go within 80 ms."""
    told, wanted = cycle_ball(shipped_player, dribble.cycle), dribble.ball
    assert abs(int(told.path[:-1, 2].argmin()) - int(wanted.path[:-1, 2].argmin())) <= 6
    count = len(wanted.touch) - 1
    lets_go = [int(np.flatnonzero(t[:-1, 1] & ~t[1:, 1])[0]) for t in (told.touch, wanted.touch)]
    assert abs((lets_go[0] - lets_go[1] + count // 2) % count - count // 2) <= 8


def test_it_goes_along(shipped_player):
    """With a player who runs, cycle after cycle."""
    cycle = stage_skill(shipped_player, read_skill("run-dribble-authored")).cycle
    ball = cycle_ball(shipped_player, cycle)
    well(shipped_player, cycle, ball)
    assert np.linalg.norm(ball.path[-1] - ball.path[0]) > 1.0


def test_behind_is_where_what_is_ahead_came_from(shipped_player, dribble):
    cycle, path = replace(dribble.cycle, travel=(0.8, 0.2), turn=0.3), dribble.ball.path
    ahead = cycle.ahead(shipped_player, path)
    np.testing.assert_allclose(cycle.behind(shipped_player, ahead), path, atol=1e-12)


def test_hands_that_play_with_none_have_none(shipped_player):
    still = np.tile(shipped_player.start_q, (80, 1))
    assert cycle_ball(shipped_player, Cycle(Reference(still, shipped_player.timestep))) is None


@pytest.mark.parametrize("written", [False, True])
def test_a_recorded_dribble_is_a_cycle(shipped_player, mocap, monkeypatch, written):
    """06_12's, told from its hands, and as a draft writes it: of 0.73 s it flies for more than 0.35."""
    monkeypatch.setenv("WARPDRIBBLE_DATA", str(mocap))
    skill = read_skill("dribble-right")
    if written:
        skill = parse_skill(draft(shipped_player, mocap / skill.clip, skill.frames), "mine.toml")
        assert skill.cyclic and skill.contact
    staged = stage_skill(shipped_player, skill, mocap)
    well(shipped_player, staged.cycle, staged.ball)
    free = ~staged.ball.touch[:-1].any(axis=1)
    assert 0.35 < 0.01 * free.sum() < 0.5
    low = staged.ball.path[:, 2].min()
    assert low == pytest.approx(shipped_player.ball_radius, abs=0.03)
    hand = pose.forward(shipped_player, staged.reference.joint_q)[:, shipped_player.body("r_hand"), 2]
    assert hand.max() - hand.min() > 0.25
