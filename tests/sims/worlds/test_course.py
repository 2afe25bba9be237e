"""`Course` against targets set by hand, turned by SciPy's rotations, and forces applied by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.sims.worlds.float64 import integrate, unit
from warpdribble.sims import Simulation
from warpdribble.sims.worlds import Course

STEERED = ("r_knee", "lower_back", "l_hip", "l_elbow")
HINGES = ("r_knee", "l_elbow")
WORLDS, ROWS = 19, 7

FINGERS = ("index", "middle", "ring", "pinky")
GRIP = {
    **{f"r_{finger}_mcp": (0.0, 0.8 + 0.1 * k, 0.05 * k) for k, finger in enumerate(FINGERS)},
    **{f"r_{finger}_pip": 1.2 - 0.1 * k for k, finger in enumerate(FINGERS)},
    **{f"r_{finger}_dip": 0.7 for finger in FINGERS},
    "r_thumb_mcp": (0.3, -0.2, 0.1),
    "r_thumb_dip": -0.4,
}
"""One number bends all fingers."""
SPREAD = {"l_index_mcp": (1.0, 0.0, 0.0), "l_pinky_mcp": (-1.0, 0.0, 0.0)}
"""A single component of some ball joints."""


def table(model, random, rows=ROWS):
    """Targets about the start pose, in float32 and of such quaternions that normalising changes no bit."""
    bend = 0.1 * random.standard_normal((rows, model.nv))
    q = integrate(model, np.tile(model.start_q, (rows, 1)), bend).astype(np.float32)
    for _ in range(20):
        q = unit(model, q)
    same = unit(model, q) == q
    for k in model.quaternions():  # the few that go to and fro between two neighbours
        q[~same[:, k : k + 4].all(axis=1), k : k + 4] = [0, 0, 0, 1]
    return q


def gains(model, one):
    """Joint -> (dofs, columns): how the columns of a steered joint, or of a signal, move it."""
    if isinstance(one, str):
        dofs = model.dof_slice(one)
        return {one: np.eye(dofs.stop - dofs.start)}
    return {name: np.reshape(gain, (-1, 1)) for name, gain in one.items()}


def offsets(model, targets, steered, offset):
    """Targets (n, nq) with the steered joints' moved by (n, columns), by SciPy."""
    out, column = targets.copy(), 0
    for one in steered:
        width = 0
        for name, gain in gains(model, one).items():
            place, width = model.q_slice(name), gain.shape[1]
            by = offset[:, column : column + width] @ gain.T.astype(np.float32)
            if model.joint_type(name) == "hinge":
                out[:, place] += by
            else:
                out[:, place] = (Rotation.from_quat(out[:, place]) * Rotation.from_rotvec(by)).as_quat()
        column += width
    assert column == offset.shape[1]
    return out


def steered_and_by_hand(model, random, steered, offset, lanes=None, after=0):
    """joint_q, joint_qd and targets after `ROWS - 3` steps along a table: by `Course.step`, and by
    `set_targets` and `step` row by row."""
    targets = table(model, random)
    start = np.tile(model.start_q, (WORLDS, 1))
    start[:, 2] += random.uniform(0.0, 0.01, WORLDS)
    rows, count = random.integers(3, size=WORLDS), ROWS - 3
    one, two = (Simulation(model, WORLDS, lanes=lanes) for _ in range(2))
    course = Course(one, targets, steered)
    assert course.columns == offset.shape[1] and course.offset.shape == offset.shape
    for sim in (one, two):
        sim.reset(joint_q=start)
    course.offset[:] = offset
    course.step(count, rows)
    for k in range(count):
        two.set_targets(offsets(model, targets[rows + k], steered, offset))
        two.step()
    for sim in (one, two):
        sim.step(after)
    assert (np.abs(one.joint_q - start).max(axis=1) > 1e-3).all()
    return ((sim.joint_q, sim.joint_qd, sim._read(sim._world.target)) for sim in (one, two))


