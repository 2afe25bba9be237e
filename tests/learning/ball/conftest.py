"""The authored dribble with its ball, on the legs that ship."""

import pytest

from warpdribble.learning import STAGES, Run
from warpdribble.learning.methods.ball import BallConfig, make
from warpdribble.learning.runs.folder import read_result
from warpdribble.learning.runs.stage import Context
from warpdribble.sims import Model
from warpdribble.skills import read_skill, skill_graph

SKILL = "dribble-right-authored"


@pytest.fixture(scope="session")
def full():
    return Model.load("player")


@pytest.fixture(scope="session")
def dribbled():
    """Its control graph, 14 fragments, of which the last of fragment 10 is the checkpoint."""
    return skill_graph(read_skill(SKILL))[0]


@pytest.fixture(scope="session")
def needs():
    """What the legs learned."""
    return {"locomotion": read_result(Run.load(SKILL).folder / "locomotion")}


@pytest.fixture(scope="session")
def legs():
    return Run.load(SKILL).learned(STAGES, "locomotion").controller


@pytest.fixture(scope="session")
def cycles():
    """that `learner` finds"""
    return 3


@pytest.fixture(scope="session")
def learner(dribbled, needs, cycles):
    """Gauss-Newton steps that have found cycles of it, the states after each, and the reports."""
    context = Context(dribbled, BallConfig(method="newton", cycles=cycles), needs=needs)
    learner, states, reports = make(context), [], []
    while not learner.done:
        reports.append(learner.iterate())
        states.append(learner.state)
    return learner, states, reports
