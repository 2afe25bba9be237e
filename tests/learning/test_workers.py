"""Workers: results in the jobs' order whoever is done first, errors, and shares as equal as can be."""

import threading
import time

import pytest

from warpdribble.learning.workers import Workers, shares


@pytest.mark.parametrize("count", [1, 2, 4])
def test_results_come_in_the_jobs_order(count):
    def job(wait, name):
        time.sleep(wait)
        return name

    jobs = [(0.03, "a"), (0.0, "b"), (0.02, "c"), (0.0, "d"), (0.01, "e")]
    assert Workers(count).each(job, jobs) == list("abcde")
    assert Workers(count).each(job, []) == []


def test_so_many_are_at_work_at_once():
    both = threading.Barrier(2, timeout=10.0)
    assert sorted(Workers(2).each(lambda: both.wait(), [(), ()])) == [0, 1]


@pytest.mark.parametrize("count", [1, 3])
def test_what_goes_wrong_is_raised(count):
    def job(number):
        if number == 1:
            raise ZeroDivisionError("one")
        return number

    workers = Workers(count)
    with pytest.raises(ZeroDivisionError, match="one"):
        workers.each(job, [(0,), (1,), (2,)])
    assert workers.each(job, [(0,), (2,)]) == [0, 2]


@pytest.mark.parametrize(("count", "workers"), [(16, 4), (5, 2), (3, 3), (7, 4), (1, 1)])
def test_shares_are_as_equal_as_can_be(count, workers):
    found = shares(count, workers)
    assert sum(found) == count and len(found) == workers
    assert max(found) - min(found) <= 1 and found == sorted(found, reverse=True)
