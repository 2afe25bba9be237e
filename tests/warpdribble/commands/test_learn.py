"""`learn`, `evaluate` and `export`, from the command line to the files."""

import json
import re
import shutil
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from warpdribble.cli import main
from warpdribble.learning.methods import STAGES
from warpdribble.learning.methods.samcon import Samcon, SamconConfig
from warpdribble.learning.runs.folder import Run
from warpdribble.learning.runs.log import read_rows
from warpdribble.skills.graph import skill_graph
from warpdribble.skills.skill import parse_skill
from warpdribble.takes.take import validate

NAME = "dribble-right-authored"
LEGS = ("--stage", "locomotion")
SMALL = {"iterations": 6, "islands": 4, "particles": 32, "walk": 60, "check_every": 3, "trials": 32}


@pytest.fixture(scope="module")
def small():
    """Learning that takes a second."""
    with pytest.MonkeyPatch.context() as patch:
        config = partial(SamconConfig, **SMALL)
        patch.setitem(STAGES, "locomotion", replace(STAGES["locomotion"], config=config))
        yield


@pytest.fixture(scope="module")
def run(small, tmp_path_factory):
    """The folder of a run that the command made."""
    folder = tmp_path_factory.mktemp("learn") / "run"
    assert main(["learn", NAME, *LEGS, "--out", str(folder)]) == 0
    return folder


