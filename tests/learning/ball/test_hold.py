"""A ball put into hands touches palm and fingers, and nothing else."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.learning.ball.hold import CLEAR, closed, in_hand, put_out
from warpdribble.learning.tasks.fingers import FINGERS, READY, finger_signals
from warpdribble.sims.model import pose
from warpdribble.sims.worlds import Simulation

NEAR = 0.004  # [m] three signals cannot bring five tips to a ball exactly
OVERLAP = 0.0005  # [m] penalised, not forbidden


def gaps(model, q, side):
    """(6,) [m] from the tips and the palm of a hand to the ball, by float64 kinematics."""
    body_q = pose.forward(model, q)[0]
    ball = q[model.q_slice(model.roles.one("ball_joint"))][:3]
    names = [f"{side}_{finger}_tip" for finger in FINGERS] + [f"{side}_palm"]
    places = []
    for body, at, _ in (model.sites[name] for name in names):
        places.append(body_q[body, :3] + Rotation.from_quat(body_q[body, 3:]).apply(at))
    return np.linalg.norm(np.array(places) - ball, axis=1) - model.ball_radius


def test_palm_and_fingers_touch_the_ball(full, dribbled):
    before = dribbled.start_q[11]
    q = in_hand(full, before, np.array([False, True]))
    assert np.abs(gaps(full, before, "r")).max() > 0.02
    assert np.abs(gaps(full, q, "r")).max() < NEAR
    sim = Simulation(full, 1)
    sim.reset(joint_q=q)
    contacts, bad = sim.contacts(), full.tables["slot_flag"] == 2
    ball = np.array(["ball" in shapes for shapes in contacts.shapes])
    assert contacts.gap[0, ball].min() > -OVERLAP
    assert contacts.gap[0, ball & bad].min() > CLEAR - OVERLAP
    others = [
        j.q for j in full.joints if not j.name.startswith("r_") and j.name != full.roles.one("ball_joint")
    ]
    for own in others:
        np.testing.assert_array_equal(q[own], before[own])


def test_nobody_holds_it(full, dribbled):
    with pytest.raises(ValueError, match="no hand"):
        in_hand(full, dribbled.start_q[3], np.zeros(2, bool))


def room(model, q):
    """[m] from the ball to the nearest of what is not a hand, and of all."""
    sim = Simulation(model, 1)
    sim.reset(joint_q=q)
    contacts = sim.contacts()
    ball = np.array(["ball" in shapes for shapes in contacts.shapes])
    bad = model.tables["slot_flag"] == 2
    return contacts.gap[0, ball & bad].min(), contacts.gap[0, ball].min()


def test_a_ball_in_the_thigh_comes_out_the_short_way(full, dribbled):
    """By its depth, where no hand has it; where one does it stays with the palm; the rest is as before."""
    ball = full.q_slice(full.roles.one("ball_joint")).start
    leg = pose.forward(full, dribbled.start_q[11])[0, full.body("r_upper_leg")]
    inside = dribbled.start_q[11].copy()
    along = Rotation.from_quat(leg[3:]).apply([0.0, 0.0, -0.2])
    inside[ball : ball + 3] = leg[:3] + along + [0.14, -0.06, 0.0]
    before = room(full, inside)[0]
    assert before < -0.02
    held = in_hand(full, dribbled.start_q[11], np.array([False, True]))
    into = held.copy()
    into[ball : ball + 3] += [0.0, 0.0, 0.03]  # into the palm
    assert room(full, into)[1] < -0.01
    hands = np.array([[False, False], [False, True], [False, False]])
    out, back, same = put_out(full, np.stack([inside, into, held]), hands)
    assert room(full, out)[0] > CLEAR - OVERLAP
    by = np.linalg.norm(out[ball : ball + 3] - inside[ball : ball + 3])
    assert CLEAR - before - OVERLAP < by < 1.3 * (CLEAR - before)
    assert room(full, back)[1] > -OVERLAP and abs(gaps(full, back, "r")[-1]) < NEAR
    np.testing.assert_allclose(same, held, atol=2e-4)
    for q, was in ((out, inside), (back, into)):
        np.testing.assert_array_equal(
            np.delete(q, range(ball, ball + 3)), np.delete(was, range(ball, ball + 3))
        )


def test_closed_from_ready_to_flat_and_to_fist(full):
    """Signals lead from one keyframe to the others, as `READY` has it."""
    ready, hands = np.array(full.keyframes["ready"]), np.array([True, True])
    by = np.array([np.full((2, 3), -READY), np.full((2, 3), 1.0 - READY)])
    for q, name in zip(closed(full, finger_signals(full), ready, hands, by), ("flat", "fist")):
        to = np.array(full.keyframes[name])
        for joint in full.joints:
            if not any(joint.name[2:].startswith(finger) for finger in FINGERS):
                continue
            if joint.kind == "ball":
                turn = Rotation.from_quat(q[joint.q]).inv() * Rotation.from_quat(to[joint.q])
                assert turn.magnitude() < 1e-6, joint.name
            else:
                np.testing.assert_allclose(q[joint.q], to[joint.q], atol=1e-9, err_msg=joint.name)
