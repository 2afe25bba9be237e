import pytest

from warpdribble.sims import Model
from warpdribble.sims.model import gaps


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def test_soles_of_the_zero_pose_stand_on_the_ground(player):
    body_q = player.zero_pose[None]
    feet = [player.body(name) for name in ("l_foot", "l_toes", "r_foot", "r_toes")]
    assert gaps.lowest_point(player, body_q, feet) == pytest.approx(0.0, abs=2e-3)


def test_gap_to_a_hand_follows_the_point(player):
    body_q = player.zero_pose[None]
    hand = player.body("r_hand")
    box = next(s for s in player.shapes if s.body == hand)
    palm = body_q[:, hand, :3] + box.pos
    for depth in (0.05, 0.2):
        below = palm - [0.0, 0.0, box.size[2] + depth]
        assert gaps.gap_to_bodies(player, body_q, [hand], below) == pytest.approx(depth)
    assert gaps.gap_to_bodies(player, body_q, [hand], palm) < 0.0
