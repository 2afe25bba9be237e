"""Errors below the commands speak no command line; the line that a command ends with names the option."""

import ast
from pathlib import Path

import pytest

from warpdribble.clips.data import fetch
from warpdribble.clips.read import read_part
from warpdribble.commands.hints import HINTS, one_line
from warpdribble.learning.methods import STAGES
from warpdribble.learning.methods.samcon import SamconConfig
from warpdribble.learning.runs import files
from warpdribble.learning.runs.folder import Run, changed
from warpdribble.learning.runs.train import train
from warpdribble.sims import Model
from warpdribble.sims.errors import InputError
from warpdribble.skills import clip_skill, parse_skill, read_skill, skill_graph, stage_skill

ROOT = Path(__file__).resolve().parents[3]
BELOW = ("sims", "learning", *(f"warpdribble/{room}" for room in ("clips", "skills", "takes", "skin", "web")))
NAME = "dribble-right-authored"
LOCOMOTION = STAGES["locomotion"]


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


class Asked:
    """What the errors are asked of."""

    def __init__(self, tmp_path, clip, player):
        self.tmp_path, self.clip, self.player = tmp_path, clip, player
        self.run = Run.load(NAME)

    def mine(self, text):
        return parse_skill(f'name = "mine"\n{text}\n', "mine.toml")

    def folder(self, **what):
        """A run that was begun, with files of a stage."""
        run = Run.begin(self.tmp_path / "run", {"name": "mine"})
        run.keep("", lambda: self.run.graph)
        (run.folder / "locomotion").mkdir()
        for name, text in what.items():
            (run.folder / "locomotion" / name.replace("_", ".")).write_text(text)
        return run

    def read(self, **how):
        return read_part(self.clip, **how)

    def stage(self, **how):
        return stage_skill(self.player, clip_skill(self.clip, **how))

    def write(self, name, text=""):
        (self.tmp_path / name).write_text(text)
        return self.tmp_path / name

    def twice(self):
        with files.held(self.tmp_path), files.held(self.tmp_path):
            pass

    def mapped(self, *shape):
        return files.mapped(self.tmp_path / "buffer.npy", shape)


WRONG = {
    "frames": (lambda a: a.read(frames=(9, 3)), "give other --frames"),
    "short": (lambda a: a.stage(frames=(0, 1)), "give other --frames"),
    "units": (lambda a: a.read(units="mile"), "say which with --units"),
    "up": (lambda a: a.read(up="w"), "say which with --up"),
    "repairs": (lambda a: a.read(repairs="hair"), "give others with --repair"),
    "no clip": (lambda a: read_part(a.tmp_path / "none.bvh"), ""),
    "no format": (lambda a: read_part(a.write("a.fbx")), ""),
    "broken": (lambda a: read_part(a.write("a.bvh", "HIERARCHY\n")), ""),
    "mapping": (lambda a: a.stage(mapping="lafan"), "give another --mapping"),
    "no mapping": (lambda a: a.stage(mapping="none.toml"), "give another --mapping"),
    "mirror": (lambda a: fetch("cmu", a.tmp_path, str(a.tmp_path / "none")), "give another --mirror"),
    "no file": (lambda a: fetch("cmu", a.tmp_path / "x", str(a.tmp_path)), "give another --mirror"),
    "no skill": (lambda a: read_skill("moonwalk"), ""),
    "no skill file": (lambda a: read_skill(a.tmp_path / "none.toml"), ""),
    "no key": (lambda a: a.mine('authored = "waist"\nspeed = 3'), ""),
    "no recording": (lambda a: stage_skill(a.player, a.mine('clip = "none.bvh"'), a.tmp_path), ""),
    "not fetched": (
        lambda a: stage_skill(a.player, read_skill("run-dribble"), a.tmp_path),
        "warpdribble fetch ballplay brings it",
    ),
    "no authored": (lambda a: stage_skill(a.player, a.mine('authored = "moon"')), ""),
    "skill's frames": (lambda a: stage_skill(a.player, a.mine(f'clip = "{a.clip}"\nframes = [0, 999]')), ""),
    "skill's units": (lambda a: stage_skill(a.player, a.mine(f'clip = "{a.clip}"\nunits = "mile"')), ""),
    "not cyclic": (
        lambda a: skill_graph(a.mine('authored = "waist"\nball = false')),
        "take one of those that warpdribble skill list says are",
    ),
    "taken": (lambda a: Run.begin(a.write("notes.txt").parent, {"name": "x"}), "give another --out"),
    "a file": (lambda a: Run.begin(a.write("notes.txt"), {"name": "x"}), "give another --out"),
    "another run": (lambda a: Run.begin(a.folder().folder, {"name": "other"}), "give another --out"),
    "another config": (
        lambda a: train(a.folder(config_json='{"lag": 3}'), LOCOMOTION, SamconConfig()),
        "give another --out",
    ),
    "no config": (lambda a: train(a.folder(config_json="3"), LOCOMOTION), "give another --out"),
    "no checkpoint": (
        lambda a: train(a.folder(config_json='{"islands": 1}', checkpoint_npz="PK"), LOCOMOTION),
        "give another --out",
    ),
    "no folder": (lambda a: Run.load(a.tmp_path / "none"), "warpdribble learn SKILL --out RUN learns one"),
    "no run": (lambda a: Run.load(a.tmp_path), "give a folder that warpdribble learn wrote"),
    "nothing learned": (
        lambda a: a.folder().learned(STAGES),
        "warpdribble learn SKILL --out RUN learns one",
    ),
    "no policy": (
        lambda a: a.folder(config_json="{}").learned(STAGES),
        "let it go on with the same warpdribble learn",
    ),
    "no stage": (lambda a: a.run.learned(STAGES, "flying"), "give another --stage"),
    "no parameter": (
        lambda a: changed(SamconConfig(), ["speed=3"]),
        "give another --set; the stage's config.json has the names",
    ),
    "held": (lambda a: a.twice(), "give another --out"),
    "no arrays": (lambda a: files.read_arrays(a.write("a.npz", "PK"), "delete it"), ""),
    "another buffer": (lambda a: (a.mapped(2), a.mapped(3)), "give another --out"),
}


