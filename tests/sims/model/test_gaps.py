import numpy as np
import pytest
from scipy.spatial.transform import Rotation

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


def test_what_slides_is_the_slowest_point_that_touches(player):
    """A flat foot carried along slides as fast as it goes, one that turns about its heel not at all, and one
    in the air is not said to."""
    foot, rows, h = player.body("l_foot"), 11, 0.01
    body_q = np.tile(player.zero_pose, (rows, 1, 1)).astype(float)
    carried = body_q.copy()
    carried[:, :, 0] += 0.3 * h * np.arange(rows)[:, None]
    own = player.descendants(foot)
    np.testing.assert_allclose(gaps.sliding(player, carried, own, h, 0.003), 0.3, atol=1e-9)
    carried[:, :, 2] += 0.01
    assert np.isnan(gaps.sliding(player, carried, own, h, 0.003)).all()
    box = next(s for s in player.shapes if s.body == foot and s.kind == "box")
    heel = body_q[0, foot, :3] + box.pos + box.size * [-1.0, 1.0, -1.0]
    turned = body_q.copy()
    for row in range(rows):
        by = Rotation.from_euler("z", 0.5 * h * row)
        turned[row, :, :3] = by.apply(body_q[row, :, :3] - heel) + heel
        turned[row, :, 3:] = (by * Rotation.from_quat(body_q[row, :, 3:])).as_quat()
    np.testing.assert_allclose(gaps.sliding(player, turned, [foot], h, 0.003), 0.0, atol=1e-6)
