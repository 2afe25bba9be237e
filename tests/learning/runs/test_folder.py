"""The folder of a run: whose it is, what an older or a damaged one says, and what was learned in it."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from tests.learning.runs.walker import SKILL, STAGE, Steps, WalkerConfig, arrays, assert_same, walk
from warpdribble.learning.methods import STAGES
from warpdribble.learning.methods.ddpg import DdpgConfig
from warpdribble.learning.methods.ppo import PpoConfig
from warpdribble.learning.methods.samcon import SamconConfig
from warpdribble.learning.policies.linear import LinearPolicy
from warpdribble.learning.runs import folder as runs
from warpdribble.learning.runs.folder import Run, changed, filled, plain, shipped_controllers
from warpdribble.sims.errors import InputError

WALKER = {"walker": STAGE}


@pytest.fixture(scope="module")
def whole(tmp_path_factory, graph):
    folder = tmp_path_factory.mktemp("whole") / "run"
    walk(folder, graph)
    return folder


@pytest.fixture
def own(whole, tmp_path):
    """A copy of the run, to be spoilt."""
    shutil.copytree(whole, tmp_path / "own")
    return tmp_path / "own"


def refused(said, hint, what, *arguments, **more):
    """The error of a call that has to fail, in one line."""
    with pytest.raises(InputError, match=said) as error:
        what(*arguments, **more)
    assert "\n" not in str(error.value) and error.value.hint == hint
    return str(error.value)


def change(path, **values):
    table = json.loads(path.read_text())
    path.write_text(json.dumps({k: v for k, v in (table | values).items() if v is not Ellipsis}))


# ------------------------------------------------------------------------------------------ whose it is


@pytest.mark.parametrize(
    ("skill", "seed", "said"),
    [
        (SKILL, 3, r"seed is 0 there and 3 here"),
        (SKILL | {"name": "running"}, 0, r'skill\.name is "walking" there and "running" here'),
        (SKILL | {"frames": [1, 9]}, 0, r"skill\.frames is \[0, 9\] there and \[1, 9\] here"),
        (SKILL | {"speed": 2}, 0, r"skill\.speed is missing there and 2 here"),
    ],
)
def test_a_folder_with_another_run_is_refused(whole, skill, seed, said):
    refused(rf"run: holds another run: {said}$", "out", Run.begin, whole, skill, seed)


def test_an_older_version_may_go_on(own, whole):
    change(own / "run.json", version="0.0.1")
    assert Run.begin(own, SKILL).begun
    walk(own, None)
    assert_same(own / "walker", whole / "walker")


def test_differences_name_keys():
    there, here = {"a": {"b": 1, "c": 2}, "version": "1"}, {"a": {"b": 1}, "d": 3, "version": "2"}
    said = runs.differences(there, here)
    assert said == ["d is missing there and 3 here", "a.c is 2 there and missing here"]


def test_keys_of_a_skill_that_an_older_version_did_not_have_are_empty(own):
    assert Run.begin(own, SKILL | {"units": "", "turns": [], "loud": False, "more": {}}).begun
    refused(r'skill\.units is missing there and "cm" here', "out", Run.begin, own, SKILL | {"units": "cm"})


def test_a_folder_that_is_no_run_is_left_alone(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    refused(r"is not empty and holds no run \(notes\.txt\)$", "out", Run.begin, tmp_path, SKILL)
    refused("notes.txt: is a file, not a folder", "out", Run.begin, tmp_path / "notes.txt", SKILL)
    refused("cannot be written", "out", Run.begin, tmp_path / "notes.txt" / "run", SKILL)
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_a_folder_of_an_older_version_is_said(own):
    """Everything lay in one folder then."""
    for file in [*(own / "walker").iterdir()]:
        shutil.move(file, own / file.name)
    (own / "walker").rmdir()
    (own / "run.json").unlink()
    there = sorted(p.name for p in own.iterdir())
    refused("own: holds a run of an older version, which cannot go on", "out", Run.begin, own, SKILL)
    refused("own: holds no run", "run", Run.load, own)
    assert sorted(p.name for p in own.iterdir()) == there


def test_what_killed_runs_leave_is_no_run(tmp_path, graph):
    """A lock that nobody holds, and half a file."""
    (tmp_path / "lock").write_text("process 1 on nowhere")
    (tmp_path / ".part-1").mkdir()
    walk(tmp_path, graph)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["graph.npz", "run.json", "skill.toml", "walker"]


def test_a_graph_is_made_once(own):
    run = Run.begin(own, SKILL)
    run.keep("other", lambda: pytest.fail("made again"))
    assert (own / "skill.toml").read_text() == 'name = "walking"\n'


def test_a_graph_that_cannot_be_made_leaves_a_free_folder(tmp_path):
    def fails():
        raise InputError("too short")

    run = Run.begin(tmp_path / "run", SKILL)
    refused("too short", "", run.keep, "", fails)
    assert not list((tmp_path / "run").iterdir())
    assert not Run.begin(tmp_path / "run", SKILL | {"name": "other"}).begun


# ---------------------------------------------------------------------------------------- parameters


def test_keys_that_an_older_file_lacks_read_as_defaults(own, whole):
    """Also those inside tables; the run goes on as it would have."""
    walk(own, None, iterations=2)
    change(own / "walker" / "config.json", check_every=..., steps={"size": 1.0}, ways=...)
    assert STAGE.config() == Run.load(own).stage(STAGE).config()
    walk(own, None, iterations=4)
    assert_same(own / "walker", whole / "walker")
    written = json.loads((own / "walker" / "config.json").read_text())
    assert written == plain(WalkerConfig()) and written["steps"] == {"size": 1.0, "odd": False}
    (own / "walker" / "config.json").write_text("{}")
    assert Run.load(own).stage(STAGE).config() == WalkerConfig()


def test_what_was_begun_with_other_parameters_goes_on_with_them(tmp_path, graph):
    other = WalkerConfig(iterations=2, check_every=1, steps=Steps(3.0, True), ways=(1, 2, 3))
    walk(tmp_path / "run", graph, config=other)
    assert Run.load(tmp_path / "run").stage(STAGE).config() == other
    assert Run.load(tmp_path / "run").stage(STAGE).config(iterations=7).iterations == 7
    walk(tmp_path / "run", graph, iterations=4)
    walk(tmp_path / "whole", graph, config=replace(other, iterations=4))
    assert_same(tmp_path / "run" / "walker", tmp_path / "whole" / "walker")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"speed": 2}, r"unknown key 'speed'"),
        ({"steps": {"size": 1.0, "depth": 2}}, "unknown key 'depth'"),
        ({"steps": 3}, "steps is no table"),
        ({"iterations": "many"}, "iterations is no whole number"),
        ({"iterations": 2.5}, "iterations is no whole number"),
        ({"iterations": True}, "iterations is no whole number"),
        ({"iterations": None}, "iterations is no whole number"),
        ({"steps": {"size": "large"}}, "size is no number"),
        ({"steps": {"odd": 1}}, "odd is no true or false"),
        ({"ways": 3}, "ways is no tuple"),
    ],
)
def test_parameters_that_are_none_are_said(own, values, said):
    change(own / "walker" / "config.json", **values)
    asked = rf"config\.json: is damaged \({said}\): put it right, or learn again"
    refused(asked, "out", walk, own, None)
    refused(asked, "out", Run.load(own).learned, WALKER)
    assert not (own / "lock").exists()


def test_whole_numbers_pass_for_numbers():
    assert filled(WalkerConfig(), {"steps": {"size": 2}}) == WalkerConfig(steps=Steps(size=2.0))
    assert type(filled(WalkerConfig(), {"steps": {"size": 2}}).steps.size) is float


def test_parameters_are_changed_by_name():
    """Deeper ones too, and nothing else; what is no JSON is text."""
    asked = ["cost.change=0.4", "sigma=1", "base=offsets"]
    config = changed(PpoConfig(), asked)
    assert config == replace(
        PpoConfig(), cost=replace(PpoConfig().cost, change=0.4), sigma=1.0, base="offsets"
    )
    assert changed(DdpgConfig(), ["critic=[30, 40]"]).critic == (30, 40)
    assert type(config.sigma) is float and changed(config, []) is config


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("speed=3", "'speed=3': unknown key 'speed'"),
        ("cost.speed.x=3", "'cost.speed.x=3': speed is no number"),
        ("sigma=much", "'sigma=much': sigma is no number"),
        ("base", "'base' is no NAME=VALUE"),
        ("cost=3", "'cost=3': cost is no table"),
    ],
)
def test_parameters_that_cannot_be_changed(asked, said):
    with pytest.raises(InputError) as error:
        changed(PpoConfig(), [asked])
    assert str(error.value) == said and error.value.hint == "set"


def test_every_stage_s_parameters_come_back():
    """As they were, through JSON; so that a run that goes on is asked for nothing else."""
    for stage in STAGES.values():
        config = stage.config()
        assert filled(stage.config(), plain(config)) == config
        assert type(config.iterations) is int


# ------------------------------------------------------------------------------------------- damaged


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
    path = own / "walker" / "checkpoint.npz"
    spoil(path, how)
    said = refused(
        r"checkpoint\.npz: is damaged .*: delete it to learn from the start", "out", walk, own, None
    )
    assert said.startswith(str(path))
    path.unlink()
    assert walk(own, None).iterations == 4


@pytest.mark.parametrize("lacks", ["value", "iteration", "seconds"])
def test_a_checkpoint_that_lacks_something_is_said(own, lacks):
    path = own / "walker" / "checkpoint.npz"
    with np.load(path) as file:
        np.savez(path, **{name: file[name] for name in file.files if name != lacks})
    refused(rf"checkpoint\.npz: is damaged .*{lacks}", "out", walk, own, None)


def test_a_checkpoint_of_another_graph_is_said(tmp_path, graph, standing):
    from tests.learning.runs.test_train import learn

    learn(tmp_path / "run", 2, SamconConfig(islands=1, particles=2, walk=2, check_every=2, trials=2))
    standing.save(tmp_path / "run" / "graph.npz")
    said = r"checkpoint\.npz: is damaged \(policy\.M has the shape \(14, 17, 20\)\)"
    refused(said, "out", learn, tmp_path / "run", 3, None)


@pytest.mark.parametrize("how", ["truncated", "empty"])
@pytest.mark.parametrize("name", ["run.json", "graph.npz", "walker/config.json", "walker/policy.npz"])
def test_damaged_files_are_said(own, name, how):
    spoil(own / name, how)
    hint = "" if "policy" in name else "out"
    file = name.rpartition("/")[2].replace(".", r"\.")
    refused(rf"{file}: is damaged .*: \w+ ", hint, lambda: Run.load(own).learned(WALKER))
    if "policy" not in name:
        refused(rf"{file}: is damaged", "out", walk, own, None)


@pytest.mark.parametrize("text", ["[]", "{}", "3", '{"skill": {}}', '{"skill": {"name": "x"}, "seed": "?"}'])
def test_an_info_that_is_none_is_said(own, text):
    (own / "run.json").write_text(text)
    refused(r"run\.json: is damaged", "out", Run.begin, own, SKILL)
    refused(r"run\.json: is damaged", "out", Run.load, own)


# ----------------------------------------------------------------------------------------- learned


def test_what_was_learned_comes_back_without_the_clip(whole, graph):
    one = Run.load(whole).learned(WALKER)
    assert one.stage is STAGE and one.iteration == 4 and one.skill == SKILL
    assert isinstance(one.controller, LinearPolicy)
    np.testing.assert_array_equal(one.starts.joint_q, graph.start_q)
    assert one.graph.count == graph.count and one.task(3).worlds == 3
    assert one.context.folder == whole / "walker" and one.run.seed == 0


def test_the_last_that_has_a_result_unless_asked(own, graph):
    """In the order in which one stands on the other."""

    stages = {name: replace(STAGE, name=name) for name in ("below", "walker", "above", "top")}
    run = Run.load(own)
    assert run.learned(stages).stage.name == "walker"
    shutil.copytree(own / "walker", own / "above")
    assert run.learned(stages).stage.name == "above"
    assert run.learned(stages, "walker").stage.name == "walker"
    (own / "above" / "policy.npz").unlink()
    assert run.learned(stages).stage.name == "walker"
    refused("own: has no policy yet$", "go on", run.learned, stages, "above")
    refused("own: has no policy yet: no top was learned$", "learn", run.learned, stages, "top")
    said = refused(
        "there is no stage 'side'; there are below, walker, above, top", "stage", run.learned, stages, "side"
    )
    assert said.startswith(str(own))


def test_what_cannot_be_used_yet_is_said(own, tmp_path, graph):
    ships = ", ".join(shipped_controllers())
    refused(rf"none: no such folder \({ships} ships\)", "learn", Run.load, tmp_path / "none")
    (tmp_path / "empty").mkdir()
    refused("empty: holds no run", "run", Run.load, tmp_path / "empty")
    (own / "walker" / "policy.npz").unlink()
    refused("own: has no policy yet$", "go on", Run.load(own).learned, WALKER)
    run = Run.begin(tmp_path / "new", SKILL)
    run.keep("", lambda: graph)
    refused(
        "new: has no policy yet: no stage was learned$", "learn", Run.load(tmp_path / "new").learned, WALKER
    )


@pytest.mark.parametrize("name", shipped_controllers())
def test_shipped_controllers_are_runs(name):
    """Found by name; a folder of that name comes first."""
    run = Run.load(name)
    assert run.learned(STAGES).stage.name == "policy"
    one = run.learned(STAGES, "locomotion")
    assert run.folder.name == name and one.skill["name"] == name
    assert len(one.controller.M) == one.graph.count and len(one.starts) > 50
    assert one.context.config.weights == SamconConfig().weights


def test_a_folder_comes_before_a_controller_of_its_name(own, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    own.rename(tmp_path / shipped_controllers()[0])
    assert Run.load(shipped_controllers()[0]).info["skill"] == SKILL
    assert arrays(tmp_path / shipped_controllers()[0] / "walker" / "policy.npz")
