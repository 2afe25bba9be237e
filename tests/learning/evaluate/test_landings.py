"""Ground forces of a player against its weight and against Newton's law."""

import numpy as np
import pytest

from warpdribble.learning.evaluate.landings import Landings, land
from warpdribble.learning.starts import reference_starts
from warpdribble.learning.tasks.follow import OpenLoop


def test_a_standing_player_weighs_what_it_weighs(task, standing):
    """Over time; and neither foot leaves the ground."""
    one = task(1, graph=standing)
    seen = land(one, OpenLoop(one.actions), reference_starts(standing), 80)
    assert seen.force.shape == (200, 2)
    assert seen.force.sum(axis=1).mean() == pytest.approx(1.0, abs=0.02)
    assert seen.peak < 1.3 and not seen.touchdowns.any()


def test_touchdowns_are_counted():
    force = np.array([[0.0, 1.0], [0.6, 0.0], [0.0, 0.5], [0.01, 0.0], [0.8, 0.4]])
    seen = Landings(force, 0.01)
    assert seen.touchdowns.tolist() == [2, 2]
    assert seen.peak == pytest.approx(np.quantile([1.0, 0.6, 0.5, 0.01, 1.2], 0.99))
