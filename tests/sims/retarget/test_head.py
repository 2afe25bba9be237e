"""A neck of several joints on the player's one: where the head is, against trigonometry."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.sims.retarget.person import about
from warpdribble.clips import read_clip
from warpdribble.sims import Model, Motion, retargeted
from warpdribble.sims.model import pose
from warpdribble.sims.retarget.calibrate import since_rest
from warpdribble.sims.retarget.head import along_neck, told
from warpdribble.sims.retarget.mapping import read_mapping

NAMES = ("Hips", "Spine1", "Neck", "Neck1", "Head", "Head_end")
LOWER, UPPER = 0.12, 0.18
"""[m] Neck to Head, Head to its end."""


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def bent(turns, names=NAMES, end=(0.0, 0.0, UPPER)):
    """A Motion of three frames of a straight spine. turns: joint -> rotation (3,) in its parent."""
    offsets = np.array([[0, 0, 0], [0, 0, 0.4], [0, 0, 0.1], [0, 0, 0.06], [0, 0, LOWER - 0.06], end])
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (3, len(names), 1))
    for joint, turn in turns.items():
        rotations[:, names.index(joint)] = turn.as_quat()
    rest = np.tile([0.0, 0.0, 0.0, 1.0], (len(names), 1))
    count = len(names)
    return Motion(names, np.arange(-1, count - 1), offsets[:count], rotations, np.zeros((3, 3)), 100.0, rest)


def head(player, motion):
    positions, frames = motion.forward()
    return along_neck(player, motion, read_mapping("cmu"), positions, since_rest(motion, frames))


ANGLES = np.radians([10.0, 25.0, 40.0])


def test_a_neck_that_bends_forward_and_a_head_that_bends_back(player):
    """The head's joint turns back by half of what the neck bends: the line is neither's."""
    motion = bent({"Neck": about("y", ANGLES), "Head": about("y", -1.5 * ANGLES)})
    ahead = LOWER * np.sin(ANGLES) - UPPER * np.sin(0.5 * ANGLES)
    up = LOWER * np.cos(ANGLES) + UPPER * np.cos(0.5 * ANGLES)
    line = head(player, motion)
    wanted = about("y", np.arctan2(ahead, up))
    assert np.degrees((line * wanted.inv()).magnitude()).max() < 1e-6
    assert told(about("y", -0.5 * ANGLES), line)
    assert not told(line, line)


def test_what_turns_as_one_is_copied(player):
    turn = Rotation.from_rotvec([[0.4, -0.3, 2.0], [0.1, 1.0, -2.0], [0.0, 0.2, 3.1]])
    for joint in ("Hips", "Spine1", "Neck"):
        assert (head(player, bent({joint: turn})) * turn.inv()).magnitude().max() < 1e-9
    look = about("z", ANGLES)
    assert (head(player, bent({"Head": look})) * look.inv()).magnitude().max() < 1e-9


@pytest.mark.parametrize(
    "motion",
    [
        bent({}, NAMES[:-1]),  # nothing tells where the crown is
        bent({}, ("Hips", "Spine", "LowerBack", "Spine1", "Head", "Head_end")),  # no neck
        bent({}, end=(0.3, 0.0, 0.0)),  # a nose
    ],
)
def test_a_head_alone_is_copied(player, motion):
    assert head(player, motion) is None


def test_a_runner_s_head_is_where_it_was_recorded(player, mocap):
    """CMU 09 bends the lower neck 24 degrees forward, the head 18 up: the crown is above the neck."""
    motion = read_clip(mocap / "cmu" / "09_01.bvh")[0]
    result = retargeted(player, motion)
    recorded = result.mapping.plain(motion).resample(1.0 / player.timestep)
    positions, _ = recorded.forward()
    line = positions[:, recorded.index("Head_end")] - positions[:, recorded.index("Neck")]
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    up = {}
    for name, reference in (("copied", retargeted(player, motion, ik=False)), ("ours", result)):
        body_q = pose.forward(player, reference.reference.joint_q)
        up[name] = Rotation.from_quat(body_q[:, player.body("head"), 3:]).apply([0.0, 0.0, 1.0])
    apart = {name: np.degrees(np.arccos(np.sum(line * axis, axis=1))) for name, axis in up.items()}
    assert apart["copied"].min() > 10.0
    assert apart["ours"].max() < 5.0  # which the line is off the vertical in the T-pose
    assert any("the head goes" in note for note in result.notes)


def test_no_clip_without_an_end_of_the_head_changes(player, mocap):
    motion = read_clip(mocap / "ballplay_m" / "013_018pickle_run_3.pt")[0]
    first, second = (retargeted(player, motion, ik=ik).reference.joint_q for ik in (True, False))
    worlds = [pose.forward(player, q)[:, player.body("head"), 3:] for q in (first, second)]
    turn = Rotation.from_quat(worlds[0]) * Rotation.from_quat(worlds[1]).inv()
    assert turn.magnitude().max() < 1e-6
