"""Up is where it is, whatever a person does in the clip, however the skeleton is drawn: told by the zero pose
where that stands, else guessed from the clip, and said."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.sims.retarget.person import about, person
from tests.sims.retarget.rigs import in_a_line, zero_at
from warpdribble.clips.space import TO_Z_UP, change_basis, into_room
from warpdribble.clips.upright import find_up

FRAMES = 61
STEPS = np.linspace(0.0, 1.0, FRAMES)
DRAWN = {
    "T": lambda m: m,
    "A": lambda m: zero_at(m, LeftArm=[-45, 0, 0], RightArm=[45, 0, 0]),
    "N": lambda m: zero_at(m, LeftArm=[-85, 0, 0], RightArm=[85, 0, 0]),
}
LINES = {"in a line": in_a_line, "mirrored": lambda m: in_a_line(m, right=-1.0)}
HANGING = {
    f"{side}Arm": about("x", np.full(FRAMES, -1.3 * sign)) for side, sign in (("Left", 1), ("Right", -1))
}
AHEAD = {
    f"{side}Arm": about("z", np.full(FRAMES, -1.5 * sign)) for side, sign in (("Left", 1), ("Right", -1))
}
OVER = {f"{side}Arm": about("x", np.full(FRAMES, 1.5 * sign)) for side, sign in (("Left", 1), ("Right", -1))}


def root(travel=0.0):
    return np.array([[0.3 + travel * s, 0.7 + 0.3 * travel * s, 0.0] for s in STEPS])


def clips():
    """What people do: turns of joints and the way of the hips over the ground [m], Z up."""
    face_down = np.full(FRAMES, 0.5 * np.pi)
    return {
        "walks": (HANGING, root(2.0)),
        "stands": (HANGING, root()),
        "does push-ups": (
            AHEAD | {"Hips": about("y", face_down + 0.1 * np.sin(6.0 * STEPS))},
            root(),
        ),
        "lies on the back": (HANGING | {"Hips": about("y", -face_down)}, root()),
        "crawls": (AHEAD | {"Hips": about("y", face_down)}, root(3.0)),
        "stands on the hands": (OVER | {"Hips": about("y", 2.0 * face_down)}, root()),
        "turns a cartwheel": (OVER | {"Hips": about("x", 2.0 * np.pi * STEPS)}, root(2.0)),
    }


@pytest.fixture(scope="module")
def does(shipped_player):
    people = {name: person(shipped_player, FRAMES, 60.0, *clip) for name, clip in clips().items()}
    return {name: grounded(motion) for name, motion in people.items()}


def grounded(motion):
    """The motion with its lowest joint at 0 at all times."""
    low = motion.forward()[0][..., 2].min(axis=1)
    return replace(motion, root_position=motion.root_position - low[:, None] * [0.0, 0.0, 1.0])


def turned(motion, up, unit=100.0):
    """The motion as a file in centimetres with another axis up has it."""
    turn = TO_Z_UP[up].T
    return replace(
        motion,
        offsets=unit * motion.offsets @ turn.T,
        root_position=unit * motion.root_position @ turn.T,
        rotations=change_basis(motion.rotations, turn),
        rest_rotations=change_basis(motion.rest_rotations, turn),
    )


@pytest.mark.parametrize("up", ["x", "y", "z", "-y"])
@pytest.mark.parametrize("drawn", DRAWN)
@pytest.mark.parametrize("what", clips())
def test_the_zero_pose_tells(does, what, drawn, up):
    axis, said = find_up(turned(DRAWN[drawn](does[what]), up))
    assert axis == up and said.startswith(f"{up[-1].upper()} points {'down' if up == '-y' else 'up'}")
    assert "guessed" not in said
    if what in ("walks", "stands"):
        assert said.endswith(("up", "down"))


@pytest.mark.parametrize("up", ["x", "y", "z"])
@pytest.mark.parametrize("drawn", LINES)
@pytest.mark.parametrize("what", [what for what in clips() if what != "turns a cartwheel"])
def test_the_clip_guesses_where_nobody_stands_at_zero_angles(does, what, drawn, up):
    axis, said = find_up(turned(LINES[drawn](does[what]), up))
    assert axis == up
    assert "points up: guessed from the clip, as the skeleton does not stand at zero angles: " in said
    assert said.endswith(
        "the head is above the feet" if what in ("walks", "stands") else "its ground is at 0"
    )


@pytest.mark.parametrize("what", ["walks", "stands"])
@pytest.mark.parametrize("lying", [[0, 90, 0], [0, -90, 0], [90, 0, 0], [180, 0, 0]])
def test_a_zero_pose_that_lies_is_seen_in_a_clip_that_stands(does, what, lying):
    axis, said = find_up(turned(zero_at(does[what], Hips=lying), "y"))
    assert axis == "y" and said.endswith("in the clip on ground at 0; at zero angles the skeleton lies")


def test_where_the_clip_contradicts_itself_there_is_no_axis(does):
    """A line of bones does push-ups, one of its sides at 0; or it lies slanted in the air."""
    motion = in_a_line(does["does push-ups"])
    beside = motion.forward()[0][..., 1].min()
    assert find_up(replace(motion, root_position=motion.root_position - [0.0, beside, 0.0])) is None
    motion = in_a_line(does["lies on the back"])
    turn = Rotation.from_euler("xy", [40.0, 40.0], degrees=True)
    rotations = motion.rotations.copy()
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    assert find_up(replace(motion, rotations=rotations, root_position=motion.root_position + 5.0)) is None


@pytest.mark.parametrize(
    ("unit", "name"),
    [(1.0, "metre"), (100.0, "centimetre"), (1000.0, "millimetre"), (39.37, "inch")],
)
def test_the_unit_is_told(does, tmp_path, unit, name):
    motion = turned(does["stands"], "y", unit)
    moved, notes = into_room(tmp_path / "clip.bvh", motion, None, None)
    assert any(note.startswith(f"length unit taken as one {name}") for note in notes)
    assert np.allclose(moved.forward()[0], does["stands"].forward()[0], atol=1e-3)
