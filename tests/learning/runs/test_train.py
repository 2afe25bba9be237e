"""Learning in a folder: what is written when, and that a run that was stopped, whenever and however, goes on
as if it had not been."""

import json
import os
import random
import re
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.learning.runs.walker import (
    SKILL,
    STAGE,
    Steps,
    Walker,
    WalkerConfig,
    arrays,
    assert_same,
    events,
    rows,
    walk,
)
from warpdribble.learning.methods import STAGES
from warpdribble.learning.methods.samcon import SamconConfig
from warpdribble.learning.runs import train as training
from warpdribble.learning.runs.folder import Run
from warpdribble.learning.runs.log import read_rows
from warpdribble.learning.runs.train import train
from warpdribble.sims.errors import InputError
from warpdribble.skills.graph import skill_fields, skill_graph, skill_text
from warpdribble.skills.skill import read_skill

ROOT = Path(__file__).resolve().parents[3]
NAME = "dribble-right-authored"
TINY = SamconConfig(iterations=4, islands=2, particles=16, walk=40, check_every=2, trials=16)
TIMES = ("samples_per_second", "outside")
SEEDED = random.Random(8)


def learn(folder, iterations=None, config=TINY, **how):
    """Locomotion, in a run of its own."""
    skill = read_skill(NAME)
    run = Run.begin(folder, skill_fields(skill), how.pop("seed", 0))
    run.keep(skill_text(skill), lambda: skill_graph(skill)[0])
    return train(run, STAGES["locomotion"], config, iterations=iterations, **how)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Locomotion of four iterations that nothing interrupted."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    learn(folder)
    return folder


# --------------------------------------------------------------------------------------- what is written


def test_what_a_run_holds(whole):
    info = json.loads((whole / "run.json").read_text())
    assert info["skill"]["name"] == NAME and info["seed"] == 0
    config = json.loads((whole / "locomotion" / "config.json").read_text())
    assert config["disturbance"]["push"] == TINY.disturbance.push and config["weights"]["pose"] == 5.0
    assert (whole / "skill.toml").read_text() == skill_text(read_skill(NAME))
    table = read_rows(whole / "locomotion")
    assert [row["iteration"] for row in table] == [1, 2, 3, 4]
    assert np.isfinite([row["survived"] for row in table]).tolist() == [False, True, False, True]
    assert np.all(np.diff([0.0] + [row["seconds"] for row in table]) > 0.0)
    assert sorted(p.name for p in whole.iterdir()) == ["graph.npz", "locomotion", "run.json", "skill.toml"]
    inside = ["checkpoint.npz", "config.json", "policy.npz", "progress.csv", "tensorboard"]
    assert sorted(p.name for p in (whole / "locomotion").iterdir()) == inside


def test_tensorboard_reads_what_the_table_has(whole):
    table, found = read_rows(whole / "locomotion"), dict(events(whole / "locomotion", "cost"))
    assert found == pytest.approx({row["iteration"]: row["cost"] for row in table})
    assert [step for step, _ in events(whole / "locomotion", "survived")] == [2, 4]


def test_a_stage_has_a_folder_of_its_own(whole, tmp_path):
    """A second stage of a run leaves the first as it is."""
    learn(tmp_path / "run")
    train(Run.load(tmp_path / "run"), STAGE)
    assert_same(tmp_path / "run" / "locomotion", whole / "locomotion", *TIMES)
    assert [row["iteration"] for row in rows(tmp_path / "run" / "walker")] == [1, 2, 3, 4]


