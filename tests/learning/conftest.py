"""The authored dribble as a control graph, and motions made of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.learning.graph import cyclic_graph
from warpdribble.learning.tasks.locomotion import Locomotion, locomotion_model
from warpdribble.sims import Model
from warpdribble.sims.authored.catalogue import authored_clip
from warpdribble.sims.reference.reference import Cycle, Reference


@pytest.fixture(scope="session")
def player():
    return locomotion_model()


@pytest.fixture(scope="session")
def full():
    """The whole player with the ball."""
    return Model.load("player")


@pytest.fixture(scope="session")
def dribble(player, full):
    """A cycle of 70 steps in place, the ball left out."""
    reference = authored_clip(full, "dribble_right").reference
    return Cycle(replace(reference, joint_q=player.convert_q(full, reference.joint_q)))


@pytest.fixture(scope="session")
def graph(player, dribble):
    return cyclic_graph(player, dribble, player.roles.both("feet"), "dribble")


@pytest.fixture(scope="session")
def standing(player):
    """A graph of a pose held."""
    still = Reference(np.tile(player.start_q, (26, 1)), player.timestep)
    return cyclic_graph(player, Cycle(still), player.roles.both("feet"))


@pytest.fixture
def task(player, graph):
    """A function that makes worlds for the dribble."""
    return lambda worlds, **how: Locomotion(player, how.pop("graph", graph), worlds, **how)


@pytest.fixture(scope="session")
def curve(dribble):
    """The dribble carried along a curve: from (1, -2) and 0.3 rad, 0.8 m ahead and 0.2 m to the left while
    it turns by 0.6 rad."""
    turn, ahead, heading, start = 0.6, np.array([0.8, 0.2]), 0.3, np.array([1.0, -2.0])
    joint_q = np.array(dribble.reference.joint_q)
    share = np.linspace(0.0, 1.0, len(joint_q))
    turned = Rotation.from_euler("z", (heading + turn * share)[:, None])
    own = joint_q[:, :3] - joint_q[0, :3] * [1, 1, 0]
    joint_q[:, :3] = turned.apply(own)
    joint_q[:, :2] += start + share[:, None] * (Rotation.from_euler("z", heading).as_matrix()[:2, :2] @ ahead)
    joint_q[:, 3:7] = (turned * Rotation.from_quat(joint_q[:, 3:7])).as_quat()
    travel = joint_q[-1, :2] - joint_q[0, :2]
    return Cycle(Reference(joint_q, dribble.reference.timestep), turn, tuple(travel))
