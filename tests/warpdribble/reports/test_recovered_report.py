"""Recovered balls: what is compared, against paths made by hand; recorded balls that move as a ball can, and
that do not, against the flights that they were made of."""

from types import SimpleNamespace

import numpy as np
import pytest

from warpdribble.learning.graph import ControlGraph
from warpdribble.reports.recorded import Physics, physics
from warpdribble.reports.recovered import LATE, WHOLE, Recovered, apexes, compared, fewer, table
from warpdribble.sims.ball.ball import Ball

RADIUS, STEP = 0.12, 0.01


def dribbled(height=0.9, e=0.8, g=9.81, rate=100.0, hold=20, bounces=2, push=2.0):
    """Heights of a ball that a hand holds, pushes down at `push` [m/s], and has again where it comes to rest,
    and when it is held."""
    z, held = [height] * hold, [True] * hold
    for _ in range(bounces):
        start = z[-1]
        down = (np.sqrt(push**2 + 2 * g * (start - RADIUS)) - push) / g
        up = e * (push + g * down)
        t = np.arange(1, int(rate * (down + up / g)) + 1) / rate
        after = t - down
        z += np.where(
            after < 0, start - push * t - g * t**2 / 2, RADIUS + up * after - g * after**2 / 2
        ).tolist()
        held += [False] * len(t)
        z, held = z + [z[-1]] * hold, held + [True] * hold
    return np.array(z), np.array(held)


@pytest.mark.parametrize(("e", "g"), [(0.8, 9.81), (0.5, 9.81), (0.8, 5.0)])
@pytest.mark.parametrize("rate", [60.0, 120.0])
def test_physics_are_those_of_the_flights(e, g, rate):
    z, held = dribbled(e=e, g=g, rate=rate)
    seen = physics(np.stack([0 * z, 0 * z, z], axis=1), held, rate)
    assert seen.fall == pytest.approx(g, rel=1e-6)
    assert seen.e == pytest.approx(e, abs=0.02)
    assert seen.possible == (e == 0.8 and g == 9.81)


def test_who_never_flies_is_not_doubted():
    seen = physics(np.ones((9, 3)), np.ones(9, bool), 60.0)
    assert np.isnan(seen.e) and np.isnan(seen.fall) and seen.possible
    assert not Physics(0.4, np.nan).possible


@pytest.fixture
def ball():
    z, held = dribbled()
    x = np.linspace(0.0, 1.0, len(z))
    return Ball(np.stack([x, 0 * x, z], axis=1), np.stack([0 * held, held], axis=1).astype(bool), (), ())


MODEL = SimpleNamespace(ball_radius=RADIUS, timestep=STEP)


def test_differences_are_those_that_were_made(ball):
    """Three rows late, 4 cm higher in the hand, 5 cm aside, from row 10 on."""
    seen = np.roll(ball.path, 3, axis=0)[10:] + [0.0, 0.05, 0.0]
    seen[:, 0] = ball.path[10:, 0]
    seen[seen[:, 2] > 0.4, 2] += 0.04
    found = compared(seen, ball, 10, MODEL)
    assert (found["recorded"], found["found"]) == (2, 2)
    assert found["time"] == pytest.approx(30.0) and found["apex"] == pytest.approx(4.0, abs=0.3)
    assert found["path"] == pytest.approx(5.0)


def test_a_ball_that_is_lost_early_has_fewer_bounces_and_no_apex_that_is_to_come(ball):
    (first, _), _ = apexes(ball.path[:, 2], ball.touch, RADIUS)
    found = compared(ball.path[:first], ball, 0, MODEL)
    assert (found["recorded"], found["found"], found["time"]) == (2, 1, 0.0)
    assert np.isnan(found["apex"])
    assert compared(ball.path[: first + 40], ball, 0, MODEL)["apex"] == pytest.approx(0.0)


def test_apexes_are_of_contacts_after_a_bounce(ball):
    spans = apexes(ball.path[:, 2], ball.touch, RADIUS)
    assert len(spans) == 2 and all(ball.touch[a : b + 1].any(axis=1).all() for a, b in spans)
    assert spans[0][0] > 20


def test_the_table_has_failures_and_medians_of_what_is_known():
    rows = [
        Recovered("a", WHOLE, 10.0, 1.0, 2, 2, 10.0, 2.0, 8.0, 1.0, 0.8, 9.8),
        Recovered("b", LATE, 30.0, 0.4, 2, 1, 30.0, np.nan, 4.0, 1.0, 0.8, 4.0),
        Recovered("c", "no ball inferred", 0.0, recorded=1),
    ]
    lines = table(rows).splitlines()
    assert "| a | 100 | 2 of 2 | 10 | 2.0 | 8.0 | 1.0 | 10 | whole | 0.80 | 9.80 |" in lines
    assert "| b (*) | 40 | 1 of 2 | 30 | - | 4.0 | 1.0 | 30 | time | 0.80 | 4.00 |" in lines
    assert "| c | 0 | 0 of 1 | - | - | - | - | 0 | no ball inferred | - | - |" in lines
    assert any(line.startswith("| median of 3, all | 40 | 3 of 5 | 20 | 2.0 | 6.0 |") for line in lines)
    assert any(line.startswith("| median of 1, found to the end | 100 | 2 of 2 | 10 |") for line in lines)
    assert any(line.startswith("| median of 2, as a ball can move | 50 | 2 of 3 |") for line in lines)
    assert "as a ball can move" not in table(rows[:1])


def test_fewer_frames_are_round_the_middle_of_contacts():
    touch, still = np.zeros((100, 2), bool), np.zeros((20, 1))
    touch[10:30, 0], touch[50:90, 1] = True, True
    edges = np.stack([np.arange(20), np.minimum(np.arange(1, 21), 19)], axis=1)
    marks = np.array([12, 70])
    graph = ControlGraph(still, *[still] * 4, edges, STEP, touch=touch, checkpoints=marks)
    less = fewer(graph, 0.5).touch
    assert np.flatnonzero(less[:, 0]).tolist() == [12, *range(15, 25)]
    assert np.flatnonzero(less[:, 1]).tolist() == list(range(60, 80))
    np.testing.assert_array_equal(fewer(graph, 1.0).touch, touch)
