from pathlib import Path

import numpy as np
import pytest

from warpdribble.cli import main
from warpdribble.sims import Cycle, Model
from warpdribble.sims.model import gaps, pose
from warpdribble.skills.draft import draft
from warpdribble.skills.skill import SkillError, is_skill, parse_skill, read_skill, skill_names
from warpdribble.skills.staged import stage_skill

SMALL = 'name = "mine"\nauthored = "waist"\ncyclic = true\n'


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def test_what_ships_reads():
    names = skill_names()
    assert {"carry", "dribble-right", "waist", "switch-hands", "run-dribble", "walk", "run"} <= set(names)
    for name in names:
        one = read_skill(name)
        assert one.name == name and one.description
        assert bool(one.clip) != bool(one.authored)


@pytest.mark.parametrize("name", skill_names())
def test_every_skill_plays(player, mocap, name):
    one = stage_skill(player, read_skill(name), mocap)
    assert (one.cycle is not None) == one.skill.cyclic
    if name in ("walk", "run"):
        assert one.ball is None
    else:
        assert one.ball.touch.any() and one.ball.checkpoints
        assert one.ball.path.shape == (one.reference.frame_count, 3)
        place = player.q_slice("ball").start
        assert one.reference.joint_q[:, place : place + 3] == pytest.approx(one.ball.path)
        assert one.ball.path[:, 2].min() > 0.1
    feet = [player.body(f"{side}_{part}") for side in "lr" for part in ("foot", "toes")]
    assert gaps.lowest_point(player, pose.forward(player, one.reference.joint_q), feet).min() > -0.006
    if one.cycle is not None:
        first, last = one.reference.joint_q[[0, -1]]
        assert np.allclose(first[7:-7], last[7:-7], atol=1e-6)
        assert one.cycle.repeat(player, 3).frame_count == 3 * (one.reference.frame_count - 1) + 1


def test_a_mirrored_skill_changes_hands(player):
    plain = stage_skill(player, parse_skill(SMALL.replace("waist", "dribble_right"), "a"))
    twin = stage_skill(player, parse_skill(SMALL.replace("waist", "dribble_right") + "mirror = true\n", "a"))
    assert plain.ball.touch[:, 1].any() and not plain.ball.touch[:, 0].any()
    assert twin.ball.touch[:, 0].any() and not twin.ball.touch[:, 1].any()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (SMALL + "speed = 2\n", "speed: unknown key"),
        (SMALL.replace('"mine"', "3"), "name: should be a text"),
        (SMALL.replace('name = "mine"\n', ""), "name: missing"),
        (SMALL.replace('authored = "waist"\n', ""), "clip: give either clip or authored"),
        (SMALL + 'clip = "a.bvh"\n', "clip: give either clip or authored"),
        (SMALL + "frames = [9, 3]\n", "frames: 9 to 3 is no range"),
        (SMALL + "frames = [0.5, 3]\n", "frames: should be the first"),
        (SMALL + "mirror = 1\n", "mirror: should be true or false"),
        (SMALL + "[contact]\nfoot = []\n", r"contact\.foot: unknown key"),
        (SMALL + "[contact]\nleft = [[0.3, 0.1]]\n", r"contact\.left\[0\]: 0.3 to 0.1 s is no range"),
        (SMALL + "[contact]\nleft = [[0.1, 0.3], [0.2, 0.4]]\n", r"contact\.left: 0.2 s begins before"),
        (SMALL + "[contact]\ncheckpoints = [-1]\n", r"contact\.checkpoints\[0\]: should be a number"),
        (SMALL + "[contact]\ncheckpoints = [nan]\n", r"contact\.checkpoints\[0\]: should be a number"),
        (SMALL + "[contact]\nheights = [1.0]\n", r"contact\.heights: should have one number"),
        ("name =", "not TOML"),
    ],
)
def test_a_wrong_file_is_said_with_key_and_reason(text, said):
    with pytest.raises(SkillError, match=f"^mine.toml: {said}"):
        parse_skill(text, "mine.toml")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (SMALL.replace('authored = "waist"', 'clip = "gone.bvh"'), "clip: no file 'gone.bvh'"),
        (SMALL.replace("waist", "moon"), "authored: no clip 'moon'; there are carry"),
        (SMALL + "[contact]\nleft = [[9.0, 9.5]]\n", r"contact.left\[0\]: begins at 9.0 s"),
        (SMALL + "[contact]\ncheckpoints = [9.0]\n", "contact.checkpoints: 9.0 s is beyond"),
    ],
)
def test_a_skill_that_cannot_be_played_says_why(player, tmp_path, text, said):
    with pytest.raises(SkillError, match=said):
        stage_skill(player, parse_skill(text, "mine.toml"), tmp_path)


def test_frames_beyond_the_clip_are_named(player, mocap):
    one = parse_skill('name = "x"\nclip = "cmu/06_01.bvh"\nframes = [0, 99999]\n', "mine.toml")
    with pytest.raises(
        SkillError, match=r"mine.toml: frames: 06_01.bvh: frames 0 to 99999 are no range in it"
    ):
        stage_skill(player, one, mocap)


