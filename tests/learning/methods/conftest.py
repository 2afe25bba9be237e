"""What learners of arm policies start from, without a search for it."""

from dataclasses import replace

import numpy as np
import pytest

from warpdribble.learning import STAGES, Run
from warpdribble.learning.ball.optimised import Optimised
from warpdribble.learning.choose import Ahead
from warpdribble.learning.rollout import Rollout
from warpdribble.learning.runs.folder import read_result
from warpdribble.learning.runs.stage import Context
from warpdribble.skills import read_skill, skill_graph

SKILL = "dribble-right-authored"


@pytest.fixture(scope="session")
def dribbled():
    """A context without parameters, of the shipped dribble; in place of what trajectory optimisation finds,
    two cycles that the shipped policy goes through."""
    run = Run.load(SKILL)
    one = run.learned(STAGES, "policy")
    task = one.task(1)
    start = one.starts[:1]
    rollout = Rollout(task, one.controller, Ahead(), start)
    rows = {name: [] for name in ("k", "action", "joint_q", "joint_qd", "fingers")}
    before = (start.joint_q[0], start.joint_qd[0])
    for fragment in rollout.fragments(28):
        rows["k"].append(fragment.k[0])
        rows["action"].append(fragment.action[0])
        rows["joint_q"].append(before[0])
        rows["joint_qd"].append(before[1])
        rows["fingers"].append(task.fingers[0])
        before = (np.array(task.sim.joint_q[0]), np.array(task.sim.joint_qd[0]))
        assert not fragment.failed.any()
    found = Optimised(**{name: np.array(values) for name, values in rows.items()})
    needs = {"locomotion": read_result(run.folder / "locomotion"), "ball": found.result}
    return Context(skill_graph(read_skill(SKILL))[0], None, seed=3, needs=needs)


@pytest.fixture(scope="module")
def context(request, dribbled):
    """With the parameters SMALL of the test's module."""
    return replace(dribbled, config=request.module.SMALL)


@pytest.fixture(scope="module")
def learned(request, context):
    """A learner at its end, made by the module's MAKE, and what it said."""
    one = request.module.MAKE(context)
    reports = []
    while not one.done:
        reports.append(one.iterate())
    return one, reports
