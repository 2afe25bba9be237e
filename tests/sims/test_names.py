"""What bodies and joints are called does not matter: the player under other names does the same."""

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import asdict, replace

import numpy as np
import pytest

from warpdribble.clips.read import read_clip
from warpdribble.sims import Model, ModelError, inferred_ball, recorded_ball
from warpdribble.sims.ball.hands import find_hands
from warpdribble.sims.reference.reference import Reference
from warpdribble.sims.retarget.accuracy import accuracy
from warpdribble.sims.retarget.mapping import MappingError, read_mapping
from warpdribble.sims.retarget.retarget import retargeted

OTHER = {
    "pelvis": "hull", "root": "drift", "torso": "chest", "neck": "nape", "head": "skull", "hand": "paw",
    "palm": "pad", "wrist": "carpus", "elbow": "crook", "shoulder": "yoke", "upper_arm": "wing",
    "index": "second", "middle": "third", "pinky": "fifth", "ball": "globe", "foot": "hoof", "toes": "tip",
    "ankle": "hock", "knee": "stifle", "hip": "joint", "upper_leg": "ham", "lower_leg": "gaskin",
}  # fmt: skip
NAMES = re.compile(rf"(?<![a-z])({'|'.join(sorted(OTHER, key=len, reverse=True))})(?![a-z])")


def renamed(name):
    return NAMES.sub(lambda word: OTHER[word[1]], name)


def rename(keys):
    return {renamed(key): value for key, value in keys.items()}


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module")
def other(player, tmp_path_factory):
    """All names of bodies, joints, sites and classes changed; the words for the roles stay."""
    tree = ElementTree.parse(player.path)
    for element in tree.iter():
        for key in ("name", "joint", "class", "data"):
            if key in element.attrib and (element.tag, key) != ("text", "name"):
                element.set(key, renamed(element.get(key)))
    path = tmp_path_factory.mktemp("other") / "other.xml"
    tree.write(path)
    return Model.load(path)


def test_the_names_are_others(player, other):
    assert not set(player.body_names) & set(other.body_names) - {
        name for name in player.body_names if not NAMES.search(name)
    }
    assert {"l_paw", "skull", "globe"} <= set(other.body_names)
    ours, theirs = (asdict(replace(model.roles, file="")) for model in (player, other))
    assert theirs == {role: renamed_all(value) for role, value in ours.items()}


def renamed_all(value):
    return renamed(value) if isinstance(value, str) else tuple(map(renamed_all, value))


@pytest.mark.parametrize("clip", ["cmu/06_12.bvh", "ballplay_m/009_006pickle_dribble2shot.pt"])
def test_a_recording_is_the_same_on_both(player, other, mocap, clip):
    motion, _ = read_clip(mocap / clip)
    motion = motion.slice(0, min(motion.frame_count, 300) - 1)
    mapping = read_mapping("cmu" if clip.startswith("cmu") else "ballplay")
    fields = ("bodies", "arms", "legs", "points", "palms", "supinated", "smoothed")
    theirs = replace(mapping, **{name: rename(getattr(mapping, name)) for name in fields})
    one, two = retargeted(player, motion, mapping), retargeted(other, motion, theirs)
    np.testing.assert_array_equal(one.reference.joint_q, two.reference.joint_q)
    ours, theirs = accuracy(player, one), accuracy(other, two)
    worst, far = ours.worst
    assert asdict(replace(ours, worst=(renamed(worst), far))) == asdict(theirs)
    balls = [
        [find(player, one), find(other, two)]
        for find in (
            lambda model, result: recorded_ball(model, result, motion),
            lambda model, result: inferred_ball(model, result.reference),
        )
    ]
    for ours, theirs in balls:
        assert (ours is None) == (theirs is None)
        if ours is not None:
            np.testing.assert_array_equal(ours.path, theirs.path)
            np.testing.assert_array_equal(ours.touch, theirs.touch)


def test_directions_find_the_trunk_of_any_name(player, other, mocap):
    motion, _ = read_clip(mocap / "cmu" / "06_12.bvh")
    mapping = replace(read_mapping("cmu"), rest="directions")
    theirs = replace(
        mapping, **{n: rename(getattr(mapping, n)) for n in ("bodies", "arms", "legs", "points", "smoothed")}
    )
    one, two = (
        retargeted(m, motion.slice(0, 60), map_, ik=False) for m, map_ in ((player, mapping), (other, theirs))
    )
    np.testing.assert_array_equal(one.reference.joint_q, two.reference.joint_q)
    headless = replace(theirs, bodies={k: v for k, v in theirs.bodies.items() if k != "skull"})
    with pytest.raises(MappingError, match=r"^cmu: bodies: names no head"):
        retargeted(other, motion.slice(0, 60), headless)


@pytest.fixture
def plain(player, tmp_path):
    """The player of a file that says nothing of roles."""
    path = tmp_path / "plain.xml"
    path.write_text(re.sub(r"<custom>.*</custom>", "", player.path.read_text(), flags=re.DOTALL))
    return Model.load(path)


def test_a_file_that_says_nothing_is_told_what_is_missing(plain, mocap):
    with pytest.raises(ModelError, match=r"plain.xml: the model has no palms: <text name=\"palms\">"):
        find_hands(plain, Reference(plain.start_q[None], 0.01))
    motion, _ = read_clip(mocap / "ballplay_m" / "009_006pickle_dribble2shot.pt")
    with pytest.raises(MappingError, match=r"palms\.l_hand: .*plain.xml does not say which bodies"):
        retargeted(plain, motion)
