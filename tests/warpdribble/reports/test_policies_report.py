"""Starts beyond rescue are those from which a ball cannot be kept."""

import pytest

from warpdribble.learning import STAGES, Run
from warpdribble.reports.policies import rescued
from warpdribble.sims import Model


@pytest.fixture(scope="module")
def run():
    return Run.load("dribble-right-authored")


def test_who_has_the_ball_is_rescued_and_who_has_thrown_it_away_is_not(run):
    model = Model.load("player")
    one = run.learned(STAGES, "policy")
    starts = one.starts[[0, 0]]
    speed = model.dof_slice(model.roles.one("ball_joint"))
    place = model.q_slice(model.roles.one("ball_joint")).start
    starts.joint_q[1, place] += 0.6
    starts.joint_qd[1, speed] += 3.0
    assert rescued(one, starts[:1])
    assert not rescued(one, starts[1:])
