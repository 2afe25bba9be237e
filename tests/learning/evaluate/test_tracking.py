"""Trajectories in numbers, on ones that were made up."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.learning.evaluate.tracking import FALLEN, LIGHT, touches, track
from warpdribble.sims import Model
from warpdribble.sims.authored.dribble import dribble_right
from warpdribble.sims.model import pose
from warpdribble.sims.planar import planar
from warpdribble.sims.trajectory import Trajectory


@pytest.fixture(scope="module")
def full():
    return Model.load("player")


@pytest.fixture(scope="module")
def dribbled(full):
    return dribble_right(full).reference.joint_q


def seen(model, joint_q, reference_q):
    return Trajectory(joint_q, pose.forward(model, joint_q), 0.01, reference_q)


def test_the_reference_itself_is_not_off(full, dribbled):
    found = track(full, seen(full, dribbled, dribbled))
    assert found.angle_error.max() < 1e-6 and found.position_error.max() < 1e-9
    assert found.falls == 0 and not found.fallen.any()
    np.testing.assert_array_equal(found.root, found.wanted_root)
    assert set(found.contacts) == {
        "ball on ground",
        "ball on right hand",
        "ball on left hand",
        "right foot down",
        "left foot down",
    }
    assert found.contacts["ball on right hand"].any() and not found.contacts["ball on left hand"].any()
    assert found.contacts["ball on ground"].any()


def test_a_bent_knee_is_off_by_its_share(full, dribbled):
    """Over the joints of bodies that are not light; the bodies below it are not where they should be."""
    bent = np.array(dribbled)
    bent[:, full.q_slice("l_knee")] += 0.3
    found = track(full, seen(full, bent, dribbled))
    joints = [
        name
        for name in full.joint_names
        if name not in ("root", "ball") and full.body_mass[full.joint_body(name)] > LIGHT
    ]
    assert len(joints) == 19
    np.testing.assert_allclose(found.angle_error, 0.3 / len(joints), rtol=1e-6)
    assert found.position_error.min() > 0.001


def test_fingers_do_not_count(full, dribbled):
    bent = np.array(dribbled)
    bent[:, full.q_slice("l_index_pip")] += 1.0
    found = track(full, seen(full, bent, dribbled))
    assert found.angle_error.max() < 1e-6 and found.position_error.max() < 1e-9


def test_falls_are_counted(full, dribbled):
    """Lower than a share of the reference's height; twice, if it got up in between."""
    low = np.array(dribbled)
    for rows in (slice(10, 20), slice(40, None)):
        low[rows, 2] *= FALLEN - 0.01
    found = track(full, seen(full, low, dribbled))
    assert found.falls == 2 and found.fallen.sum() == 10 + len(low) - 40
    low[:, 2] = (FALLEN + 0.01) * dribbled[:, 2]
    assert track(full, seen(full, low, dribbled)).falls == 0


def test_drift_is_told_apart_from_being_off(full, dribbled):
    """Ever further and ever more turned, every joint as it should be: nothing is off; a bent knee is off by
    the same wherever it happens."""
    strayed, bent = np.array(dribbled), np.array(dribbled)
    bent[:, full.q_slice("l_knee")] += 0.3
    both, share = np.array(bent), np.linspace(0.0, 1.0, len(dribbled))
    by = Rotation.from_rotvec(np.outer(2.5 * share, [0.0, 0.0, 1.0]))
    for rows in (strayed, both):
        rows[:, :2] += share[:, None] * [30.0, -40.0]
        rows[:, 3:7] = (by * Rotation.from_quat(rows[:, 3:7])).as_quat()
    found = track(full, seen(full, strayed, dribbled))
    assert found.angle_error.max() < 1e-6 and found.position_error.max() < 1e-9
    assert np.hypot(*found.drift[-1, :2]) == pytest.approx(50.0)
    np.testing.assert_allclose(found.drift[:, 2], 2.5 * share, atol=1e-9)
    knees = [track(full, seen(full, rows, dribbled)).position_error for rows in (bent, both)]
    np.testing.assert_allclose(*knees, atol=1e-9)


def test_drift_is_seen_from_where_the_reference_faces(full, dribbled):
    """Facing +Y, a metre along +Y is ahead and one along -X is to the left."""
    faced, moved = np.array(dribbled), np.array(dribbled)
    by = Rotation.from_euler("z", 0.5 * np.pi)
    straight = by * Rotation.from_euler("z", -planar(dribbled)[:, 2:]) * Rotation.from_quat(faced[:, 3:7])
    faced[:, 3:7] = moved[:, 3:7] = straight.as_quat()
    moved[:, :2] += [-0.5, 2.0]
    drift = track(full, seen(full, moved, faced)).drift
    np.testing.assert_allclose(drift, np.tile([2.0, 0.5, 0.0], (len(drift), 1)), atol=1e-9)


def test_without_a_ball_there_are_feet(full, dribbled):
    bare = Model.load("player", without=("ball",))
    joint_q = bare.convert_q(full, dribbled)
    found = track(bare, seen(bare, joint_q, joint_q))
    assert set(found.contacts) == {"right foot down", "left foot down"}
    assert found.contacts["right foot down"].all()


def test_a_bounce_between_two_frames_counts_as_contact():
    gap = np.array([0.30, 0.21, 0.12, 0.03, 0.04, 0.11, 0.18])
    assert touches(gap).tolist() == [False] * 3 + [True] + [False] * 3
    hover = np.array([0.05, 0.0499, 0.05])
    assert not touches(hover).any()
