"""Measured parts of pages: what is between the markers is replaced, and says what was measured."""

import pytest

from warpdribble.reports.locomotion import tables
from warpdribble.reports.markers import BEGIN, END, check_page, write_measured


def run(skill, seed, **values):
    found = {
        "skill": skill,
        "description": "walking",
        "seed": seed,
        "fragments": 20,
        "seconds": 100.0 + 10.0 * seed,
        "rate": 1.5e5,
        "outside": 40.0,
        "survived": 100 - seed,
        "busy": 90 + seed,
        "angle": 1.0 + seed,
        "ends": 2.0,
        "drift": 3.0,
        "turn": 4.0,
        "open angle": 5.0,
        "open ends": 6.0,
        "open seconds": 0.7,
        "pushes": [100.0 + 50.0 * seed] * 7 + [300.0 - 50.0 * seed],
    }
    return found | values


def test_seeds_share_a_row():
    """Survivals one by one, medians of errors and times, the least of the pushes."""
    text = tables([run("walk", seed) for seed in (0, 1, 2)] + [run("jog", 0, survived=7)])
    rows = [line for line in text.splitlines() if line.startswith(("| walk", "| jog"))]
    assert rows[0] == "| walk: walking | 1.00 | 100 99 98 | 90 91 92 | 110 | 150 k | 40 % |"
    assert rows[1].split(" | ")[2] == "7"
    assert rows[2] == "| walk | 2.0 | 2.0 | 3.0 | 4.0 | 5.0 | 6.0 | 0.7 |"
    assert rows[4] == f"| walk | {' | '.join(['100'] * 7)} | 200 |"


def test_only_what_is_between_the_markers_changes(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    check_page(page)
    write_measured(page, "new")
    write_measured(page, "newer")
    assert page.read_text() == f"before\n{BEGIN}\n\nnewer\n\n{END}\nafter\n"


def test_a_page_without_markers_is_refused(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"{BEGIN} but no end")
    with pytest.raises(SystemExit, match="no markers"):
        check_page(page)


def test_the_sheets_are_drawn(tmp_path):
    from warpdribble.reports.authored import main
    from warpdribble.sims import AUTHORED

    main(tmp_path / "sheets")
    assert sorted(p.stem for p in (tmp_path / "sheets").iterdir()) == sorted(AUTHORED)