def test_without_tensorboard_the_table_is_written(tmp_path, graph, monkeypatch):
    """And once the package is there, the same again writes its files, also of a run that is done."""
    for name in [n for n in sys.modules if n.split(".")[0] == "tensorboard"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "tensorboard", None)
    folder = tmp_path / "run"
    assert not walk(folder, graph, iterations=2).has_events
    assert not walk(folder, graph, iterations=2).has_events
    assert len(read_rows(folder / "walker")) == 2 and not (folder / "walker" / "tensorboard").exists()
    monkeypatch.undo()
    assert walk(folder, graph, iterations=2).has_events
    assert [step for step, _ in events(folder / "walker", "value")] == [1, 2]
    assert walk(folder, graph, iterations=3).has_events
    assert [step for step, _ in events(folder / "walker", "value")] == [1, 2, 3]


def test_another_seed_learns_another_policy(whole, tmp_path):
    learn(tmp_path / "run", seed=1, iterations=2)
    one, two = (arrays(f / "locomotion" / "checkpoint.npz") for f in (tmp_path / "run", whole))
    assert not np.array_equal(one["policy.M"], two["policy.M"])


def test_what_is_said_as_it_goes(tmp_path, graph):
    said = []
    done = walk(
        tmp_path / "run",
        graph,
        made=lambda learner, config: said.append((learner.iteration, config.iterations)),
        progress=lambda report: said.append((report.iteration, report.fresh)),
    )
    assert said == [(0, 4), (1, False), (2, True), (3, False), (4, True)] and done.iterations == 4
    said.clear()
    made = walk(tmp_path / "run", graph, iterations=5, made=lambda *both: said.append(both[0].iteration))
    assert said == [4] and made.iterations == 5


# ---------------------------------------------------------------------------------------- how often


def kept(folder, graph, **stage):
    """The iteration in the checkpoint, 0 for none, after each one."""
    seen, path = [], folder / "walker" / "checkpoint.npz"
    rare = WalkerConfig(iterations=8, check_every=100)

    def look(report):
        seen.append(int(arrays(path)["iteration"]) if path.exists() else 0)

    walk(folder, graph, replace(STAGE, **stage), config=rare, progress=look)
    assert len(rows(folder / "walker")) == 8
    return seen


@pytest.mark.parametrize(
    ("iterations", "expected"),
    [(1, [1, 2, 3, 4, 5, 6, 7, 8]), (3, [0, 0, 3, 3, 3, 6, 6, 8]), (1000, [0] * 7 + [8])],
)
def test_checkpoints_by_iterations(tmp_path, graph, iterations, expected):
    assert kept(tmp_path, graph, save_iterations=iterations, save_seconds=1e9) == expected


def test_checkpoints_by_time(tmp_path, graph, monkeypatch):
    """Every 10 s, an iteration being 4; a stage that has no patience saves every one."""
    now = [0.0]

    class Clock:
        @staticmethod
        def perf_counter():
            return now[0]

    def iterate(self, plain=Walker.iterate):
        now[0] += 4.0
        return plain(self)

    monkeypatch.setattr(training, "time", Clock)
    monkeypatch.setattr(Walker, "iterate", iterate)
    slow = {"save_iterations": 1000, "save_seconds": 10.0}
    assert kept(tmp_path / "slow", graph, **slow) == [0, 0, 3, 3, 3, 6, 6, 8]
    assert [row["seconds"] for row in read_rows(tmp_path / "slow" / "walker")] == [
        4.0 * n for n in range(1, 9)
    ]
    none = {"save_iterations": 1000, "save_seconds": 0.0}
    assert kept(tmp_path / "none", graph, **none) == list(range(1, 9))


def test_a_result_that_was_tried_is_saved_at_once(tmp_path, graph):
    """With its checkpoint: learning goes on from what the result is of."""
    seen, folder = [], tmp_path / "walker"

    def look(report):
        there = [name for name in ("policy.npz", "checkpoint.npz") if (folder / name).exists()]
        seen.append([int(arrays(folder / name)["iteration"]) for name in there])

    rare = replace(STAGE, save_iterations=1000, save_seconds=1e9)
    walk(tmp_path, graph, rare, config=WalkerConfig(iterations=7, check_every=3), progress=look)
    assert seen == [[], [], [3, 3], [3, 3], [3, 3], [6, 6], [6, 7]]


