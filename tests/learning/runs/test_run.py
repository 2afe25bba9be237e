import json
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from warpdribble.learning.evaluate.record import record
from warpdribble.learning.methods.samcon import SamconConfig
from warpdribble.learning.runs import folder as runs
from warpdribble.learning.runs.folder import Run, RunConfig, RunFolder
from warpdribble.learning.runs.log import read_rows
from warpdribble.skills.graph import skill_fields, skill_graph, skill_text
from warpdribble.skills.skill import read_skill

ROOT = Path(__file__).resolve().parents[3]
NAME = "dribble-right-authored"
TINY = SamconConfig(iterations=4, islands=2, particles=16, walk=40, check_every=2)
CONFIG = RunConfig(skill=skill_fields(read_skill(NAME)), samcon=TINY, trial_worlds=16)
TIMES = ("samples_per_second", "outside", "seconds")

LEARN = """
import sys
from dataclasses import replace
from test_run import CONFIG, learn
learn(sys.argv[1], CONFIG, iterations=int(sys.argv[2]))
"""


@cache
def make_graph():
    return skill_graph(read_skill(NAME))[0]


def learn(folder, config=CONFIG, iterations=None):
    """Learn in a folder as the command does."""
    kept = RunFolder(folder, config, iterations)
    graph = kept.graph(skill_text(NAME), make_graph)
    samcon = kept.samcon(graph)
    kept.learn(samcon)
    return samcon


def arrays(path):
    with np.load(path) as file:
        return {name: file[name] for name in file.files if name != "seconds"}


def rows(folder):
    return [{k: v for k, v in row.items() if k not in TIMES} for row in read_rows(folder)]


