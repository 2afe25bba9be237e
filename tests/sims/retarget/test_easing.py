"""Against dense least squares, and functions whose third differences are known."""

import numpy as np
import pytest

from warpdribble.sims.retarget.easing import eased


def dense(wanted, like, stays, span):
    """The same by the normal equations in full, jerks of `like` everywhere."""
    third = np.diff(np.eye(len(wanted)), 3, axis=0)
    weight = np.diag(np.where(stays, 1e12, 1.0))
    left = weight + span**6 * third.T @ third
    return np.linalg.solve(left, weight @ wanted + span**6 * third.T @ third @ like)


def test_it_is_the_least_of_its_sum():
    random = np.random.default_rng(0)
    wanted, like = random.normal(size=(2, 60, 2))
    free = np.zeros(60, bool)
    assert eased(wanted, like, free, 3.0) == pytest.approx(dense(wanted, like, free, 3.0), abs=1e-8)
    stays = np.arange(60) < 20
    still = 0.0 * like
    assert eased(wanted, still, stays, 3.0) == pytest.approx(dense(wanted, still, stays, 3.0), abs=1e-6)


def test_rows_that_stay_do_and_others_keep_what_they_are_like():
    times = np.arange(200.0)[:, None]
    like = np.sin(times / 3.0)
    stays = (times[:, 0] < 50) | (times[:, 0] > 150)
    wanted = np.where(stays[:, None], 2.0, like)
    out = eased(wanted, like, stays, 2.0)
    assert np.array_equal(out[stays], wanted[stays])
    assert out[75:125] == pytest.approx(like[75:125], abs=5e-3)
    assert np.abs(np.diff(out, 2, axis=0)).max() < 0.5 * np.abs(np.diff(wanted, 2, axis=0)).max()


@pytest.mark.parametrize("rows", [1, 3, 4, 5])
def test_few_rows(rows):
    wanted = np.arange(rows, dtype=float)[:, None] ** 2
    for stays in (np.zeros(rows, bool), np.ones(rows, bool), np.arange(rows) == 0):
        assert eased(wanted, wanted, stays, 2.0)[0] == pytest.approx(wanted[0], abs=1e-9)