# --------------------------------------------------------------------------------------- interrupted


class Stop(BaseException):
    """Stands for the end of the process."""


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError, Stop])
@pytest.mark.parametrize("at", [0, 1, 5])
def test_an_interrupted_iteration_leaves_the_last_whole_one(tmp_path, graph, monkeypatch, error, at):
    """However seldom the stage saves."""
    rare, longer = replace(STAGE, save_iterations=1000, save_seconds=1e9), WalkerConfig(8, 100)
    walk(tmp_path / "whole", graph, rare, config=longer)

    def iterate(self, plain=Walker.iterate):
        report = plain(self)
        if report.iteration == at + 1:
            raise error
        return report

    with monkeypatch.context() as patch:
        patch.setattr(Walker, "iterate", iterate)
        with pytest.raises(error):
            walk(tmp_path / "cut", graph, rare, config=longer)
    path = tmp_path / "cut" / "walker" / "checkpoint.npz"
    assert (int(arrays(path)["iteration"]) if path.exists() else 0) == at
    assert not (tmp_path / "cut" / "lock").exists()
    walk(tmp_path / "cut", graph, rare, config=longer)
    for name in ("value", "iteration"):
        one, two = (arrays(tmp_path / f / "walker" / "checkpoint.npz")[name] for f in ("cut", "whole"))
        np.testing.assert_array_equal(one, two)
    np.testing.assert_equal(rows(tmp_path / "cut" / "walker"), rows(tmp_path / "whole" / "walker"))


def test_whoever_looks_on_may_interrupt(tmp_path, graph):
    walk(tmp_path / "whole", graph, iterations=4)

    def stops(report):
        if report.iteration == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        walk(tmp_path / "cut", graph, iterations=4, progress=stops)
    assert int(arrays(tmp_path / "cut" / "walker" / "checkpoint.npz")["iteration"]) == 3
    walk(tmp_path / "cut", graph, iterations=4)
    assert_same(tmp_path / "cut" / "walker", tmp_path / "whole" / "walker")


def test_it_may_stop_before_any_file_is_replaced(tmp_path, graph, monkeypatch):
    replace_file, points = os.replace, 0

    def counting(a, b):
        nonlocal points
        points += 1
        replace_file(a, b)

    monkeypatch.setattr(os, "replace", counting)
    walk(tmp_path / "whole", graph)
    assert points >= 10
    for last in range(points):
        left = iter(range(last))

        def stopping(a, b, left=left):
            if next(left, None) is None:
                raise Stop
            replace_file(a, b)

        monkeypatch.setattr(os, "replace", stopping)
        with pytest.raises(Stop):
            walk(tmp_path / str(last), graph)
        monkeypatch.setattr(os, "replace", replace_file)
        walk(tmp_path / str(last), graph)
        assert_same(tmp_path / str(last) / "walker", tmp_path / "whole" / "walker")


def test_more_iterations_extend_a_finished_run(whole, tmp_path):
    learn(tmp_path / "run", iterations=2)
    assert learn(tmp_path / "run", config=None).iterations == 2
    learn(tmp_path / "run", iterations=4)
    assert_same(tmp_path / "run" / "locomotion", whole / "locomotion", *TIMES)
    assert learn(tmp_path / "run", iterations=3).iterations == 4
    assert json.loads((tmp_path / "run" / "locomotion" / "config.json").read_text())["iterations"] == 4