def test_a_draft_is_a_skill_that_plays(player, mocap, tmp_path, monkeypatch):
    monkeypatch.setenv("WARPDRIBBLE_DATA", str(mocap))
    text = draft(player, mocap / "ballplay_m" / "044_006pickle_lleg_2.pt", name="legs")
    one = parse_skill(text, "legs.toml")
    assert one.clip == "ballplay_m/044_006pickle_lleg_2.pt" and one.cyclic
    assert one.frames[0] == pytest.approx(54, abs=4) and one.frames[1] == pytest.approx(142, abs=4)
    assert len(one.checkpoints) == len(one.heights) == 2
    assert stage_skill(player, one).ball.touch.any()


@pytest.mark.parametrize(
    ("frames", "cyclic", "said"),
    [((118, 241), True, "3.4 cm apart: a cycle"), ((118, 180), False, "cm apart: once; cyclic = true bends")],
)
def test_frames_that_end_as_they_begin_are_a_cycle(player, mocap, frames, cyclic, said):
    text = draft(player, mocap / "cmu" / "06_04.bvh", frames)
    assert parse_skill(text, "mine.toml").cyclic == cyclic and said in text


def test_a_draft_reads_its_clip_as_it_was_told_to(player, cmu_clip):
    text = draft(player, cmu_clip, whole=True, units="cmu", up="y", rate=100.0, drop_positions=True)
    one = parse_skill(text, "mine.toml")
    assert (one.units, one.up, one.rate, one.drop_positions) == ("cmu", "y", 100.0, True)
    assert stage_skill(player, one).reference.duration == pytest.approx(1.2, abs=0.011)


def test_names_are_told_from_clips(tmp_path):
    assert is_skill("waist") and is_skill("my.toml") and is_skill("nonsense")
    assert not is_skill("clip.bvh") and not is_skill(tmp_path)
    with pytest.raises(SkillError, match="no such skill; there are behind-back"):
        read_skill("nonsense")


def test_the_commands(capsys, tmp_path, cmu_clip):
    assert main(["skill", "list"]) == 0
    assert "between-legs" in capsys.readouterr().out
    assert main(["skill", "show", "switch-hands"]) == 0
    assert "checkpoints: 0.5" in capsys.readouterr().out
    assert main(["skill", "show", str(tmp_path / "none.toml")]) == 2
    assert "no such file" in capsys.readouterr().err
    assert main(["skill", "draft", str(cmu_clip), "--out", str(tmp_path / "d.toml")]) == 0
    said = capsys.readouterr().out
    assert f"simulate {tmp_path / 'd.toml'} --repeat 5" in said
    assert f"learn {tmp_path / 'd.toml'} --out {Path('runs', 'd')}" in said
    drafted = read_skill(tmp_path / "d.toml")
    assert (drafted.name, drafted.frames, drafted.cyclic) == ("clip", (0, 120), True)
    assert main(["skill", "draft", str(cmu_clip), "--out", str(tmp_path / "d.txt")]) == 2
    assert "a skill is a .toml file" in capsys.readouterr().err


def test_a_draft_that_was_edited_is_not_lost(capsys, tmp_path, cmu_clip):
    out = tmp_path / "d.toml"
    out.write_text("mine")
    assert main(["skill", "draft", str(cmu_clip), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert f"{out}: is there already; give another name, or --overwrite" in said and out.read_text() == "mine"
    assert main(["skill", "draft", str(cmu_clip), "--out", str(out), "--overwrite"]) == 0
    assert read_skill(out).name == "clip"


def test_a_skill_says_where_it_leads_as_the_player_faces(capsys, tmp_path, cmu_clip, monkeypatch):
    monkeypatch.setattr(Cycle, "way", (1.5, -0.25))
    text = f'name = "x"\nclip = "{cmu_clip}"\ncyclic = true\nball = false\n'
    (tmp_path / "x.toml").write_text(text)
    assert main(["skill", "show", str(tmp_path / "x.toml")]) == 0
    assert "per cycle: 1.50 m ahead, 0.25 m to the right\n" in capsys.readouterr().out


def test_skills_that_are_not_here_name_what_to_fetch(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("WARPDRIBBLE_DATA", str(tmp_path))
    assert main(["skill", "list"]) == 0
    said = capsys.readouterr().out
    clips = [read_skill(name).clip for name in skill_names() if read_skill(name).clip]
    assert said.count("(not here: warpdribble fetch ") == len(clips)
    for folder, name in (("cmu", "cmu"), ("ballplay_m", "ballplay")):
        lines = [line for line in said.splitlines() if f" {folder}/" in line]
        assert lines and all(line.endswith(f"warpdribble fetch {name})") for line in lines)


def test_motion_commands(capsys, cmu_clip):
    assert main(["motion", "retarget", str(cmu_clip)]) == 0
    out = capsys.readouterr().out
    assert "hands" in out and "mapping cmu" in out
    assert main(["motion", "cycles", str(cmu_clip), "--longest", "1.0"]) == 0
    assert [row.split()[0] for row in capsys.readouterr().out.splitlines()] == ["frames", "0-120"]
    assert main(["motion", "cycles", str(cmu_clip), "--shortest", "3"]) == 2
