"""Measured parts of pages: what is between the markers is replaced, and says what was measured."""

import json
import shutil

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
        "pace": 99.0,
        "astray": 5.0,
        "landing": 3.0,
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
    assert rows[2] == "| walk | 2.0 | 2.0 | 3.0 | 99.0 | 5.0 | 3.0 | 5.0 | 6.0 | 0.7 |"
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


@pytest.fixture
def few(monkeypatch):
    """Trials and pushes that take a second."""
    from warpdribble.learning.evaluate import pushes
    from warpdribble.reports import locomotion

    for name, value in (("TRIALS", 4), ("CYCLES", 2), ("PLAYERS", 16)):
        monkeypatch.setattr(locomotion, name, value)
    monkeypatch.setattr(pushes, "FORCES", (50, 2000))


def test_runs_are_measured(tmp_path, few):
    """Tables and curves; what was measured once is kept; runs in folders of their own follow."""
    from warpdribble.assets import path as asset
    from warpdribble.reports.locomotion import MEASURED, main

    page, runs = tmp_path / "docs" / "page.md", tmp_path / "runs"
    page.parent.mkdir()
    page.write_text(f"{BEGIN}\n{END}\n")
    places = [runs / "one", runs / "other-seeds" / "two"]
    for place in places:
        shutil.copytree(asset("controllers") / "dribble-right-authored", place)
        head = "iteration,survived,samples_per_second,outside,seconds"
        rows = ("1,nan,1000,0.25,1.5", "2,0.5,3000,0.15,3.5")
        (place / "locomotion" / "progress.csv").write_text("\n".join((head, *rows)) + "\n")
    main(runs, page)
    text = page.read_text()
    name = "dribble-right-authored"
    row = f"| {name}: (B) dribbling in place, right hand, authored | 0.70 | 4 | 4 | 4 | 2 k | 20 % |"
    assert text.count(row) == 2 and "### Other seeds" in text
    assert text.count(f"| {name} | {' | '.join(['50'] * 8)} |") == 2
    assert (page.parent / "pictures" / "locomotion-curves.png").stat().st_size > 5000
    kept = json.loads((places[0] / MEASURED).read_text())
    assert kept["iterations"] == 80 and kept["open seconds"] > 0.0
    (places[0] / MEASURED).write_text(json.dumps(kept | {"survived": 77}))
    main(runs, page)
    assert page.read_text() == text.replace(row, row.replace("| 4 | 4 | 4 |", "| 77 | 4 | 4 |"), 1)


def test_the_sheets_are_drawn(tmp_path):
    from warpdribble.reports.authored import main
    from warpdribble.sims import AUTHORED

    main(tmp_path / "sheets")
    assert sorted(p.stem for p in (tmp_path / "sheets").iterdir()) == sorted(AUTHORED)