def test_rows_and_temporary_files_beyond_the_checkpoint_are_dropped(tmp_path, graph):
    walk(tmp_path / "whole", graph)
    walk(tmp_path / "run", graph, iterations=2)
    later = (tmp_path / "whole" / "walker" / "progress.csv").read_text().splitlines()[3]
    assert later.startswith("3,")
    folder = tmp_path / "run" / "walker"
    with open(folder / "progress.csv", "a") as file:
        file.write(f"{later}\n4,0.3")
    for left in (folder / ".part-1", tmp_path / "run" / ".part-2"):
        left.mkdir()
        (left / "checkpoint.npz").write_bytes(b"half")
    walk(tmp_path / "run", graph, iterations=4)
    assert_same(folder, tmp_path / "whole" / "walker")
    assert not list((tmp_path / "run").rglob(".part*"))


def test_another_number_of_workers_may_go_on(whole, tmp_path):
    """To the bit."""
    learn(tmp_path / "run", iterations=2, workers=2)
    learn(tmp_path / "run", iterations=4, workers=4)
    assert_same(tmp_path / "run" / "locomotion", whole / "locomotion", *TIMES)


# -------------------------------------------------------------------------------------------- killed

LEARN = """
import sys
from tests.learning.runs.test_train import learn
learn(sys.argv[1], int(sys.argv[2]), workers=int(sys.argv[3]))
"""


def begin(folder, iterations, workers=1, code=LEARN, **how):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code, str(folder), str(iterations), str(workers)]
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, **how)


def wait_for(process, true, what):
    deadline = time.monotonic() + 120.0
    while not true():
        assert process.poll() is None and time.monotonic() < deadline, f"the learner did not {what}"
        time.sleep(0.005)


def kill_in_the_middle(folder, iterations, delay, workers=1):
    """Learn in a process that is killed some time after it has saved something new."""
    path = folder / "locomotion" / "checkpoint.npz"
    before = path.stat().st_mtime_ns if path.exists() else 0
    process = begin(folder, iterations, workers)
    wait_for(process, lambda: path.exists() and path.stat().st_mtime_ns != before, "save anything")
    time.sleep(delay)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert (folder / "lock").exists()  # and yet nobody holds it
    assert int(arrays(path)["iteration"]) < iterations


def test_a_killed_run_goes_on_as_if_it_had_not_been(tmp_path):
    kill_in_the_middle(tmp_path / "killed", 12, SEEDED.uniform(0.0, 0.3), workers=2)
    learn(tmp_path / "killed", 12)
    learn(tmp_path / "whole", 12)
    assert_same(tmp_path / "killed" / "locomotion", tmp_path / "whole" / "locomotion", *TIMES)
    assert not (tmp_path / "killed" / "lock").exists()


@pytest.mark.slow
def test_a_run_killed_many_times_goes_on_as_if_it_had_not_been(tmp_path):
    for workers in (1, 2, 4, 1):
        kill_in_the_middle(tmp_path / "killed", 60, SEEDED.uniform(0.0, 0.6), workers)
    learn(tmp_path / "killed", 60)
    learn(tmp_path / "whole", 60)
    assert_same(tmp_path / "killed" / "locomotion", tmp_path / "whole" / "locomotion", *TIMES)


# --------------------------------------------------------------------------------------- two at once

HOLD = """
import sys, time
from tests.learning.runs.walker import walk
def wait(report):
    print(report.iteration, flush=True)
    sys.stdin.read()
walk(sys.argv[1], None, iterations=int(sys.argv[2]), progress=wait)
"""


def test_a_second_process_is_refused_by_name_of_the_first(tmp_path, graph):
    """Host, process and time; the first ends as if nothing had been, and then the second may go on."""
    run = Run.begin(tmp_path / "run", SKILL)
    run.keep("", lambda: graph)
    first = begin(tmp_path / "run", 2, code=HOLD, stdin=subprocess.PIPE)
    wait_for(first, lambda: (tmp_path / "run" / "walker" / "checkpoint.npz").exists(), "begin")
    before = {p: p.read_bytes() for p in (tmp_path / "run").rglob("*") if p.is_file()}
    said = rf"run: is being written by process {first.pid} on {re.escape(socket.gethostname())} since 20..-"
    with pytest.raises(InputError, match=said) as error:
        walk(tmp_path / "run", graph, iterations=2)
    assert error.value.hint == "out"
    assert {p: p.read_bytes() for p in (tmp_path / "run").rglob("*") if p.is_file()} == before
    first.communicate(timeout=60)
    assert first.returncode == 0 and not (tmp_path / "run" / "lock").exists()
    walk(tmp_path / "run", graph, iterations=3)
    walk(tmp_path / "whole", graph, iterations=3)
    assert_same(tmp_path / "run" / "walker", tmp_path / "whole" / "walker")