def refused(capsys, *arguments):
    """The one line on stderr of a command that has to fail with status 2."""
    assert main([str(a) for a in arguments]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and said.startswith("warpdribble: "), said
    return said


def evaluated(capsys, run, *arguments):
    capsys.readouterr()
    assert main(["evaluate", str(run), *arguments, "--format", "json"]) == 0
    return json.loads(capsys.readouterr().out, parse_constant=pytest.fail)


def test_learning_says_how_it_went_and_what_is_next(small, capsys, tmp_path):
    out = tmp_path / "run"
    assert main(["learn", NAME, *LEGS, "--out", str(out), "--iterations", "4"]) == 0
    said = capsys.readouterr()
    for words in (
        "authored clip dribble_right",
        "learned   4 iterations",
        "tried     the last policy, in 32 trials of 20 cycles (harder than usual: pushes up to 400 N, ",
        "kept      the best policy of all tries, score ",
        "samples/s",
        "% of the time outside the simulation",
        f"warpdribble evaluate {out}",
        f"warpdribble export {out}",
    ):
        assert words in said.out
    checks = [line for line in said.err.splitlines() if line.startswith("iteration ")]
    assert [line.split(":")[0] for line in checks] == ["iteration 3 of 4", "iteration 4 of 4"]
    assert "of the trials survived, cost" in checks[0]
    assert main(["learn", NAME, *LEGS, "--out", str(out), "--iterations", "5"]) == 0
    assert "goes on   after 4 iterations" in capsys.readouterr().out
    assert [row["iteration"] for row in read_rows(out / "locomotion")] == [1, 2, 3, 4, 5]
    assert main(["learn", NAME, *LEGS, "--out", str(out), "--iterations", "5"]) == 0
    said = capsys.readouterr().out
    assert "goes on   after 5 iterations" in said and "learned   5 iterations" in said
    assert "TensorBoard" not in said


def test_a_run_that_is_stopped_says_how_to_go_on(small, capsys, tmp_path, monkeypatch):
    iterate = Samcon.iterate

    def interrupted(self):
        if self.iteration == 2:
            raise KeyboardInterrupt
        return iterate(self)

    monkeypatch.setattr(Samcon, "iterate", interrupted)
    assert main(["learn", NAME, *LEGS, "--out", str(tmp_path / "run")]) == 130
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith("warpdribble: stopped after 2 iterations; saved in ")
    assert said.endswith("the same command goes on")
    said = refused(capsys, "evaluate", tmp_path / "run")
    assert said.endswith("run: has no policy yet; let it go on with the same warpdribble learn\n")


def test_what_is_not_installed_is_said_before_anything_is_learned(capsys, tmp_path, monkeypatch):
    """Not after the minutes that the stages before it take."""
    monkeypatch.setattr("warpdribble.learning.runs.stage.find_spec", lambda name: None)
    said = refused(capsys, "learn", NAME, "--out", tmp_path / "run")
    assert "the stage policy needs the package 'torch': pip install 'warpdribble[learn]'" in said
    assert not (tmp_path / "run" / "locomotion").exists()


def test_an_evaluation_is_json(run, capsys):
    report = evaluated(capsys, run, "--cycles", "2", "--trials", "20")
    assert {"skill", "seed", "lived", "cost", "angle_error_deg", "end_error_cm"} < set(report)
    assert (report["trials"], report["cycles"], report["seed"]) == (20, 2.0, 1)
    assert report["skill"] == NAME and report["iterations"] == SMALL["iterations"]
    assert type(report["survived"]) is int and 0 < report["survived"] <= 20
    assert report["survived"] / 20 <= report["lived"] <= 1.0
    assert 0.0 < report["drift_cm_per_cycle"] < 100.0 and 0.0 < report["angle_error_deg"] < 20.0
    assert report["survived"] + report["fell"] == 20 and report["lost"] == 0
    assert "pushes" not in report
    assert report == evaluated(capsys, run, "--cycles", "2", "--trials", "20")
    assert report == evaluated(capsys, run, "--seconds", str(report["seconds"]), "--trials", "20")


def test_what_there_is_no_number_for_is_null(run, capsys):
    report = evaluated(capsys, run, "--cycles", "0.5", "--trials", "2")
    assert report["drift_cm_per_cycle"] is None and report["angle_error_deg"] > 0.0


def test_pushes_and_open_loop_are_harder(run, capsys):
    few = ("--cycles", "5", "--trials", "32")
    calm = evaluated(capsys, run, *few)
    assert evaluated(capsys, run, *few, "--push", "1000")["lived"] < calm["lived"]
    assert evaluated(capsys, run, *few, "--noise", "2")["lived"] < calm["lived"]
    blind = evaluated(capsys, run, *few, "--open-loop")
    assert blind["open_loop"] and blind["cost"] != calm["cost"]


def test_a_table_of_pushes(run, capsys, monkeypatch):
    """A force in which a direction is lost before the push is null in JSON and a dash to read."""
    from warpdribble.learning.evaluate import pushes

    shares = {10: [1.0] * 8, 20: [0.95] * 7 + [0.5], 30: [float("nan")] + [0.9] * 6 + [1.0], 40: [1.0] * 8}
    monkeypatch.setattr(pushes, "FORCES", tuple(shares))
    monkeypatch.setattr(pushes, "push_survival", lambda *a, **_: np.array(shares[a[3]]))
    arguments = ("--cycles", "1", "--trials", "2", "--pushes")
    table = evaluated(capsys, run, *arguments)["pushes"]
    assert table["forces"] == [10, 20, 30] and len(table["directions"]) == 8
    assert table["survived"][2][0] is None
    assert list(table["largest"].values()) == [20.0] * 7 + [10.0]
    assert table["largest_in_every_direction"] == 10.0
    assert main(["evaluate", str(run), *arguments]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-3].split() == ["30", "-", *["90"] * 6, "100"]
    assert "95 % survive 10 N in every direction" in lines[-1]


def test_an_evaluation_to_read(run, capsys):
    assert main(["evaluate", str(run), "--cycles", "0.5", "--trials", "4"]) == 0
    said = capsys.readouterr().out
    assert "survived  " in said and "way       - of the reference's pace, - off it" in said


def test_an_export_is_a_valid_take_of_a_player_that_stands(run, capsys, tmp_path):
    from pxr import Usd

    out = tmp_path / "new" / "take.usdc"
    assert main(["export", str(run), "--seconds", "1.5", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert validate(out) == [] and "151 frames at 100 fps, valid USD" in said
    assert "falls     0" in said and "root free" in said
    beside = ["take.html", "take.plots.png", "take.png", "take.usdc"]
    assert sorted(p.name for p in out.parent.iterdir()) == beside
    stage = Usd.Stage.Open(str(out))
    assert not stage.GetPrimAtPath("/World/Ball")
    place = stage.GetPrimAtPath("/World/Player/head").GetAttribute("xformOp:translate")
    assert len(place.GetTimeSamples()) == 151
    assert place.Get(150)[2] > 1.2


def test_an_export_with_a_skin_and_a_fall(run, capsys, tmp_path):
    out = tmp_path / "take.usdc"
    arguments = ["--seconds", "6", "--push", "3000", "--no-html", "--out", str(out)]
    assert main(["export", str(run), *arguments]) == 0
    said = capsys.readouterr().out
    assert "first at" in said and "valid USD" in said
    assert not out.with_suffix(".html").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--iterations", "0"), "--iterations 0: give a number from 1"),
        (("--iterations", "-4"), "--iterations -4"),
        (("--seed", "-1"), "--seed -1"),
        (("--device", "abacus"), "--device abacus: give cpu"),
        (("--data", "nowhere"), "--data nowhere: no such folder"),
        (("--stage", "flying"), "--stage flying: give one of locomotion"),
        (("--workers", "0"), "--workers 0: give a number from 1"),
        (("--set", "sigma=0.1"), "--set sigma=0.1: of which stage? name it with --stage"),
        (
            ("--stage", "locomotion", "--set", "height=3"),
            "'height=3': unknown key 'height'; give another --set",
        ),
    ],
)
def test_what_cannot_be_learned_with(capsys, tmp_path, arguments, said):
    assert said in refused(capsys, "learn", NAME, "--out", tmp_path / "run", *arguments)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("skill", "said"),
    [
        ("moonwalk", "no such skill; there are"),
        ("gone.toml", "no such file"),
        (
            "once.toml",
            "the skill 'mine' is not cyclic, and no ball shows: locomotion is learned on cycles; "
            "take one of those that warpdribble skill list says are",
        ),
        ("lost.toml", "clip: no file 'lost.bvh' in "),
    ],
)
def test_what_cannot_be_learned(capsys, tmp_path, monkeypatch, skill, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "once.toml").write_text('name = "mine"\nauthored = "waist"\nball = false\n')
    (tmp_path / "lost.toml").write_text('name = "mine"\nclip = "lost.bvh"\ncyclic = true\n')
    assert said in refused(capsys, "learn", skill, "--out", "run")
    assert not list(tmp_path.glob("run/*"))


