"""Starts beyond rescue are those from which a ball cannot be kept."""

import numpy as np
import pytest

from warpdribble.learning import STAGES, Run
from warpdribble.learning.starts import Starts
from warpdribble.reports.policies import rescued
from warpdribble.sims import Model


@pytest.fixture(scope="module")
def run():
    return Run.load("dribble-right-authored")


def test_who_has_the_ball_is_rescued_and_who_has_thrown_it_away_is_not(run):
    model = Model.load("player")
    own = run.learned(STAGES, "policy").starts
    starts = Starts(*(np.array(part[:2]) for part in vars(own).values()))
    speed = model.dof_slice(model.roles.one("ball_joint"))
    place = model.q_slice(model.roles.one("ball_joint")).start
    starts.joint_q[1, place] += 0.6
    starts.joint_qd[1, speed] += 3.0
    assert rescued(run, starts, 0)
    assert not rescued(run, starts, 1)
