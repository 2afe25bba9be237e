"""Models that many tests of worlds share; none of them is changed."""

import pytest

from warpdribble.sims import Model


@pytest.fixture(scope="session")
def player():
    return Model.load("player")


@pytest.fixture(scope="session")
def stiff():
    """Stiff hands and no ball: one link carries several bodies."""
    return Model.load("player", rigid=("*_mcp", "*_pip", "*_dip"), without=("ball",))
