import os
import subprocess
import sys
from pathlib import Path

import pytest
import warp as wp

from warpdribble.cli import main
from warpdribble.commands import console
from warpdribble.commands.console import _has_card
from warpdribble.commands.output import Outputs, check_outputs
from warpdribble.takes.take import validate

ROOT = Path(__file__).resolve().parents[2]

UNSUPPORTED = """<mujoco><worldbody><body name="a"><freejoint/>
<geom type="sphere" size=".1"/><body><joint type="slide" name="rail"/>
<geom type="sphere" size=".1"/></body></body></worldbody></mujoco>"""
OTHER = """<mujoco><worldbody><body name="thing"><freejoint name="root"/>
<geom type="sphere" size=".1"/></body></worldbody></mujoco>"""


def refused(capsys, tmp_path, *arguments, allowed=()):
    """The one line on stderr of a command that has to fail with status 2 and leave no file."""
    before = {p for p in tmp_path.rglob("*")}
    assert main([str(a) for a in arguments]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and said.startswith("warpdribble: "), said
    assert "Traceback" not in said
    new = {p for p in tmp_path.rglob("*") if p.is_file()} - before
    assert not new - set(allowed)
    return said


def test_missing_clip(capsys, tmp_path):
    said = refused(capsys, tmp_path, "simulate", tmp_path / "no.bvh", "--out", tmp_path / "t.usdc")
    assert "no.bvh" in said and "no such file" in said


def test_broken_clip(capsys, tmp_path, cmu_clip):
    text = cmu_clip.read_text()
    cmu_clip.write_text(text[: len(text) // 2])
    said = refused(capsys, tmp_path, "simulate", cmu_clip, "--out", tmp_path / "t.usdc")
    assert "broken BVH" in said


def test_unknown_joint(capsys, tmp_path, cmu_clip):
    cmu_clip.write_text(cmu_clip.read_text().replace("RightArm", "Elbow"))
    said = refused(capsys, tmp_path, "simulate", cmu_clip, "--out", tmp_path / "t.usdc")
    assert "unknown joints" in said and "RightArm" in said


@pytest.mark.parametrize("frames", [("50", "20"), ("0", "9999"), ("-5", "20")])
def test_wrong_frame_range(capsys, tmp_path, cmu_clip, frames):
    out = tmp_path / "t.usdc"
    said = refused(capsys, tmp_path, "simulate", cmu_clip, "--frames", *frames, "--out", out)
    assert "--frames" in said and "0 to 120" in said


@pytest.mark.parametrize("repeat", ["0", "-3", "many", "2.5", "100000"])
def test_wrong_repeat(capsys, tmp_path, cmu_clip, repeat):
    out = tmp_path / "t.usdc"
    said = refused(capsys, tmp_path, "simulate", cmu_clip, "--repeat", repeat, "--out", out)
    assert "--repeat" in said


@pytest.mark.parametrize("name", ["take.fbx", "take", "file/take.usda", "folder.usda"])
def test_unwritable_output(capsys, tmp_path, name):
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder.usda").mkdir()
    said = refused(capsys, tmp_path, "demo", "--out", tmp_path / name)
    assert name in said


@pytest.mark.parametrize("name", ["t.usda", "t.physics.usda", "t.png", "t.plots.png", "t.html"])
def test_files_that_are_there_are_left_alone(capsys, tmp_path, name):
    """All that a command would write: the take, its layers, and what goes beside it."""
    (tmp_path / name).write_text("mine")
    for command in (("demo",), ("simulate", "waist"), ("export", "waist")):
        said = refused(capsys, tmp_path, *command, "--out", tmp_path / "t.usda")
        assert f"{name}: is there already; give another name, or --overwrite to replace it" in said
    assert (tmp_path / name).read_text() == "mine"


def test_what_is_not_written_is_not_in_the_way(tmp_path):
    (tmp_path / "t.html").write_text("mine")
    (tmp_path / "t.physics.usda").write_text("mine")
    check_outputs(Outputs(out=tmp_path / "t.usdc", html=False))
    check_outputs(Outputs(out=tmp_path / "t.usdc", overwrite=True))


@pytest.mark.parametrize(
    "given",
    [("--frames", "0", "-1"), ("--repair", "toes"), ("--up", "z"), ("--rate", "60"), ("--drop-positions",),
     ("--mapping", "cmu")],
)  # fmt: skip
def test_what_a_skill_s_file_says_is_refused(capsys, tmp_path, given):
    said = refused(capsys, tmp_path, "simulate", "waist", *given, "--out", tmp_path / "t.usdc")
    assert f"{given[0]}: 'waist' is a skill, whose file says it" in said


def test_a_machine_without_cuda_is_silent_and_says_so_where_cuda_is_asked_for(tmp_path):
    """In fresh processes, where Warp begins and its driver is looked for."""
    if wp.is_cuda_available() or _has_card():
        pytest.skip("a card is here")
    command = [sys.executable, "-m", "warpdribble", "simulate", "no.bvh", "--out", str(tmp_path / "t.usdc")]
    calm = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert calm.stderr == "warpdribble: no.bvh: no such file\n"
    asked = subprocess.run(
        [*command, "--device", "cuda"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert asked.returncode == 2 and asked.stderr.count("\n") == 1
    assert "--device cuda: no device 'cuda' here; there are: cpu (" in asked.stderr and "CUDA" in asked.stderr


@pytest.mark.parametrize("card", [False, True])
def test_what_warp_says_of_cuda_is_passed_on_where_it_matters(capsys, monkeypatch, card):
    """Native code writes it to the file behind stderr. That a driver is too old always matters."""
    told = b"Warp CUDA warning: Could not find or load the NVIDIA CUDA driver.\nWarp CUDA error: too old\n"
    monkeypatch.setattr(wp, "init", lambda: os.write(2, told))
    monkeypatch.setattr(console, "_has_card", lambda: card)
    said = console.warp_begins.__wrapped__()
    assert said == "Could not find or load the NVIDIA CUDA driver. too old"
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1] == "Warp CUDA error: too old" and len(lines) == 1 + card


def test_info_says_what_a_report_needs(capsys, monkeypatch, tmp_path):
    from importlib.metadata import version

    monkeypatch.setenv("WARPDRIBBLE_DATA", str(tmp_path))
    assert main(["info"]) == 0
    said = capsys.readouterr().out
    for word in (
        f"warp-lang {version('warp-lang')}",
        f"numpy {version('numpy')}",
        f"of {os.cpu_count()} threads to use",
        "worlds in a register",
        str(wp.config.kernel_cache_dir),
        f"data      {tmp_path} (0 MiB)",
        "cmu: 0 of 20 (warpdribble fetch cmu)",
    ):
        assert word in said
    if not wp.is_cuda_available():
        assert "device    cpu alone" in said


def test_unsupported_model_element(capsys, tmp_path, cmu_clip):
    model = tmp_path / "rail.xml"
    model.write_text(UNSUPPORTED)
    out = tmp_path / "t.usdc"
    said = refused(capsys, tmp_path, "simulate", cmu_clip, "--model", model, "--out", out)
    assert "rail" in said and "not supported" in said


def test_model_without_the_player_s_bodies(capsys, tmp_path, cmu_clip):
    model = tmp_path / "other.xml"
    model.write_text(OTHER)
    out = tmp_path / "t.usdc"
    said = refused(capsys, tmp_path, "simulate", cmu_clip, "--model", model, "--out", out)
    assert "no body 'pelvis'" in said


def test_missing_model(capsys, tmp_path, cmu_clip):
    out = tmp_path / "t.usdc"
    said = refused(capsys, tmp_path, "simulate", cmu_clip, "--model", "no.xml", "--out", out)
    assert "no.xml" in said


def test_unknown_device(capsys, tmp_path):
    said = refused(capsys, tmp_path, "demo", "--device", "abacus", "--out", tmp_path / "t.usdc")
    assert "abacus" in said


def test_a_device_that_is_not_there_is_refused_without_noise(tmp_path):
    command = [sys.executable, "-m", "warpdribble", "demo", "--device", "abacus"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


@pytest.mark.parametrize(
    "arguments",
    [(), ("fly",), ("simulate",), ("demo", "--speed", "3"), ("demo", "--root", "flying")],
)
def test_commands_that_are_not_understood(capsys, tmp_path, arguments):
    assert "--help" in refused(capsys, tmp_path, *arguments)


@pytest.mark.parametrize("arguments", [("--help",), ("simulate", "--help"), ("demo", "-h")])
def test_help_is_given(capsys, arguments):
    assert main(list(arguments)) == 0
    assert "usage: warpdribble" in capsys.readouterr().out


def test_demo_leaves_a_valid_take_and_a_picture(capsys, tmp_path):
    from pxr import Usd

    out = tmp_path / "new" / "demo.usdc"
    assert main(["demo", "--seconds", "1.4", "--out", str(out)]) == 0
    assert validate(out) == []
    beside = ["demo.html", "demo.plots.png", "demo.png", "demo.usdc"]
    assert sorted(p.name for p in out.parent.iterdir()) == beside
    said = capsys.readouterr().out
    for word in ("real time", "tracking", "drift", "falls", "bounces", "next", str(out)):
        assert word in said
    stage = Usd.Stage.Open(str(out))
    assert stage.GetPrimAtPath("/World/Player/Skin/Body_visual")
    start = stage.GetAttributeAtPath("/World/Player/pelvis.xformOp:translate").Get(0)
    assert abs(start[0]) < 1e-6 and abs(start[1]) < 1e-6


def test_a_take_as_asked_for(capsys, tmp_path):
    from pxr import Usd

    out = tmp_path / "as" / "demo.usda"
    arguments = [
        "demo",
        "--seconds",
        "0.7",
        "--no-skin",
        "--usd-joints",
        "d6",
        "--no-html",
        "--out",
        str(out),
    ]
    assert main(arguments) == 0
    assert validate(out) == []
    layers = [f"demo.{name}" for name in ("animation.usdc", "physics.usda", "plots.png", "png", "scene.usdc")]
    assert sorted(p.name for p in out.parent.iterdir()) == [*layers, "demo.usda"]
    stage = Usd.Stage.Open(str(out))
    assert stage.GetPrimAtPath("/World/Player/pelvis/pelvis_visual")
    assert not stage.GetPrimAtPath("/World/Player/Skin")
    assert stage.GetPrimAtPath("/World/Player/Joints/l_hip").GetTypeName() == "PhysicsJoint"
    assert "replay" not in capsys.readouterr().out


def test_unknown_joints(capsys, tmp_path):
    said = refused(capsys, tmp_path, "demo", "--usd-joints", "rubber", "--out", tmp_path / "t.usdc")
    assert "--help" in said


def test_a_clip_becomes_a_valid_take(capsys, tmp_path, cmu_clip):
    out = tmp_path / "out" / "take.usdz"
    arguments = ["simulate", cmu_clip, "--frames", "0", "120", "--repeat", "2", "--root", "tracked"]
    assert main([str(a) for a in [*arguments, "--out", out]]) == 0
    assert validate(out) == []
    said = capsys.readouterr().out
    assert "lost bone lengths" in said and "root tracked" in said


def test_the_module_runs_as_a_program(tmp_path):
    command = [sys.executable, "-m", "warpdribble", "simulate", "nowhere.bvh"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == "warpdribble: nowhere.bvh: no such file\n"


@pytest.mark.parametrize("both", [False, True])
@pytest.mark.parametrize("arguments", [("skill", "list"), ("simulate", "--help"), ("bench", "--help")])
def test_where_nobody_reads_on_a_command_ends_without_a_word(arguments, both):
    """As behind `| head`, and `2>&1 | head`: the status is a shell's for SIGPIPE."""
    unread, pipe = os.pipe()
    os.close(unread)
    command = [sys.executable, "-m", "warpdribble", *arguments]
    stderr = pipe if both else subprocess.PIPE
    done = subprocess.run(command, cwd=ROOT, stdout=pipe, stderr=stderr, text=True, check=False)
    os.close(pipe)
    assert (done.returncode, done.stderr or "") == (141, "")


def test_a_mistake_is_said_and_counts_though_nobody_reads_the_output():
    unread, pipe = os.pipe()
    os.close(unread)
    command = [sys.executable, "-m", "warpdribble", "fly"]
    done = subprocess.run(command, cwd=ROOT, stdout=pipe, stderr=subprocess.PIPE, text=True, check=False)
    os.close(pipe)
    assert done.returncode == 2 and "--help" in done.stderr


def test_a_pipe_that_is_not_the_output_is_said(capsys, monkeypatch):
    def broken(self):
        raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr("warpdribble.commands.skill.List.run", broken)
    assert main(["skill", "list"]) == 2
    assert capsys.readouterr().err == "warpdribble: [Errno 32] Broken pipe\n"
