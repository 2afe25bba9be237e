import json

import numpy as np
import pytest

from warpdribble.cli import main


def test_a_table(capsys, cmu_clip):
    assert main(["motion", "info", str(cmu_clip)]) == 0
    said = capsys.readouterr().out
    for line in (
        ", frames 0 to 120, 1.00 s at 120 Hz",
        "left hand   0.83 to 0.83 m, 0 strokes",
        "right hand  0.83 to 1.10 m, 1 strokes: lowest at 60",
        "left foot   1 stances, slides 0.0 cm/s: 0-120",
        *(f"{what:10}  none" for what in ("jumps", "frozen", "under")),
    ):
        assert f"{line}\n" in said
    assert "root        0.00 m/s" in said and "lost bone lengths" in said


def test_json_has_everything_and_counts_from_the_clip_s_first_frame(capsys, mocap):
    clip = mocap / "cmu" / "06_12.bvh"
    assert main(["motion", "info", str(clip), "--frames", "400", "1040", "--format", "json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["frames"] == 641 and report["ball_bounces"] is None
    strokes = np.array(report["hands"]["right"]["strokes"])
    assert len(strokes) == 6 and strokes.min() >= 400 and strokes.max() <= 1040
    stances = np.array(report["feet"]["left"]["contacts"])
    assert len(stances) == 4 and np.all(np.diff(stances.ravel()) > 0)
    assert stances.min() == 400 and stances.max() == 1040
    assert {"what", "first", "last", "size"} <= set(report["jumps"][0])


def test_a_clip_with_a_ball(capsys, mocap):
    clip = mocap / "ballplay_m" / "013_018pickle_run_3.pt"
    assert main(["motion", "info", str(clip)]) == 0
    assert "bounces at 18, 71; in hand 0-13, 30-64" in capsys.readouterr().out


def test_repairs_are_reported(capsys, cmu_clip):
    assert main(["motion", "info", str(cmu_clip), "--repair", "spikes,ground"]) == 0
    said = capsys.readouterr().out
    assert "repair spikes: none found" in said and "repair ground: moved by" in said
    assert "feet stand at 0.020 m" in said


def test_joints(capsys, cmu_clip):
    assert main(["motion", "joints", str(cmu_clip)]) == 0
    lines = capsys.readouterr().out.splitlines()
    leg = next(line for line in lines if line.startswith("LeftLeg "))
    assert leg.split() == ["LeftLeg", "LeftUpLeg", "40.6", "cm", "left", "knee"]


def test_an_amc_clip_with_units_and_axis(capsys, amc_clip):
    arguments = ["motion", "info", str(amc_clip), "--units", "1", "--up", "z"]
    assert main([*arguments, "--asf", str(amc_clip.with_name("01.asf"))]) == 0
    assert "no foot stands" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--frames", "50", "20"], "0 to 120"),
        (
            ["--units", "mile"],
            "no unit 'mile': it is m, cm, mm, inch, foot, cmu or metres per unit; say which with --units",
        ),
        (["--up", "w"], "--up"),
        (
            ["--repair", "hair"],
            "no repair 'hair': there are spikes, toes, lowpass, ground; give others with --repair",
        ),
        (["--format", "xml"], "--format"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(capsys, cmu_clip, options, word):
    assert main(["motion", "info", str(cmu_clip), *options]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1 and word in said.err
