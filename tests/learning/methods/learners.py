"""What tests ask of any learner."""

import time

import numpy as np


def delayed(one, monkeypatch, seconds):
    """A learner whose simulation is slower by so much."""
    simulate = one._simulate

    def late(*args):
        time.sleep(seconds)
        return simulate(*args)

    monkeypatch.setattr(one, "_simulate", late)
    return one


def ended(one):
    """A learner, at its end."""
    while not one.done:
        one.iterate()
    return one


def same(one, other):
    """Whether two learners are the same to the bit."""
    for name, value in one.state.items():
        np.testing.assert_array_equal(other.state[name], value, err_msg=name)
