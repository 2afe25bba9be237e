"""The authored dribble with its ball, on the legs that ship."""

import pytest

from warpdribble.learning import STAGES, Run
from warpdribble.learning.runs.folder import read_result
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