def same_sign(model, one, two):
    """Targets of which quaternions say the same with either sign, with the same."""
    two = two.copy()
    for k in model.quaternions():
        two[:, k : k + 4] *= np.sign(np.sum(one[:, k : k + 4] * two[:, k : k + 4], axis=1, keepdims=True))
    return two


@pytest.mark.parametrize("after", [0, 4], ids=["", "then four steps more"])
def test_hinges_are_steered_bit_for_bit(stiff, after):
    """An addition in float32 is the same everywhere. The last targets stay, offsets and all."""
    random = np.random.default_rng(7)
    offset = (0.2 * random.standard_normal((WORLDS, len(HINGES)))).astype(np.float32)
    for one, two in zip(*steered_and_by_hand(stiff, random, HINGES, offset, after=after)):
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("lanes", [1, 16])
def test_balls_are_steered_by_rotation_vectors_in_the_turned_axes(stiff, lanes):
    """Products of quaternions differ from SciPy's by a rounding of 1e-7, which a kp of 500 over 1 kg m^2 and
    some steps make 1e-6 of angles and 1e-4 of rates."""
    random = np.random.default_rng(8)
    offset = (0.4 * random.standard_normal((WORLDS, 8))).astype(np.float32)
    offset[0] = 0.0
    offset[1, 1:4] = 1e-6  # next to none
    one, two = steered_and_by_hand(stiff, random, STEERED, offset, lanes, after=1)
    np.testing.assert_allclose(one[2], same_sign(stiff, one[2], two[2]), atol=5e-7)
    np.testing.assert_allclose(one[0], two[0], atol=5e-6)
    np.testing.assert_allclose(one[1], two[1], atol=5e-4)


@pytest.mark.parametrize("lanes", [1, 16])
def test_signals_move_many_joints_with_a_gain_each(player, lanes):
    """One number bends all fingers (P1 Eq. 1-3), beside joints that have columns of their own. Fingers of
    some grams answer a rounding of their targets more than hips do."""
    random = np.random.default_rng(10)
    steered = ("r_knee", GRIP, "lower_back", SPREAD, "l_elbow")
    offset = (0.3 * random.standard_normal((WORLDS, 7))).astype(np.float32)
    offset[0] = 0.0
    one, two = steered_and_by_hand(player, random, steered, offset, lanes)
    np.testing.assert_allclose(one[2], same_sign(player, one[2], two[2]), atol=5e-7)
    np.testing.assert_allclose(one[0], two[0], atol=1e-5)
    np.testing.assert_allclose(one[1], two[1], atol=2e-3)


def test_a_signal_of_one_joint_is_that_joint(stiff):
    """With a gain of 1, to the bit; and one component of a ball joint is the joint with the others zero."""
    random = np.random.default_rng(11)
    offset = (0.3 * random.standard_normal((WORLDS, 2))).astype(np.float32)
    alone = steered_and_by_hand(stiff, random, ({"r_knee": 1.0}, {"l_hip": (0.0, 1.0, 0.0)}), offset)
    random = np.random.default_rng(11)
    random.standard_normal((WORLDS, 2))
    full = np.zeros((WORLDS, 4), np.float32)
    full[:, [0, 2]] = offset
    whole = steered_and_by_hand(stiff, random, ("r_knee", "l_hip"), full)
    for a, b in zip(next(alone), next(whole)):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("steered", [STEERED, (GRIP, "l_elbow", SPREAD)], ids=["joints", "signals"])
def test_nothing_but_steered_joints_is_moved(player, steered):
    random = np.random.default_rng(9)
    targets = table(player, random)
    sim = Simulation(player, WORLDS)
    course = Course(sim, targets, steered)
    assert course.columns == (8 if steered is STEERED else 3)
    rows = random.integers(ROWS, size=WORLDS)
    course.offset[:] = random.standard_normal(course.offset.shape)
    course.step(1, rows)
    moved = sim._read(sim._world.target) != targets[rows]
    names = [name for one in steered for name in ([one] if isinstance(one, str) else one)]
    places = np.concatenate([np.r_[player.q_slice(name)] for name in names])
    assert moved[:, places].any(axis=0).all()
    assert not np.delete(moved, places, axis=1).any()


