import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model
from warpdribble.sims.reference.reference import (
    Cycle,
    Reference,
    close_cycle,
    difference,
    integrate,
    resample_q,
)


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


def random_motion(model, count=5, size=0.5, seed=0):
    return size * np.random.default_rng(seed).normal(size=(count, model.nv))


def walk(model, frames=51, travel=(1.2, 0.3), turn=0.6, gap=0.05):
    """Joint coordinates that wander a little and walk a long way."""
    share = np.linspace(0.0, 1.0, frames)[:, None]
    sway = np.sin(2.0 * np.pi * share) * random_motion(model, 1, 0.3)
    joint_q = integrate(model, np.tile(model.start_q, (frames, 1)), sway)
    joint_q = integrate(model, joint_q, share * random_motion(model, 1, gap, seed=1))
    joint_q[:, :2] = share * travel
    yaw = Rotation.from_rotvec(share * [0.0, 0.0, turn])
    joint_q[:, 3:7] = (yaw * Rotation.from_quat(joint_q[:, 3:7])).as_quat()
    return Reference(joint_q, model.timestep)


def test_integrate_undoes_difference(player):
    start = integrate(player, np.tile(player.start_q, (5, 1)), random_motion(player))
    motion = random_motion(player, seed=1)
    end = integrate(player, start, motion)
    assert np.allclose(difference(player, start, end), motion, atol=1e-9)


def wxyz(model, joint_q):
    """As MuJoCo has it."""
    qpos = joint_q.copy()
    for k in model.quaternions():
        qpos[..., k : k + 4] = np.roll(joint_q[..., k : k + 4], 1, axis=-1)
    return qpos


def test_differences_and_integrals_are_mujoco_s(player):
    """Rotations of a child in its own axes, as mj_differentiatePos and mj_integratePos have them."""
    m = mujoco.MjModel.from_xml_path(str(player.path))
    start = integrate(player, np.tile(player.start_q, (6, 1)), random_motion(player, 6))
    end = integrate(player, start, random_motion(player, 6, seed=2))
    motion = difference(player, start, end)
    for a, b, v in zip(wxyz(player, start), wxyz(player, end), motion):
        theirs, reached = np.empty(m.nv), a.copy()
        mujoco.mj_differentiatePos(m, theirs, 1.0, a, b)
        np.testing.assert_allclose(v, theirs, atol=1e-12)
        mujoco.mj_integratePos(m, reached, v, 1.0)
        for k in player.quaternions():  # which say the same with either sign
            reached[k : k + 4] *= np.sign(reached[k : k + 4] @ b[k : k + 4])
        np.testing.assert_allclose(reached, b, atol=1e-12)


def test_any_number_of_axes(player):
    start = integrate(player, np.tile(player.start_q, (2, 3, 1)), np.zeros((2, 3, player.nv)))
    motion = random_motion(player, 6).reshape(2, 3, -1)
    end = integrate(player, start, motion)
    np.testing.assert_array_equal(end[1, 2], integrate(player, start[1, 2], motion[1, 2]))
    np.testing.assert_array_equal(
        difference(player, start, end)[1, 2], difference(player, start[1, 2], end[1, 2])
    )


def test_velocity_times_the_step_leads_to_the_next_row(player):
    reference = walk(player)
    velocity = reference.velocity(player)
    assert velocity.shape == (reference.frame_count, player.nv)
    after = integrate(player, reference.joint_q[:-1], player.timestep * velocity[:-1])
    assert np.abs(difference(player, after, reference.joint_q[1:])).max() < 1e-9


def test_a_closed_cycle_ends_where_the_next_begins(player):
    cycle = close_cycle(player, walk(player))
    assert np.hypot(*cycle.travel) == pytest.approx(np.hypot(1.2, 0.3), abs=0.01)
    assert cycle.turn == pytest.approx(0.6, abs=0.1)
    first, last = cycle.reference.joint_q[[0, -1]]
    apart = difference(player, first[None], last[None])[0]
    assert np.abs(apart[6:]).max() < 1e-9
    assert apart[2] == pytest.approx(0.0, abs=1e-9)


def test_drift_of_somebody_standing_is_closed(player):
    cycle = close_cycle(player, walk(player, travel=(0.07, 0.02), turn=-0.1))
    assert cycle.turn == 0.0 and cycle.travel == (0.0, 0.0)
    first, last = cycle.reference.joint_q[[0, -1]]
    assert np.abs(difference(player, first[None], last[None])).max() < 1e-9


@pytest.mark.parametrize("count", [1, 3])
def test_repeated_cycles_join_without_a_jump(player, count):
    cycle = close_cycle(player, walk(player))
    frames = cycle.reference.frame_count
    joint_q = cycle.repeat(player, count).joint_q
    assert len(joint_q) == count * (frames - 1) + 1
    inside = np.abs(difference(player, cycle.reference.joint_q[:-1], cycle.reference.joint_q[1:]))
    steps = np.abs(difference(player, joint_q[:-1], joint_q[1:]))
    assert steps[:, 6:].max() == pytest.approx(inside[:, 6:].max())
    length = np.linalg.norm(np.diff(joint_q[:, :2], axis=0), axis=1)
    assert (
        length.max() < 1.001 * np.linalg.norm(np.diff(cycle.reference.joint_q[:, :2], axis=0), axis=1).max()
    )


def test_what_goes_along_is_ahead_in_the_next_cycle(player):
    """The root in a row of the next cycle is that of this one, ahead; points go along with it."""
    cycle = close_cycle(player, walk(player))
    twice, count = cycle.repeat(player, 2).joint_q[:, player.q_slice("root")], cycle.reference.frame_count
    own = cycle.reference.joint_q[:-1, player.q_slice("root")]
    ahead = cycle.ahead(player, own)
    np.testing.assert_allclose(ahead, twice[count - 1 : -1], atol=1e-12)
    np.testing.assert_array_equal(cycle.ahead(player, own[:, :3]), ahead[:, :3])


def test_a_cycle_cannot_be_repeated_less_than_once(player):
    with pytest.raises(ValueError, match="at least once"):
        close_cycle(player, walk(player)).repeat(player, 0)


def test_resampled_rows_have_unit_quaternions(player):
    rows = resample_q(player, walk(player).joint_q, np.array([0.0, 0.5, 17.3, 50.0]))
    for k in player.quaternions():
        assert np.allclose(np.linalg.norm(rows[:, k : k + 4], axis=1), 1.0)
    assert np.allclose(rows[0], walk(player).joint_q[0], atol=1e-9)


@pytest.mark.parametrize("faces", [0.0, 1.0, -2.0, 3.1])
@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_the_way_of_a_cycle_is_seen_from_the_player(player, faces, turn):
    """Two metres ahead and half a metre to the right, whichever way it faces in the world, hips swaying."""
    share = np.linspace(0.0, 1.0, 101)
    joint_q = np.tile(player.start_q, (101, 1))
    yaw = faces + turn * share + 0.3 * np.sin(2.0 * np.pi * share)
    joint_q[:, 3:7] = Rotation.from_rotvec(yaw[:, None] * [0.0, 0.0, 1.0]).as_quat()
    ahead, left = np.array([np.cos(faces), np.sin(faces)]), np.array([-np.sin(faces), np.cos(faces)])
    cycle = Cycle(Reference(joint_q, player.timestep), turn, tuple(2.0 * ahead - 0.5 * left))
    assert cycle.way == pytest.approx((2.0, -0.5), abs=1e-9)
