"""Where a trajectory begins."""

import numpy as np
import pytest

from warpdribble.sims import Model
from warpdribble.sims.model import pose
from warpdribble.sims.trajectory import Trajectory, centred


@pytest.fixture(scope="module")
def full():
    return Model.load("player")


def strayed(model, places):
    """A player that stands at places (frames, 2), its ball with it; its reference stays at the first."""
    joint_q = np.tile(model.start_q, (len(places), 1))
    for joint in ("root", "ball"):
        first = model.q_slice(joint).start
        joint_q[:, first : first + 2] += places
    wanted = np.tile(joint_q[0], (len(places), 1))
    return Trajectory(joint_q, pose.forward(model, joint_q), 0.01, wanted)


def test_it_begins_in_the_middle_and_stays_the_same_motion(full):
    seen = strayed(full, np.array([[40.0, -7.0], [41.0, -7.5], [43.0, -7.0]]))
    found = centred(full, seen)
    pelvis = full.body("pelvis")
    np.testing.assert_allclose(found.body_q[0, pelvis, :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(found.body_q, pose.forward(full, found.joint_q), atol=1e-9)
    np.testing.assert_array_equal(found.reference_q[0], found.joint_q[0])
    for before, after in ((seen.body_q, found.body_q), (seen.reference_q, found.reference_q)):
        np.testing.assert_allclose(np.diff(after, axis=0), np.diff(before, axis=0), atol=1e-12)
    between = full.body("ball")
    np.testing.assert_allclose(
        found.body_q[:, between, :3] - found.body_q[:, pelvis, :3],
        seen.body_q[:, between, :3] - seen.body_q[:, pelvis, :3],
        atol=1e-12,
    )
    assert seen.body_q[0, pelvis, 0] > 39.0  # what was given is left alone


@pytest.mark.parametrize(
    "fixed",
    [
        '<geom type="box" size=".1 .1 .1" pos="41 0 1"/>',
        '<body name="post" pos="41 0 0"><geom type="box" size=".1 .1 .1"/></body>',
    ],
)
def test_beside_what_is_fixed_nothing_is_moved(tmp_path, fixed):
    text = """<mujoco><worldbody><geom type="plane" size="1 1 1"/>{}<body name="pelvis" pos="40 0 1">
    <freejoint name="root"/><geom type="sphere" size=".1"/></body></worldbody></mujoco>"""
    starts = []
    for number, between in enumerate((fixed, "")):
        path = tmp_path / f"{number}.xml"
        path.write_text(text.format(between))
        model = Model.load(path)
        joint_q = np.tile(model.start_q, (2, 1))
        seen = Trajectory(joint_q, pose.forward(model, joint_q), 0.01, joint_q)
        starts.append(centred(model, seen).body_q[0, model.body("pelvis"), 0])
    assert starts == [40.0, 0.0]