def test_offsets_stay_until_changed(stiff):
    """They are live memory: the next step acts on what is there, without a call."""
    targets = np.tile(stiff.start_q, (ROWS, 1)).astype(np.float32)
    sim = Simulation(stiff, 2)
    course, place = Course(sim, targets, ("l_elbow",)), stiff.q_slice("l_elbow").start
    for value in (0.25, -0.5):
        course.offset[1] = value
        for _ in range(2):
            course.step(1, [0, 3])
            change = sim._read(sim._world.target)[:, place] - targets[0, place]
            np.testing.assert_allclose(change, [0, value], atol=1e-7)


def test_nothing_is_steered(stiff):
    """A table alone: no columns, no forces."""
    random = np.random.default_rng(12)
    for one, two in zip(*steered_and_by_hand(stiff, random, (), np.zeros((WORLDS, 0), np.float32))):
        np.testing.assert_array_equal(one, two)


# ------------------------------------------------------------------------------------------------ forces


def pushed_and_by_hand(model, lanes, push, steps=4):
    """Two simulations after three stretches of steps along a table: forces (3, worlds, 2, 3) by a course, and
    by `apply_force`."""
    random = np.random.default_rng(13)
    targets = table(model, random, 3 * steps)
    sims = [Simulation(model, WORLDS, lanes=lanes) for _ in range(2)]
    course = Course(sims[0], targets, pushed=("torso", "r_hand"))
    other = Course(sims[1], targets)
    assert course.push.shape == (WORLDS, 2, 3)
    for k, force in enumerate(push):
        course.push[:] = force
        course.step(steps, k * steps)
        for i, body in enumerate(("torso", "r_hand")):
            sims[1].apply_force(body, force[:, i])
        other.step(steps, k * steps)
    return sims


@pytest.mark.parametrize("lanes", [1, 16])
def test_pushes_are_applied_forces(stiff, lanes):
    """Bit for bit: each world its own, none in the second stretch, others in the third."""
    push = np.random.default_rng(14).uniform(-60, 60, (3, WORLDS, 2, 3)).astype(np.float32)
    push[1] = 0.0
    one, two = pushed_and_by_hand(stiff, lanes, push)
    still = Simulation(stiff, WORLDS, lanes=lanes)
    Course(still, table(stiff, np.random.default_rng(13), 12)).step(12, 0)
    assert (np.abs(one.joint_q - still.joint_q).max(axis=1) > 1e-3).all()
    np.testing.assert_array_equal(one.joint_q, two.joint_q)
    np.testing.assert_array_equal(one.joint_qd, two.joint_qd)


def test_until_something_pushes_no_force_is_looked_for(stiff):
    """A course that may push but does not steps the bits of one that cannot; kernels look for no forces."""
    one, two = pushed_and_by_hand(stiff, None, np.zeros((0, WORLDS, 2, 3)))
    targets = np.tile(stiff.start_q, (ROWS, 1))
    able, unable = Course(one, targets, pushed=("torso",)), Course(two, targets)
    able.step(5, 0)
    unable.step(5, 0)
    assert not one.forced
    np.testing.assert_array_equal(one.joint_q, two.joint_q)
    able.push[2, 0] = [50.0, 0.0, 0.0]
    able.step(2, 0)
    unable.step(2, 0)
    assert one.forced
    apart = (one.joint_q != two.joint_q).any(axis=1)
    assert apart[2] and not np.delete(apart, 2).any()


def test_calm_ends_all_forces(stiff):
    targets = np.tile(stiff.start_q, (ROWS, 1))
    sim = Simulation(stiff, 3)
    course = Course(sim, targets, pushed=("torso", "r_hand"))
    course.push[:] = 40.0
    course.step(2, 0)
    assert sim._read(sim._world.force).any()
    course.calm()
    course.step(1, 0)
    assert not sim._read(sim._world.force).any() and not course.push.any()


# ----------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize("steered", [("root",), ({"l_elbow": 1.0, "root": 1.0},), ("l_elbow", "ball")])
def test_a_free_joint_has_no_drive(player, steered):
    with pytest.raises(ValueError, match=r"joint '(root|ball)' is free: it has no drive here"):
        Course(Simulation(player, 2), np.tile(player.start_q, (ROWS, 1)), steered)


