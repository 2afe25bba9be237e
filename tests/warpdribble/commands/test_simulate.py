"""`simulate`: a clip and a skill are one road, the ball is the one that was recorded where one was, and what
is guessed or left out is said."""

import re

import numpy as np
import pytest

from warpdribble.assets import path as asset
from warpdribble.cli import main
from warpdribble.sims import Model
from warpdribble.sims.ball.ball import inferred_ball
from warpdribble.skills import clip_skill, read_skill, stage_skill

RUN = "013_018pickle_run_3.pt"


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """No pictures."""
    for name in ("write_sheet", "write_plots"):
        monkeypatch.setattr(f"warpdribble.takes.{name}", lambda *_, **__: None)


@pytest.fixture
def simulated(tmp_path, capsys):
    """A function that simulates: what is said, and where (frames, 7) each body was, by its path."""
    from pxr import Usd

    def run(*arguments):
        out = tmp_path / f"take{len(list(tmp_path.glob('take*')))}.usdc"
        capsys.readouterr()
        assert main(["simulate", *map(str, arguments), "--no-html", "--out", str(out)]) == 0
        stage, places = Usd.Stage.Open(str(out)), {}
        for prim in stage.Traverse():
            moved = prim.GetAttribute("xformOp:translate")
            if moved and moved.GetTimeSamples():
                samples = [(*moved.Get(t), *_turn(prim, t)) for t in moved.GetTimeSamples()]
                places[str(prim.GetPath())] = np.array(samples)
        return capsys.readouterr().out, places

    return run


def _turn(prim, time):
    turn = prim.GetAttribute("xformOp:orient").Get(time)
    return (*turn.GetImaginary(), turn.GetReal())


def skill_file(tmp_path, clip, frames, **rest):
    path = tmp_path / "mine.toml"
    values = {"name": '"mine"', "clip": f'"{clip}"', "frames": list(frames), **rest}
    path.write_text("".join(f"{key} = {value}\n" for key, value in values.items()))
    return path


def assert_same_places(one, two):
    assert one.keys() == two.keys() and len(one) > 20
    for name, places in one.items():
        np.testing.assert_array_equal(places, two[name], err_msg=name)


def notes(said):
    """Lines that are said of the skill or clip."""
    return re.findall(r"^ {10}(\S.*)$", said, re.MULTILINE)


# ------------------------------------------------------------------------------------------- one road


def test_a_clip_is_a_skill_that_has_no_file_yet(simulated, tmp_path, cmu_clip):
    """The same bits: frames and repairs; where no ball shows there is none."""
    mine = skill_file(tmp_path, cmu_clip, (0, 110), repairs='"ground"')
    clip, places = simulated(cmu_clip, "--frames", 0, 110, "--repair", "ground")
    skill, others = simulated(mine)
    assert_same_places(places, others)
    assert clip.startswith("clip      clip.bvh, frames 0 to 110, 0.92 s\n")
    assert skill.startswith("skill     mine: , 0.92 s\n") and notes(clip) == notes(skill)
    assert notes(clip)[-1] == "no ball shows" and "/World/Ball" not in places
    assert any(note.startswith("repair ground: ") for note in notes(clip))


def test_the_error_of_the_retargeting_is_said(simulated, capsys, cmu_clip):
    """The same as `motion retarget` says: mean and worst joint."""
    said, _ = simulated(cmu_clip)
    assert main(["motion", "retarget", str(cmu_clip)]) == 0
    error = re.search(r"^joints +(.*);", capsys.readouterr().out, re.MULTILINE)[1]
    assert re.fullmatch(r"\d+\.\d cm from the recording, the worst \d+\.\d cm \(\w+\)", error)
    assert f"joints {error}" in notes(said)


def test_an_inferred_ball_is_said(simulated, tmp_path, mocap):
    """Also of a clip whose ends are made to meet; the same bits again."""
    path = mocap / "cmu" / "06_12.bvh"
    clip, places = simulated(path, "--frames", 597, 684, "--repeat", 2)
    skill, others = simulated(skill_file(tmp_path, path, (597, 684), cyclic="true"), "--repeat", 2)
    assert_same_places(places, others)
    assert notes(clip) == notes(skill) and notes(clip)[-1].endswith("degrees per joint apart: blended")
    assert notes(clip)[-3] == "ball inferred from the hands' motion"
    assert notes(clip)[-2].startswith("hands led to a ball that can be pushed so, by up to ")
    assert len(places["/World/Ball"]) == 145 and "bounces" in clip


