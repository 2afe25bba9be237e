import numpy as np
import pytest

from warpdribble.clips.read import read_clip
from warpdribble.sims.retarget.cycles import find_cycles


def same(candidate, first, last, slack):
    """The same cycle, perhaps begun earlier or later."""
    alike = abs(candidate.last - candidate.first - (last - first)) < slack
    return alike and min(candidate.last, last) - max(candidate.first, first) > 0.6 * (last - first)


@pytest.mark.parametrize(
    ("clip", "first", "last", "gap"),
    [
        ("cmu/06_12.bvh", 597, 684, 3.3),
        ("cmu/06_01.bvh", 129, 271, 1.5),
        ("cmu/06_03.bvh", 380, 507, 2.9),
        ("cmu/09_01.bvh", 3, 91, 2.0),
        ("ballplay_m/044_006pickle_lleg_2.pt", 54, 142, 4.3),
        ("ballplay_m/041_018pickle_pick2back_7.pt", 128, 212, 4.6),
    ],
)
def test_known_cycles_are_among_the_best(mocap, clip, first, last, gap):
    motion, _ = read_clip(mocap / clip)
    found = [c for c in find_cycles(motion)[:3] if same(c, first, last, 0.1 * motion.rate)]
    assert found
    assert 100.0 * found[0].pose_gap == pytest.approx(gap, abs=1.5)


def test_travel_and_turn_are_said(mocap):
    motion, _ = read_clip(mocap / "cmu" / "06_01.bvh")
    one = find_cycles(motion)[0]
    assert one.travel == pytest.approx(1.04 * one.duration, rel=0.1)
    assert abs(one.turn) < np.radians(10.0)


def test_standing_still_is_no_cycle(mocap):
    from dataclasses import replace

    motion, _ = read_clip(mocap / "cmu" / "06_01.bvh")
    still = replace(motion, rotations=np.repeat(motion.rotations[:1], motion.frame_count, axis=0))
    assert find_cycles(still) == []
