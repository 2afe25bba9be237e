"""The ball's tables: halves, hands, who misses, and who has a ball that has none."""

import numpy as np

from warpdribble.reports.ball import Row, measure, tables
from warpdribble.sims import Model
from warpdribble.sims.ball.ball import Ball
from warpdribble.sims.ball.contact_score import score_contacts


def score(wrong):
    """Of 100 frames of contact, of which so many at the end are not found."""
    found = np.ones(100, bool)
    found[100 - wrong :] = False
    return score_contacts(found, np.ones(100, bool), 0.01)


def test_each_hand_of_each_half_has_a_line():
    rows = [
        Row("a.pt", (score(0), score(50)), None, 0),
        Row("b.pt", (score(0), score(0)), None, 1, dribbled=True),
        Row("c.pt", (score(0), score(0)), None, 0),
    ]
    lines = tables(rows).splitlines()
    assert "| 2 chosen on | left | 1.000 | 1.000 | 0 | 0 of 0 | a.pt (1.00, 1.00) |" in lines
    assert "| 2 chosen on | right | 1.000 | 0.775 | 0 | 0 of 0 | a.pt (1.00, 0.55) |" in lines
    assert any(line.startswith("| 1 judged on, dribbling | left") for line in lines)
    assert "Clips with a precision or recall below 0.9: 1 of 3." in lines


def test_phantom_balls_are_named():
    ball = Ball(np.zeros((9, 3)), np.ones((9, 2), bool), (), ())
    text = tables([Row("cmu/06_01.bvh", None, ball), Row("cmu/02_01.bvh", None, None)])
    assert "A ball in 1 of 2 that have none: cmu/06_01.bvh." in text
    assert "| cmu/06_12.bvh | 0 | 0 | 0 | 0.1 |" in tables([Row("cmu/06_12.bvh", None, ball)])


def test_copies_are_measured_once(tmp_path, cmu_clip):
    for name in ("one", "two"):
        (tmp_path / f"{name}.bvh").write_bytes(cmu_clip.read_bytes())
    cmu_clip.unlink()
    rows = measure(Model.load("player"), tmp_path)
    assert [row.clip for row in rows] == ["one.bvh"]
