import numpy as np
import pytest

from warpdribble.sims import Model
from warpdribble.sims.model import pose
from warpdribble.sims.reference.mirror import mirrored, partner
from warpdribble.sims.reference.reference import Reference, integrate


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module")
def wild(player):
    """Rows with every joint turned."""
    motion = 0.4 * np.random.default_rng(0).normal(size=(6, player.nv))
    return Reference(integrate(player, np.tile(player.start_q, (6, 1)), motion), player.timestep)


def test_the_mirror_of_the_mirror_is_the_reference(player, wild):
    assert np.allclose(mirrored(player, mirrored(player, wild)).joint_q, wild.joint_q, atol=1e-12)
    assert not np.allclose(mirrored(player, wild).joint_q, wild.joint_q)


def test_every_body_is_where_the_mirror_shows_it(player, wild):
    ours = pose.forward(player, wild.joint_q)
    theirs = pose.forward(player, mirrored(player, wild).joint_q)
    for body, name in enumerate(player.body_names):
        other = player.body(partner_body(name))
        assert np.allclose(theirs[:, other, :3], ours[:, body, :3] * [1.0, -1.0, 1.0], atol=1e-9), name


def partner_body(name):
    swap = {"l_": "r_", "r_": "l_"}
    return swap[name[:2]] + name[2:] if name[:2] in swap else name


def test_a_joint_without_a_partner_is_named(player):
    class Lame:
        joint_names = ("l_knee",)

    assert partner(player, "neck") == "neck" and partner(player, "l_knee") == "r_knee"
    with pytest.raises(ValueError, match="'l_knee' has no partner 'r_knee'"):
        partner(Lame, "l_knee")
