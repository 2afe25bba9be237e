"""A stage that is one file and one line: learned, killed and resumed, evaluated and exported by the commands,
as those that ship."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.learning.runs.walker import arrays, assert_same
from tests.learning.toy import TOY, Armed, LegsAndArms
from warpdribble.assets import path as asset
from warpdribble.cli import main
from warpdribble.learning.methods import STAGES
from warpdribble.learning.runs.folder import Run

ROOT = Path(__file__).resolve().parents[2]
NAME = "dribble-right-authored"
SEEDED = random.Random(4)

COMMAND = """
import sys
from tests.learning.toy import TOY
from warpdribble.cli import main
from warpdribble.learning.methods import STAGES
STAGES["toy"] = TOY
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    monkeypatch.setitem(STAGES, "toy", TOY)


def below(folder):
    """A run in which locomotion has been learned."""
    shutil.copytree(asset("controllers") / NAME, folder)
    return folder


def learning(folder, iterations):
    return ["learn", NAME, "--out", str(folder), "--stage", "toy", "--iterations", str(iterations)]


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    folder = below(tmp_path_factory.mktemp("toy") / "run")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(STAGES, "toy", TOY)
        assert main(learning(folder, 30)) == 0
    return folder


def test_it_is_learned_beside_what_it_stands_on(learned):
    assert sorted(p.name for p in (learned / "toy").iterdir()) == [
        "checkpoint.npz",
        "config.json",
        "needs-locomotion.npz",
        "policy.npz",
        "progress.csv",
        "tensorboard",
    ]
    for file in (asset("controllers") / NAME / "locomotion").iterdir():
        assert (learned / "locomotion" / file.name).read_bytes() == file.read_bytes()
    one = Run.load(learned).learned(STAGES)
    assert one.stage is TOY and one.iteration == 30
    assert isinstance(one.controller, LegsAndArms) and isinstance(one.task(2), Armed)
    assert one.controller.arms.any() and one.task(2).actions > 11


def test_it_keeps_what_it_stood_on(learned, tmp_path):
    """Locomotion that is learned on afterwards changes neither what goes on nor what is tried."""
    run = tmp_path / "run"
    shutil.copytree(learned, run)
    policy = run / "locomotion" / "policy.npz"
    with np.load(policy) as file:
        other = {name: file[name] for name in file.files}
    np.savez(policy, **other | {"a_hat": other["a_hat"] + 0.1})
    legs = Run.load(run).learned(STAGES).controller.legs
    np.testing.assert_array_equal(legs.a_hat, other["a_hat"])


def test_killed_it_goes_on_by_the_same_command_to_the_same_bits(learned, tmp_path):
    killed = below(tmp_path / "killed")
    path, environment = killed / "toy" / "checkpoint.npz", os.environ | {"PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, *learning(killed, 30)], env=environment, stdout=subprocess.DEVNULL
    )
    deadline = time.monotonic() + 120.0
    while not path.exists():
        assert process.poll() is None and time.monotonic() < deadline, "nothing was saved"
        time.sleep(0.005)
    time.sleep(SEEDED.uniform(0.0, 0.3))
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert 0 < int(arrays(path)["iteration"]) < 30
    assert main(learning(killed, 30)) == 0
    assert_same(killed / "toy", learned / "toy")


def evaluated(capsys, folder, *arguments):
    capsys.readouterr()
    few = ["--cycles", "10", "--trials", "32", "--noise", "0", "--format", "json"]
    assert main(["evaluate", str(folder), *few, *arguments]) == 0
    return json.loads(capsys.readouterr().out)


def test_it_is_evaluated_and_better_than_without(learned, capsys):
    """From other states than it was learned from, each a random one."""
    toy, legs = (evaluated(capsys, learned, "--stage", name) for name in ("toy", "locomotion"))
    assert (toy["stage"], toy["iterations"], legs["stage"]) == ("toy", 30, "locomotion")
    assert toy["survived"] == legs["survived"] == 32
    assert toy["cost"] < 0.97 * legs["cost"]
    assert evaluated(capsys, learned)["stage"] == "toy"
    disturbed = evaluated(capsys, learned, "--push", "100", "--arms", "0.2", "--hands", "10")
    assert disturbed["cost"] > toy["cost"]


def test_it_is_exported(learned, capsys, tmp_path):
    from warpdribble.takes import validate

    out = tmp_path / "take.usdc"
    assert main(["export", str(learned), "--stage", "toy", "--seconds", "1", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert validate(out) == [] and "101 frames at 100 fps, valid USD" in said and "falls     0" in said
    assert "learned in 30 iterations" in said


def test_without_what_it_stands_on_it_is_refused(capsys, tmp_path):
    run = below(tmp_path / "run")
    (run / "locomotion" / "policy.npz").unlink()
    assert main(learning(run, 2)) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said == (
        f"warpdribble: {run}: toy starts from what locomotion has learned, and there is nothing yet; "
        "learn that one first, with --stage"
    )
    assert not (run / "toy").exists()


def test_its_search_never_gets_worse(learned):
    table = np.genfromtxt(learned / "toy" / "progress.csv", delimiter=",", names=True)
    assert (np.diff(table["cost"]) <= 0.0).all() and table["cost"][-1] < table["cost"][0]