@pytest.mark.parametrize(
    "steered",
    [
        ("l_elbow", "l_elbow"),
        ("l_hip", {"l_hip": (1.0, 0.0, 0.0)}),
        ({"l_hip": (1.0, 0.0, 0.0)}, {"l_elbow": 1.0, "l_hip": (0.0, 1.0, 0.0)}),
    ],
)
def test_a_joint_is_steered_once(player, steered):
    with pytest.raises(ValueError, match=r"joint 'l_(elbow|hip)' is steered twice"):
        Course(Simulation(player, 2), np.tile(player.start_q, (ROWS, 1)), steered)


@pytest.mark.parametrize(
    "signal", [{"l_hip": 1.0}, {"l_hip": (1.0, 2.0)}, {"l_elbow": (1.0, 0.0, 0.0)}, {"l_elbow": [[1.0]]}]
)
def test_a_gain_for_each_dof(player, signal):
    """One number for a ball joint would turn it about an axis that nobody asked for."""
    with pytest.raises(ValueError, match=r"joint 'l_(elbow|hip)' takes a gain for each of [13] dofs"):
        Course(Simulation(player, 2), np.tile(player.start_q, (ROWS, 1)), (signal,))


def test_an_empty_signal_has_a_column(player):
    """It moves nothing, and the columns after it stay where they are."""
    sim = Simulation(player, 2)
    course = Course(sim, np.tile(player.start_q, (ROWS, 1)), ({}, "l_elbow"))
    assert course.columns == 2
    course.offset[:] = [9.0, 0.25]
    course.step(1, 0)
    place = player.q_slice("l_elbow").start
    np.testing.assert_allclose(
        sim._read(sim._world.target)[:, place], player.start_q[place] + 0.25, atol=1e-6
    )


def test_unknown_names(stiff):
    targets = np.tile(stiff.start_q, (ROWS, 1))
    with pytest.raises(KeyError, match=r"no joint named 'tail'"):
        Course(Simulation(stiff), targets, ("tail",))
    with pytest.raises(KeyError, match=r"no joint named 'tail'"):
        Course(Simulation(stiff), targets, ({"tail": 1.0},))
    with pytest.raises(KeyError, match=r"no body named 'tail'"):
        Course(Simulation(stiff), targets, pushed=("tail",))


def test_rows_are_checked(stiff):
    """Each world needs as many rows as there are steps, from its own on."""
    sim = Simulation(stiff, 3)
    course = Course(sim, np.tile(stiff.start_q, (ROWS, 1)))
    before = sim.joint_q
    for rows in (-1, 3, [0, 0, 3], [0, -1, 2]):
        with pytest.raises(IndexError, match=r"rows must lie in 0 .. 2"):
            course.step(5, rows)
    with pytest.raises(IndexError, match="rows must lie in"):
        course.step(ROWS + 1, 0)
    for rows in ([0, 1], [0, 1, 2, 2]):
        with pytest.raises(ValueError):
            course.step(5, rows)
    np.testing.assert_array_equal(sim.joint_q, before)
    course.step(5, [0, 1, 2])
    course.step(ROWS, 0)


def test_shapes_are_checked(stiff):
    sim = Simulation(stiff, WORLDS)
    course = Course(sim, np.tile(stiff.start_q, (ROWS, 1)), STEERED, ("torso",))
    for shape in ((WORLDS, 7), (WORLDS, 9), (WORLDS + 1, 8)):
        with pytest.raises(ValueError):
            course.offset[:] = np.zeros(shape)
    with pytest.raises(ValueError):
        course.push[:] = np.zeros((WORLDS, 2, 3))
    for targets in (np.zeros((ROWS, stiff.nq - 1)), np.zeros((ROWS, stiff.nq + 1)), np.zeros(stiff.nq)):
        with pytest.raises(ValueError, match=rf"targets must have shape \(rows, {stiff.nq}\)"):
            Course(sim, targets)