def own(places, name):
    """Where (frames, 3) a body was, from where the pelvis began: takes begin at the court's centre."""
    return places[f"/World/{name}"][:, :3] - places["/World/Player/pelvis"][0, :3]


def test_a_recorded_ball_is_used_and_said(simulated, tmp_path, mocap, player):
    """By both, to the bit; it starts where it was recorded, and not where the hand would have it."""
    path = mocap / "ballplay_m" / RUN
    said, places = simulated(path, "--frames", 38, 80)
    skill, others = simulated(skill_file(tmp_path, path, (38, 80)))
    assert_same_places(places, others)
    assert "ball recorded" in notes(said) and notes(said) == notes(skill)
    one = stage_skill(player, clip_skill(path, (38, 80)))
    assert one.ball.recorded
    begins = own(places, "Ball")[0]
    recorded, guessed = (
        ball.path[0] - one.reference.joint_q[0, :3]
        for ball in (one.ball, inferred_ball(player, one.reference))
    )
    assert np.linalg.norm(begins - recorded) < 0.022 < 0.1 < np.linalg.norm(begins - guessed)


def test_without_the_ball_there_is_none(simulated, mocap):
    """In the take; the player starts as with it."""
    path = mocap / "ballplay_m" / RUN
    _, with_ball = simulated(path, "--frames", 0, 80)
    said, places = simulated(path, "--frames", 0, 80, "--no-ball")
    assert "/World/Ball" not in places and with_ball.keys() - places.keys() == {"/World/Ball"}
    assert "ball left out" in notes(said) and "bounces" not in said
    bodies = [path.removeprefix("/World/") for path in places if path.startswith("/World/Player/")]
    assert len(bodies) > 10
    for name in bodies:
        np.testing.assert_allclose(own(places, name)[0], own(with_ball, name)[0], atol=1e-6)
    said, places = simulated("waist", "--no-ball")
    assert "/World/Ball" not in places and "ball left out" in notes(said)


def test_a_walk_has_none(simulated, mocap):
    """And nothing was left out either."""
    said, places = simulated(mocap / "cmu" / "02_01.bvh", "--frames", 0, 100)
    assert notes(said)[-1] == "no ball shows" and "/World/Ball" not in places and "bounces" not in said


def test_a_skill_without_a_ball(simulated, mocap, monkeypatch):
    monkeypatch.setenv("WARPDRIBBLE_DATA", str(mocap))
    said, places = simulated("walk", "--repeat", 2)
    assert said.startswith("skill     walk: walking, no ball, ") and "/World/Ball" not in places
    assert not any(note == "ball recorded" for note in notes(said))


def test_a_model_without_a_ball(simulated, tmp_path, cmu_clip, player):
    """Its player does what the full one does without the ball, but for rounding."""
    text = asset("player.xml").read_text()
    body = text[text.index('<body name="ball"') :]
    text = text.replace(body[: body.index("</body>") + len("</body>")], "")
    text = text.replace('<text name="ball" data="ball" />', "")
    pose = re.search(r'qpos="([^"]*)"', text)[1].split()
    del pose[player.q_slice("ball")]
    text = re.sub(r'qpos="[^"]*"', f'qpos="{" ".join(pose)}"', text)
    (tmp_path / "bare.xml").write_text(text)
    said, places = simulated(cmu_clip, "--frames", 0, 110, "--model", tmp_path / "bare.xml")
    _, others = simulated(cmu_clip, "--frames", 0, 110, "--no-ball")
    assert places.keys() == others.keys()
    for name, where in places.items():
        np.testing.assert_allclose(where, others[name], atol=1e-4, err_msg=name)
    assert "/World/Ball" not in places and not any("ball" in note for note in notes(said))


def test_an_authored_skill_keeps_its_ball(simulated, player):
    said, places = simulated("waist", "--repeat", 2)
    assert said.startswith("skill     waist: (C) the ball round the waist, ")
    staged = stage_skill(player, read_skill("waist"))
    wanted = staged.ball.path[0] - staged.reference.joint_q[0, :3]
    assert np.linalg.norm(own(places, "Ball")[0] - wanted) < 0.022


