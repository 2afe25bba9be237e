"""Shipped controllers do what docs/locomotion.md and docs/policies.md say of them."""

import numpy as np
import pytest

from warpdribble.learning.evaluate.pushes import push_survival
from warpdribble.learning.evaluate.trials import run_trials
from warpdribble.learning.methods import STAGES
from warpdribble.learning.runs.folder import Run, shipped_controllers
from warpdribble.learning.tasks.disturbance import Disturbance
from warpdribble.learning.tasks.follow import OpenLoop


@pytest.mark.parametrize("name", shipped_controllers())
def test_it_stands_where_the_open_loop_falls(name):
    """20 cycles from recorded states, arms and hands disturbed, with pushes that few survive without it."""
    one = Run.load(name).learned(STAGES, "locomotion")
    task = one.task(64)
    pushed = Disturbance(push=150.0, push_every=2.0, arms=0.2, hands=18.0)
    trials = run_trials(task, one.controller, one.starts, 20, 3, 0.15, pushed)
    assert trials.survived.all()
    blind = OpenLoop(task.actions)
    assert run_trials(task, blind, one.starts, 20, 3, 0.15, pushed).survived.mean() < 0.5


@pytest.mark.parametrize("name", shipped_controllers())
def test_it_stands_the_pushes_of_the_paper(name):
    """200 N for 0.2 s, from any side (P1 8)."""
    one = Run.load(name).learned(STAGES, "locomotion")
    assert np.min(push_survival(one.task(256), one.controller, one.starts, 200.0)) >= 0.95


def test_it_is_not_far_from_its_reference():
    one = Run.load("dribble-right-authored").learned(STAGES, "locomotion")
    trials = run_trials(one.task(16), one.controller, one.starts, 5)
    assert np.degrees(trials.angle_error) < 1.0  # per joint of legs and trunk
    assert trials.end_error < 0.015 and trials.drift < 0.01 and np.degrees(trials.astray) < 10.0


@pytest.mark.parametrize("name", shipped_controllers())
def test_it_keeps_the_ball_where_the_targets_alone_lose_it(name):
    """For 30 s from states on its way; without it nobody does for two cycles."""
    one = Run.load(name).learned(STAGES, "policy")
    task = one.task(32)
    cycles = 30.0 / (task.graph.cycle * task.graph.period)
    trials = run_trials(task, one.controller, one.starts, cycles, 3)
    assert trials.survived.all()
    blind = run_trials(task, OpenLoop(task.actions), one.starts, 2, 3)
    assert not blind.survived.any()


@pytest.mark.parametrize("name", shipped_controllers())
def test_it_stands_disturbed_starts_and_pushes(name):
    """Most that start with joint speed noise of 0.1 rad/s (root and ball: m/s) and are pushed with up
    to 100 N every 3 s keep the ball for 15 s."""
    one = Run.load(name).learned(STAGES, "policy")
    task = one.task(64)
    cycles = 15.0 / (task.graph.cycle * task.graph.period)
    trials = run_trials(task, one.controller, one.starts, cycles, 4, 0.1, Disturbance(push=100.0))
    assert trials.survived.mean() > 0.7