@pytest.mark.parametrize("stage", ["locomotion", "policy"])
def test_legs_are_not_learned_for_what_happens_once(capsys, tmp_path, stage):
    (tmp_path / "once.toml").write_text('name = "mine"\nauthored = "waist"\n')
    said = refused(capsys, "learn", tmp_path / "once.toml", "--stage", stage, "--out", tmp_path / "run")
    assert "'mine' is not cyclic: only the stage ball is for what happens once; give another --stage" in said
    assert not list(tmp_path.glob("run/*"))


def test_a_recording_is_cut_before_it_is_learned(capsys, tmp_path, cmu_clip):
    """What to do is said; `--frames` says which part, also that it is all of it."""
    said = refused(capsys, "learn", cmu_clip, "--out", tmp_path / "run")
    assert "is a recording" in said and ": warpdribble skill draft CLIP --out SKILL.toml makes one" in said
    said = refused(capsys, "learn", tmp_path / "none.bvh", "--out", tmp_path / "run")
    assert "none.bvh: no such file" in said
    assert not list(tmp_path.glob("run/*"))


def test_what_a_skill_s_file_says_is_not_said_beside_it(capsys, tmp_path):
    said = refused(capsys, "learn", NAME, "--frames", "0", "-1", "--cyclic", "--out", tmp_path / "run")
    assert f"--frames and --cyclic: '{NAME}' is a skill, whose file says it" in said


def test_folders_that_are_taken_are_left_alone(run, capsys, tmp_path):
    said = refused(capsys, "learn", "waist", "--out", run)
    assert f'another run: skill.name is "{NAME}" there and "waist" here; give another --out' in said
    (tmp_path / "notes.txt").write_text("mine")
    assert "holds no run (notes.txt)" in refused(capsys, "learn", NAME, "--out", tmp_path)
    said = refused(capsys, "learn", NAME, "--out", tmp_path / "notes.txt")
    assert said.endswith("notes.txt: is a file, not a folder; give another --out\n")
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--cycles", "-3"), "--cycles -3: give a number from 0.1"),
        (("--cycles", "nan"), "--cycles nan"),
        (("--trials", "0"), "--trials 0: give a number from 1"),
        (("--push", "-1"), "--push -1"),
        (("--noise", "-1"), "--noise -1"),
        (("--device", "abacus"), "--device abacus"),
        (("--format", "xml"), "--help"),
    ],
)
def test_what_cannot_be_evaluated_with(run, capsys, arguments, said):
    assert said in refused(capsys, "evaluate", run, *arguments)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--seconds", "0"), "--seconds 0: give a number from 0.05 to 600"),
        (("--seconds", "1e9"), "--seconds 1e+09"),
        (("--push", "-1"), "--push -1"),
        (("--out", "take.fbx"), "name the output with one of"),
        (("--device", "abacus"), "--device abacus"),
    ],
)
def test_what_cannot_be_exported(run, capsys, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    assert said in refused(capsys, "export", run, *arguments)
    assert not [p for p in tmp_path.rglob("*") if p.is_file()]


@pytest.fixture(scope="module")
def networked():
    """A run with a network, and the policy in it."""
    shipped = Run.load(NAME)
    return shipped.folder, shipped.learned(STAGES, "policy").controller


def test_a_network_is_exported_whole(networked, capsys, tmp_path):
    """What the file does is what the run's policy does, in states as it feels them; nothing is simulated."""
    reference = pytest.importorskip("onnx.reference")
    folder, policy = networked
    path = tmp_path / "new" / "policy.onnx"
    assert main(["export", str(folder), "--onnx", str(path)]) == 0
    assert "s (n, 76) float32, k (n,) int64 of 14 fragments -> action (n, 20)" in capsys.readouterr().out
    assert [p.name for p in path.parent.iterdir()] == ["policy.onnx"]
    s = np.random.default_rng(0).normal(0.0, 3.0, (50, 76)).astype(np.float32)
    k = np.arange(50) % 14
    (action,) = reference.ReferenceEvaluator(str(path)).run(None, {"s": s, "k": k})
    np.testing.assert_allclose(action, policy.act(s, k), atol=1e-5)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--stage", "locomotion"), "what locomotion has learned is no network; give another --stage"),
        (("--onnx", "policy.txt"), "name the output with one of .onnx"),
    ],
)
def test_what_is_no_network_file(networked, capsys, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    assert said in refused(capsys, "export", networked[0], "--onnx", "policy.onnx", *arguments)
    assert not list(tmp_path.iterdir())


def test_no_network_without_the_stage_or_the_package(run, networked, capsys, tmp_path, monkeypatch):
    path = tmp_path / "policy.onnx"
    said = refused(capsys, "export", run, "--onnx", path)
    assert "has no policy yet: no policy was learned; warpdribble learn SKILL --out RUN learns one" in said
    monkeypatch.setitem(sys.modules, "onnx", None)
    said = refused(capsys, "export", networked[0], "--onnx", path)
    assert "needs the package 'onnx': pip install 'warpdribble[onnx]'" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["evaluate", "export"])
