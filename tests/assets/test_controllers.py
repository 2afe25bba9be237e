"""Shipped controllers do what docs/locomotion.md says of them."""

import numpy as np
import pytest

from warpdribble.learning.evaluate.pushes import push_survival
from warpdribble.learning.evaluate.trials import run_trials
from warpdribble.learning.runs.folder import Run, shipped_controllers
from warpdribble.learning.tasks.disturbance import Disturbance


@pytest.mark.parametrize("name", shipped_controllers())
def test_it_stands_where_the_open_loop_falls(name):
    """20 cycles from recorded states, arms and hands disturbed, with pushes that few survive without it."""
    run = Run.load(name)
    task = run.task(64)
    pushed = Disturbance(push=150.0, push_every=2.0, arms=0.2, hands=18.0)
    trials = run_trials(task, run.policy, run.states, 20, 3, 0.15, pushed)
    assert trials.survived.all()
    blind = task.open_loop()
    assert run_trials(task, blind, run.states, 20, 3, 0.15, pushed).survived.mean() < 0.5


@pytest.mark.parametrize("name", shipped_controllers())
def test_it_stands_the_pushes_of_the_paper(name):
    """200 N for 0.2 s, from any side (P1 8)."""
    run = Run.load(name)
    assert np.min(push_survival(run.task(256), run.policy, run.states, 200.0)) >= 0.95


def test_it_is_not_far_from_its_reference():
    run = Run.load("dribble-right-authored")
    trials = run_trials(run.task(16), run.policy, run.states, 5)
    assert np.degrees(trials.angle_error) < 1.0  # per joint of legs and trunk
    assert trials.end_error < 0.01 and trials.drift < 0.01