@pytest.mark.parametrize("what", WRONG)
def test_messages_speak_no_command_line(what, tmp_path, cmu_clip, player):
    """One line; the hint is what would put it right, in the words of who says it."""
    ask, said = WRONG[what]
    with pytest.raises(InputError) as error:
        ask(Asked(tmp_path, cmu_clip, player))
    message = str(error.value)
    assert "\n" not in message and "--" not in message.replace(str(tmp_path), "")
    assert "warpdribble " not in message
    assert error.value.hint in ("", *HINTS)
    assert one_line(error.value) == (f"{message}; {said}" if said else message)


def test_a_need_that_was_not_learned_names_the_option(tmp_path):
    from dataclasses import replace

    above = replace(LOCOMOTION, name="above", needs=("locomotion",))
    run = Run.begin(tmp_path / "run", {"name": "mine"})
    run.keep("", lambda: Run.load(NAME).graph)
    with pytest.raises(InputError, match="above starts from what locomotion has learned") as error:
        train(run, above)
    assert one_line(error.value).endswith("; learn that one first, with --stage")


def test_other_errors_are_said_as_they_are():
    assert one_line(ValueError("a\n  b")) == "a b"
    assert one_line(InputError("is none", "here", "nobody knows")) == "here: is none"


# ------------------------------------------------------------------------------------ all of the source


def sources():
    for room in BELOW:
        for path in (ROOT / room).rglob("*.py"):
            yield path, ast.parse(path.read_text(encoding="utf-8"))


def words(node):
    return [n.value for n in ast.walk(node) if isinstance(n, ast.Constant) and isinstance(n.value, str)]


def test_no_error_in_the_source_does():
    """Whatever is raised, or made to be."""
    for path, tree in sources():
        for node in ast.walk(tree):
            made = isinstance(node, ast.Call) and ast.unparse(node.func).endswith("Error")
            if made or isinstance(node, ast.Raise):
                for text in words(node):
                    where = f"{path.relative_to(ROOT)}:{node.lineno} {text}"
                    assert " --" not in f" {text}" and "warpdribble " not in text, where


def test_every_hint_is_known_and_every_one_known_is_given():
    place = {"InputError": 2, "ClipError": 2, "FetchError": 2, "SkillError": 3}
    given, named = set(), set()
    for _, tree in sources():
        named |= set(words(tree))
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call) or ast.unparse(node.func) not in place:
                continue
            hints = [k.value for k in node.keywords if k.arg == "hint"]
            hints += node.args[place[ast.unparse(node.func)] :][:1]
            given |= {hint.value for hint in hints if isinstance(hint, ast.Constant)}
    assert given - {""} <= set(HINTS)
    assert set(HINTS) <= named
