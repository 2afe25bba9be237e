"""A part of a clip on its way to become a skill: what its file would say, and whose ball it has."""

from dataclasses import replace

import pytest

from warpdribble.sims import Model
from warpdribble.skills import clip_skill, is_skill, parse_skill, read_skill, stage_skill
from warpdribble.skills.graph import skill_fields, skill_text


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


REST = {
    "nothing": {},
    "all": {
        "repairs": "toes,ground",
        "units": "cmu",
        "up": "y",
        "asf": "/else/where.asf",
        "rate": 59.94,
        "drop_positions": True,
        "mapping": "cmu",
        "cyclic": True,
        "mirror": True,
    },
    "no ball": {"ball": False},
    "contact": {"contact": {"right": [(0.0, 0.1), (0.4, 0.5)]}, "checkpoints": (0.2,), "heights": (1.1,)},
    "checkpoints": {"checkpoints": (0.2, 0.4)},
}


@pytest.mark.parametrize("rest", REST.values(), ids=REST)
@pytest.mark.parametrize("frames", [(0, -1), (3, 90)])
def test_its_file_reads_as_it(rest, frames):
    one = clip_skill("/some/where/a clip.bvh", frames, **rest)
    assert one.is_clip and one.name == "a clip"
    read = parse_skill(skill_text(one), "mine.toml")
    assert not read.is_clip
    assert skill_fields(read) == skill_fields(one)


def test_its_file_says_where_it_lies(tmp_path, monkeypatch):
    """From wherever it is read."""
    monkeypatch.chdir(tmp_path)
    one = clip_skill("clip.amc", asf="own.asf")
    read = parse_skill(skill_text(one), "mine.toml")
    assert (read.clip, read.asf) == (str(tmp_path / "clip.amc"), str(tmp_path / "own.asf"))
    assert one.clip == one.source == "clip.amc"  # as it was given


def test_none_stands_for_empty():
    assert clip_skill("a.bvh", units=None, up=None, asf=None, rate=None) == clip_skill("a.bvh")


def test_the_text_of_a_skill_is_its_file(tmp_path):
    text = '# mine\nname = "mine"\nauthored = "waist"\ncyclic = true\n'
    (tmp_path / "mine.toml").write_text(text)
    assert skill_text(read_skill(tmp_path / "mine.toml")) == text
    assert skill_text(read_skill("waist")).startswith('name = "waist"')


def test_a_clip_is_told_from_a_skill(cmu_clip):
    assert not is_skill(cmu_clip) and clip_skill(cmu_clip).is_clip
    assert not parse_skill(f'name = "x"\nclip = "{cmu_clip}"\n', "x.toml").is_clip


def test_the_dribbling_hand_is_told(player, mocap):
    left = stage_skill(player, clip_skill(mocap / "cmu" / "06_04.bvh", (118, 241))).ball
    right = stage_skill(player, clip_skill(mocap / "cmu" / "06_12.bvh", (597, 684))).ball
    assert left.touch[:, 0].any() and not left.touch[:, 1].any()
    assert right.touch[:, 1].any() and not right.touch[:, 0].any()


def test_where_the_ball_comes_from(player, mocap, cmu_clip):
    """The last note says so."""
    recorded = clip_skill(mocap / "ballplay_m" / "013_018pickle_run_3.pt", (0, 80))
    inferred = clip_skill(mocap / "cmu" / "06_12.bvh", (597, 684))
    for skill, said, ball in (
        (recorded, "ball recorded", True),
        (inferred, "ball inferred from the hands' motion", False),
        (clip_skill(cmu_clip), "no ball shows", None),
        (replace(recorded, ball=False), "ball left out", None),
        (replace(inferred, contact={"right": [(0.1, 0.3)]}), "ball as the skill says", False),
        (replace(recorded, checkpoints=(0.2,)), "ball as the skill says", True),
    ):
        one = stage_skill(player, skill)
        assert one.notes[-1] == said and (one.ball and one.ball.recorded) == ball
    bare = Model.load("player", without=("ball",))
    assert stage_skill(bare, recorded).ball is None


def test_a_skeleton_is_looked_for_as_clips_are(player, tmp_path, amc_clip, monkeypatch):
    """Beside the file that names it, or in the data folder."""
    (tmp_path / "01.asf").rename(tmp_path / "own.asf")
    (tmp_path / "mine.toml").write_text(
        f'name = "x"\nclip = "{amc_clip.name}"\nasf = "own.asf"\nunits = "m"\n'
    )
    with pytest.raises(ValueError, match=r"frames: its frames last only 0\.017 s"):  # it was read
        stage_skill(player, read_skill(tmp_path / "mine.toml"))
    (tmp_path / "own.asf").unlink()
    with pytest.raises(ValueError, match=r"mine\.toml: asf: no file 'own\.asf' in ") as error:
        stage_skill(player, read_skill(tmp_path / "mine.toml"), tmp_path)
    assert error.value.hint == ""  # no set that can be fetched has it