def test_folders_without_a_policy(capsys, tmp_path, command):
    said = refused(capsys, command, tmp_path / "none")
    assert "no such folder" in said and "warpdribble learn SKILL --out RUN learns one" in said
    said = refused(capsys, command, tmp_path)
    assert "holds no run; give a folder that warpdribble learn wrote" in said


@pytest.mark.parametrize("command", ["evaluate", "export"])
def test_a_stage_that_was_not_learned(run, capsys, command):
    said = refused(capsys, command, run, "--stage", "flying")
    assert f"{run}: there is no stage 'flying'; there are {', '.join(STAGES)}; give another" in said
    said = refused(capsys, command, run, "--stage", "ball")
    assert f"{run}: has no policy yet: no ball was learned" in said


def test_the_number_of_workers_does_not_matter(run, small, capsys, tmp_path):
    """The same policy, to the bit."""
    out = tmp_path / "run"
    assert main(["learn", NAME, *LEGS, "--out", str(out), "--workers", "3"]) == 0
    for name in ("policy.npz", "checkpoint.npz"):
        with np.load(run / "locomotion" / name) as one, np.load(out / "locomotion" / name) as two:
            for key in set(one.files) - {"seconds"}:
                np.testing.assert_array_equal(one[key], two[key], err_msg=key)


def test_a_folder_that_is_being_written_is_refused(run, capsys):
    from warpdribble.learning.runs.files import held

    with held(run):
        said = refused(capsys, "learn", NAME, *LEGS, "--out", run, "--iterations", "9")
    line = said.splitlines()[-1]
    assert re.search(r"is being written by process \d+ on \S+ since [-\d: ]+: wait until it is done; ", line)
    assert line.endswith("give another --out")


def test_another_seed_is_another_run(run, capsys):
    said = refused(capsys, "learn", NAME, "--out", run, "--seed", "4")
    assert "holds another run: seed is 0 there and 4 here; give another --out" in said


def test_a_damaged_checkpoint_is_said(run, capsys, tmp_path):

    shutil.copytree(run, tmp_path / "run")
    (tmp_path / "run" / "locomotion" / "checkpoint.npz").write_bytes(b"PK half")
    said = refused(capsys, "learn", NAME, *LEGS, "--out", tmp_path / "run", "--iterations", "9")
    assert "checkpoint.npz: is damaged" in said
    assert said.endswith("delete it to learn from the start; give another --out\n")


def test_a_cycle_that_is_too_short_is_said(tmp_path, cmu_clip):
    text = f'name = "tick"\nclip = "{cmu_clip}"\nframes = [0, 12]\ncyclic = true\nball = false\n'
    with pytest.raises(ValueError, match="too short"):
        skill_graph(parse_skill(text, "tick.toml"))


@pytest.mark.slow
def test_the_dribble_is_learned(capsys, tmp_path):
    run = tmp_path / "run"
    assert main(["learn", NAME, *LEGS, "--out", str(run), "--iterations", "30"]) == 0
    learned = evaluated(capsys, run, "--cycles", "30", "--trials", "64")
    blind = evaluated(capsys, run, "--cycles", "30", "--trials", "64", "--open-loop")
    assert learned["survived"] >= 48 and learned["survived"] > blind["survived"]