def test_a_second_start_in_the_same_process_is_refused_too(tmp_path, graph):
    refused = []

    def again(report):
        with pytest.raises(InputError, match=f"is being written by process {os.getpid()} on "):
            walk(tmp_path / "run", graph)
        refused.append(report.iteration)

    walk(tmp_path / "run", graph, progress=again)
    assert refused == [1, 2, 3, 4]
    walk(tmp_path / "whole", graph)
    assert_same(tmp_path / "run" / "walker", tmp_path / "whole" / "walker")


def test_a_second_start_while_the_graph_is_made_is_refused(tmp_path, graph):
    """And leaves what the first is writing."""

    def make():
        (tmp_path / "run" / ".part-first").mkdir()
        with pytest.raises(InputError, match="is being written by"):
            walk(tmp_path / "run", graph)
        assert (tmp_path / "run" / ".part-first").exists()
        return graph

    run = Run.begin(tmp_path / "run", SKILL)
    run.keep("", make)
    assert run.begun


def test_whoever_looks_at_a_run_that_is_learned_disturbs_nothing(tmp_path, graph):
    """Loading it and trying its result, at any moment."""
    seen = []

    def look(report):
        if report.iteration >= 2:
            seen.append(Run.load(tmp_path / "run").learned({"walker": STAGE}).iteration)

    walk(tmp_path / "run", graph, progress=look)
    assert seen == [2, 2, 4]


# ----------------------------------------------------------------------------------- one run's own


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (WalkerConfig(check_every=3), "walker: holds another run: check_every is 2 there and 3 here"),
        (WalkerConfig(steps=Steps(size=2.0)), r"holds another run: steps\.size is 1\.0 there and 2\.0 here"),
        (WalkerConfig(ways=(1, 2)), r"holds another run: ways is \[1, -1\] there and \[1, 2\] here"),
    ],
)
def test_a_stage_with_other_parameters_is_refused(tmp_path, graph, asked, said):
    walk(tmp_path / "run", graph, iterations=2)
    with pytest.raises(InputError, match=said) as error:
        walk(tmp_path / "run", graph, config=asked)
    assert error.value.hint == "out" and not (tmp_path / "run" / "lock").exists()
    walk(tmp_path / "run", graph, config=WalkerConfig(iterations=99), iterations=3)
    assert len(rows(tmp_path / "run" / "walker")) == 3


def test_a_stage_that_stands_on_another_wants_it_first(tmp_path, graph):
    above = replace(STAGE, name="above", needs=("walker",), make=Above)
    run = Run.begin(tmp_path / "run", SKILL)
    run.keep("", lambda: graph)
    with pytest.raises(InputError, match="above starts from what walker has learned") as error:
        train(run, above)
    assert error.value.hint == "needs"
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == ["graph.npz", "run.json", "skill.toml"]
    train(run, STAGE)
    train(run, above)
    started = arrays(tmp_path / "run" / "walker" / "policy.npz")["value"]
    assert (
        rows(tmp_path / "run" / "above")[0]["value"]
        == started + rows(tmp_path / "run" / "walker")[0]["value"]
    )


class Above(Walker):
    """Walks on from where the one below it has come, and keeps a file of its own."""

    def __init__(self, context):
        super().__init__(context)
        assert context.folder.is_dir()
        self.value = float(context.needs["walker"]["value"])
