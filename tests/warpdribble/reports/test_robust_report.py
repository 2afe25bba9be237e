"""What policies stand: senses that are late and noisy, and what the ball can touch."""

import numpy as np

from warpdribble.reports.robust import Senses, pairs
from warpdribble.sims import Model


class Echo:
    """Does what it feels."""

    def act(self, s, k):
        return s


def test_senses_are_late():
    """By so many fragments; what came first until then."""
    one, seen = Senses(Echo(), late=2), []
    for t in range(6):
        seen.append(float(one.act(np.full((3, 2), float(t)), np.zeros(3, int))[0, 0]))
    assert seen == [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]


def test_senses_are_noisy():
    got = Senses(Echo(), noise=0.3).act(np.ones((20000, 4)), np.zeros(20000, int))
    np.testing.assert_allclose(got.mean(), 1.0, atol=0.01)
    np.testing.assert_allclose(got.std(axis=0), 0.3, rtol=0.03)
    exact = np.arange(6.0).reshape(3, 2)
    np.testing.assert_array_equal(Senses(Echo()).act(exact, np.zeros(3, int)), exact)


def test_all_that_the_ball_touches():
    model = Model.load("player")
    lines = pairs(model).splitlines()[2:]
    assert lines == ["| ground | 1 | 0.80 | 0.80 |", "| player | 57 | 0.00 | 0.80 |"]