def steps(folder, tag):
    """(step, value) pairs as TensorBoard reads them."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(folder / "tensorboard"))
    events.Reload()
    return [(event.step, event.value) for event in events.Scalars(tag)]


def assert_same(a, b):
    for name in ("checkpoint.npz", "policy.npz", "graph.npz"):
        first, second = arrays(a / name), arrays(b / name)
        assert first.keys() == second.keys()
        for key in first:
            np.testing.assert_array_equal(first[key], second[key], f"{name} {key}")
    np.testing.assert_equal(rows(a), rows(b))
    for tag in ("cost", "sigma", "survived"):
        assert steps(a, tag) == steps(b, tag)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run of four iterations that nothing interrupted."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    learn(folder)
    return folder


def test_what_a_run_holds(whole):
    config = json.loads((whole / "config.json").read_text())
    assert config["skill"]["name"] == NAME and config["stage"] == "locomotion"
    assert config["samcon"]["disturbance"]["push"] == TINY.disturbance.push
    assert (whole / "skill.toml").read_text() == skill_text(NAME)
    table = read_rows(whole)
    assert [row["iteration"] for row in table] == [1, 2, 3, 4]
    assert np.isfinite([row["survived"] for row in table]).tolist() == [False, True, False, True]
    assert np.all(np.diff([0.0] + [row["seconds"] for row in table]) > 0.0)
    assert not [p.name for p in whole.iterdir() if p.name.startswith(".")]


def test_tensorboard_reads_what_the_table_has(whole):
    table = read_rows(whole)
    assert dict(steps(whole, "cost")) == pytest.approx({row["iteration"]: row["cost"] for row in table})
    assert [step for step, _ in steps(whole, "survived")] == [2, 4]


def test_without_tensorboard_the_table_is_written(tmp_path, monkeypatch):
    for name in [n for n in sys.modules if n.split(".")[0] == "tensorboard"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "tensorboard", None)
    kept = RunFolder(tmp_path / "run", CONFIG, 1)
    samcon = kept.samcon(kept.graph(skill_text(NAME), make_graph))
    assert kept.learn(samcon) is False
    assert len(read_rows(tmp_path / "run")) == 1
    assert not (tmp_path / "run" / "tensorboard").exists()
    monkeypatch.undo()
    learn(tmp_path / "run", iterations=2)
    assert [step for step, _ in steps(tmp_path / "run", "cost")] == [1, 2]


def test_the_best_policy_comes_back_without_the_clip(whole, monkeypatch):
    monkeypatch.setattr("warpdribble.skills.graph.skill_graph", None)
    run = Run.load(whole)
    stored = arrays(whole / "checkpoint.npz")
    assert np.array_equal(run.policy.M, stored["best.M"]) and run.iteration == 4
    assert run.policy.M.any() or run.policy.a_hat.any()
    assert run.graph.count == len(run.policy.M) and len(run.states) == len(stored["best_states.k"])
    assert run.task(2).weights == CONFIG.weights


def test_another_seed_learns_another_policy(whole, tmp_path):
    learn(tmp_path / "run", replace(CONFIG, seed=1))
    assert not np.array_equal(
        arrays(tmp_path / "run" / "checkpoint.npz")["policy.M"], arrays(whole / "checkpoint.npz")["policy.M"]
    )


def begin(folder, iterations):
    code = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n{LEARN}"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code, str(folder), str(iterations)]
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)


def kill_in_the_middle(folder, iterations, delay):
    """Learn in a process that is killed some time after it has saved something new."""
    path = folder / "checkpoint.npz"
    before = path.stat().st_mtime_ns if path.exists() else 0
    process = begin(folder, iterations)
    deadline = time.monotonic() + 60.0
    while not (path.exists() and path.stat().st_mtime_ns != before):
        assert process.poll() is None and time.monotonic() < deadline, "the learner did not save anything"
        time.sleep(0.005)
    time.sleep(delay)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert int(arrays(path)["iteration"]) < iterations


def test_a_killed_run_goes_on_as_if_it_had_not_been(tmp_path):
    kill_in_the_middle(tmp_path / "killed", 10, random.uniform(0.0, 0.4))
    learn(tmp_path / "killed", iterations=10)
    learn(tmp_path / "whole", iterations=10)
    assert_same(tmp_path / "killed", tmp_path / "whole")


@pytest.mark.slow
def test_a_run_killed_many_times_goes_on_as_if_it_had_not_been(tmp_path):
    for _ in range(4):
        kill_in_the_middle(tmp_path / "killed", 60, random.uniform(0.0, 0.6))
    learn(tmp_path / "killed", iterations=60)
    learn(tmp_path / "whole", iterations=60)
    assert_same(tmp_path / "killed", tmp_path / "whole")


class Stop(BaseException):
    """Stands for the end of the process."""


def test_it_may_stop_before_any_file_is_replaced(tmp_path, monkeypatch):
    replace_file, points = os.replace, 0

    def counting(a, b):
        nonlocal points
        points += 1
        replace_file(a, b)

    monkeypatch.setattr(os, "replace", counting)
    learn(tmp_path / "whole", iterations=2)
    assert points >= 8
    for last in range(points):
        left = iter(range(last))

        def stopping(a, b, left=left):
            if next(left, None) is None:
                raise Stop
            replace_file(a, b)

        monkeypatch.setattr(os, "replace", stopping)
        with pytest.raises(Stop):
            learn(tmp_path / str(last), iterations=2)
        monkeypatch.setattr(os, "replace", replace_file)
        learn(tmp_path / str(last), iterations=2)
        assert_same(tmp_path / str(last), tmp_path / "whole")


def test_more_iterations_extend_a_finished_run(whole, tmp_path):
    learn(tmp_path / "run", iterations=2)
    kept = RunFolder(tmp_path / "run", CONFIG)
    assert kept.config.samcon.iterations == 2
    learn(tmp_path / "run", iterations=4)
    assert_same(tmp_path / "run", whole)
    learn(tmp_path / "run", iterations=3)
    assert json.loads((tmp_path / "run" / "config.json").read_text())["samcon"]["iterations"] == 4


def test_rows_and_temporary_files_beyond_the_checkpoint_are_dropped(whole, tmp_path):
    learn(tmp_path / "run", iterations=2)
    with open(tmp_path / "run" / "progress.csv", "a") as file:
        file.write(rest := (whole / "progress.csv").read_text().splitlines()[3] + "\n4,0.3")
    assert rest.startswith("3,")
    (tmp_path / "run" / ".part-checkpoint.npz").write_bytes(b"half")
    learn(tmp_path / "run", iterations=4)
    assert_same(tmp_path / "run", whole)


@pytest.mark.parametrize(
    ("config", "said"),
    [
        (replace(CONFIG, seed=3), r"seed is 0 there and 3 here"),
        (replace(CONFIG, samcon=replace(TINY, lag=9)), r"samcon\.lag is 12 there and 9 here"),
        (
            replace(CONFIG, skill=CONFIG.skill | {"name": "walk"}),
            r'skill\.name is "dribble-right-authored" there',
        ),
        (replace(CONFIG, skill=CONFIG.skill | {"speed": 2}), r"skill\.speed is missing there and 2 here"),
    ],
)
def test_a_folder_with_another_run_is_refused(whole, config, said):
    with pytest.raises(ValueError, match=rf"holds another run: {said}.*give another --out"):
        RunFolder(whole, config)


def test_an_older_version_may_go_on(whole):
    assert RunFolder(whole, replace(CONFIG, version="9.9")).begun


@pytest.fixture
def own(whole, tmp_path):
    """A copy of the run, to be spoilt."""
    import shutil

    shutil.copytree(whole, tmp_path / "own")
    return tmp_path / "own"


def spoil(path, how):
    data = path.read_bytes()
    if how == "truncated":
        path.write_bytes(data[: len(data) // 2])
    elif how == "empty":
        path.write_bytes(b"")
    else:
        middle = len(data) // 2
        path.write_bytes(data[:middle] + bytes([data[middle] ^ 0xFF]) + data[middle + 1 :])


@pytest.mark.parametrize("how", ["truncated", "empty", "flipped"])
def test_a_damaged_checkpoint_is_said(own, how):
    spoil(own / "checkpoint.npz", how)
    kept = RunFolder(own, CONFIG)
    with pytest.raises(
        ValueError, match=r"checkpoint\.npz is damaged .*delete it .* or give another"
    ) as error:
        kept.samcon(kept.graph("", None))
    assert "\n" not in str(error.value)


def test_a_checkpoint_of_another_graph_is_said(own):
    stored = dict(np.load(own / "checkpoint.npz"))
    np.savez(own / "checkpoint.npz", **stored | {"best.M": stored["best.M"][1:]})
    kept = RunFolder(own, CONFIG)
    with pytest.raises(ValueError, match=r"checkpoint\.npz is damaged \(best\.M has the shape"):
        kept.samcon(kept.graph("", None))


@pytest.mark.parametrize("how", ["truncated", "empty"])
@pytest.mark.parametrize("name", ["config.json", "graph.npz", "policy.npz"])
def test_damaged_files_are_said(own, name, how):
    spoil(own / name, how)
    with pytest.raises(ValueError, match=rf"{name} is damaged .*: \w+ ") as error:
        Run.load(own)
    assert "\n" not in str(error.value)
    if name == "config.json":
        with pytest.raises(ValueError, match=r"config\.json is damaged"):
            RunFolder(own, CONFIG)


@pytest.mark.parametrize("text", ["[]", "{}", '{"skill": {"name": "x"}, "samcon": 3}'])
def test_a_config_that_is_none_is_said(own, text):
    (own / "config.json").write_text(text)
    with pytest.raises(ValueError, match=r"config\.json is damaged"):
        RunFolder(own, CONFIG)


def test_a_folder_that_is_no_run_is_left_alone(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ValueError, match=r"is not empty and holds no run \(notes\.txt\)"):
        RunFolder(tmp_path, CONFIG)
    with pytest.raises(ValueError, match="is a file; give a folder"):
        RunFolder(tmp_path / "notes.txt", CONFIG)
    with pytest.raises(ValueError, match="cannot be written"):
        RunFolder(tmp_path / "notes.txt" / "run", CONFIG)
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_what_cannot_be_used_yet_is_said(own, tmp_path):
    with pytest.raises(ValueError, match=r"no such folder; warpdribble learn"):
        Run.load(tmp_path / "none")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match="holds no run"):
        Run.load(tmp_path / "empty")
    (own / "policy.npz").unlink()
    with pytest.raises(
        ValueError, match=r"has no policy yet, the first comes after 2 iterations: let it go on"
    ):
        Run.load(own)


def test_a_recording_steps_as_learning_does(whole):
    run = Run.load(whole)
    task, other = run.task(1), run.task(1)
    seen = record(task, run.policy, run.states, seconds=1.0, seed=5)
    assert len(seen.joint_q) == len(seen.body_q) == len(seen.reference_q) == 101
    randoms = np.random.default_rng(5)
    start = run.states.draw(1, randoms)
    k, felt = start.k, other.reset(start.k, start.joint_q, start.joint_qd)
    for _ in range(20):
        felt = other.advance(k, run.policy.act(other.state(felt, k), k))
        k = run.graph.follow(k, randoms)
    assert np.array_equal(seen.joint_q[-1], other.sim.joint_q[0])
    assert np.array_equal(seen.body_q[-1], other.sim.body_q[0])


def test_the_reference_of_a_recording_goes_on_from_where_the_player_is(whole):
    from warpdribble.learning.evaluate.trials import composed, planar, relative

    run = Run.load(whole)
    step = np.array([[0.05, 0.02, 0.3]])
    start, goal = run.graph.start_q, run.graph.goal_q.copy()
    aim = composed(planar(start), np.repeat(step, len(start), axis=0))
    goal[:, :2] = aim[:, :2]
    goal[:, 3:7] = [[0.0, 0.0, np.sin(h / 2), np.cos(h / 2)] for h in aim[:, 2]]
    travelling = replace(run.graph, goal_q=goal)
    task = replace(run, graph=travelling).task(1)
    zero = task.open_loop()
    seen = record(task, zero, run.states, seconds=0.5)
    places = planar(seen.reference_q[::5])
    assert places[0] == pytest.approx(planar(seen.joint_q[:1])[0], abs=1e-5)
    assert relative(places[:-1], places[1:]) == pytest.approx(np.repeat(step, 10, axis=0), abs=2e-3)
    assert np.abs(np.diff(seen.reference_q[:, :3], axis=0)).max() < 0.03


def test_differences_name_keys():
    there, here = {"a": {"b": 1, "c": 2}, "version": "1"}, {"a": {"b": 1}, "d": 3, "version": "2"}
    said = runs.differences(there, here)
    assert said == ["d is missing there and 3 here", "a.c is 2 there and missing here"]