def test_a_root_is_held(simulated, mocap, player):
    """To the clip, nearer than a free one comes."""
    path, off = mocap / "ballplay_m" / RUN, []
    wanted = stage_skill(player, clip_skill(path, (0, 60))).reference.joint_q[:, :3]
    for root in ("tracked", "free"):
        said, places = simulated(path, "--frames", 0, 60, "--root", root)
        assert f"with root {root}, " in said
        off.append(np.linalg.norm(own(places, "Player/pelvis") - (wanted - wanted[0]), axis=1).max())
    assert off[0] < 0.1 < 0.3 < off[1]


# ---------------------------------------------------------------------------------------- what is said


def refused(capsys, *arguments):
    assert main(["simulate", *map(str, arguments)]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1
    return said.err.removeprefix("warpdribble: ").rstrip("\n")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--frames", 50, 20), "give two rising numbers from 0 to 120; give other --frames"),
        (("--frames", 0, 1), "its frames last only 0.008 s; give other --frames"),
        (("--units", "mile"), "it is m, cm, mm, inch, foot, cmu or metres per unit; say which with --units"),
        (("--repair", "hair"), "there are spikes, toes, lowpass, ground; give others with --repair"),
        (("--mapping", "lafan"), "; give another --mapping"),
        (("--mapping", "none.toml"), "none.toml: no such file; give another --mapping"),
    ],
)
def test_a_clip_that_cannot_be_used_names_the_option(capsys, tmp_path, cmu_clip, options, said):
    line = refused(capsys, cmu_clip, *options, "--out", tmp_path / "x.usdc")
    assert line.endswith(said)
    assert "mine.toml" not in line and "frames:" not in line


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"frames": [50, 20]}, "frames: 50 to 20 is no range"),
        ({"frames": [0, 500]}, "frames: clip.bvh: frames 0 to 500 are no range in it"),
        ({"frames": [0, 1]}, "frames: its frames last only 0.008 s"),
        ({"units": '"mile"'}, "units: clip.bvh: there is no unit 'mile'"),
        ({"up": '"w"'}, "up: clip.bvh: there is no axis 'w'"),
        ({"repairs": '"hair"'}, "repairs: clip.bvh: there is no repair 'hair'"),
        ({"mapping": '"lafan"'}, "mapping: "),
        ({"asf": '"none.asf"'}, "asf: no file 'none.asf' in "),
    ],
)
def test_a_skill_that_cannot_be_used_names_its_key(capsys, tmp_path, cmu_clip, values, said):
    values = {"frames": (0, 100)} | values
    mine = skill_file(tmp_path, cmu_clip, values.pop("frames"), **values)
    line = refused(capsys, mine, "--out", tmp_path / "x.usdc")
    assert line.startswith(f"{mine}: {said}") and "--" not in line


def test_joints_that_are_not_there_are_named(capsys, tmp_path, cmu_clip):
    cmu_clip.write_text(cmu_clip.read_text().replace("LeftFoot", "LFoot"))
    line = refused(capsys, cmu_clip, "--out", tmp_path / "x.usdc")
    assert re.search(r"clip\.bvh: .*unknown joints.*LeftFoot.*; give another --mapping$", line)


def test_a_skill_that_is_done_once_is_not_repeated(capsys, tmp_path):
    (tmp_path / "once.toml").write_text('name = "once"\nauthored = "waist"\n')
    line = "--repeat 2: the skill 'once' is not cyclic"
    assert (
        main(["simulate", str(tmp_path / "once.toml"), "--repeat", "2", "--out", f"{tmp_path}/x.usdc"]) == 2
    )
    assert capsys.readouterr().err == f"warpdribble: {line}\n"


def test_a_state_that_breaks_down_is_said(capsys, tmp_path, monkeypatch):
    """With what may help."""
    from warpdribble.learning.evaluate import record

    monkeypatch.setattr(record, "NONFINITE", ~0)
    monkeypatch.setattr("warpdribble.sims.worlds.Simulation.status", np.ones(16, int))
    assert main(["simulate", "waist", "--out", str(tmp_path / "x.usdc")]) == 1
    said = capsys.readouterr().err.splitlines()[-1]
    assert said == (
        "warpdribble: the simulation broke down (non-finite state); try --root tracked, or another clip"
    )
    assert not (tmp_path / "x.usdc").exists()
