"""The ball in the hands: carried on one, held between two, without jitter."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model, Simulation
from warpdribble.sims.model.pose import place_limb

STEP = 0.01


@pytest.fixture(scope="module")
def model():
    return Model.load("player")


def ball_velocities(sim, model, steps, target=None):
    """(steps, 3) of the first world's ball, with `target(k)` set before each step."""
    velocities = []
    for k in range(steps):
        if target is not None:
            sim.set_targets(target[k])
        sim.step()
        velocities.append(sim.joint_qd[0, model.dof_slice("ball")][:3])
    return np.array(velocities)


def rms(acceleration):
    return np.sqrt((acceleration**2).sum(1).mean())


def test_ball_rests_on_an_upturned_hand(model):
    """5 s on the idle hand (P1's lambda = 0.2), root free; the player sways as it finds its balance."""
    sim = Simulation(model, 1)
    sim.reset(joint_q=model.keyframes["hold"])
    sim.set_targets(model.keyframes["hold"])
    velocity = ball_velocities(sim, model, 500)
    hand = sim.body_q[0, model.body("r_hand"), :3]
    ball = sim.body_q[0, model.body("ball"), :3]
    assert np.linalg.norm(ball - hand) < 0.16  # radius, half the palm, and no more
    assert ball[2] > hand[2] + 0.1
    assert sim.status[0] == 0
    assert rms(np.diff(velocity[200:], axis=0) / STEP) < 0.5


def between_hands(model, ball, squeeze):
    """joint_q (n, nq) with the palms on either side of the ball (n, 3), `squeeze` [m] inside it."""
    q = np.tile(model.keyframes["start"], (len(ball), 1))
    apart = 0.1193 + 0.013 - squeeze
    # fingers forward, palms facing: columns are the hand's axes in the world
    left = Rotation.from_matrix(np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]))
    right = Rotation.from_matrix(np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]))
    place_limb(model, q, "l_elbow", ball + [-0.1, apart, 0], left, [0, 0.3, -1])
    place_limb(model, q, "r_elbow", ball + [-0.1, -apart, 0], right, [0, -0.3, -1])
    return q


def test_ball_is_held_between_moving_hands(model):
    """The ball goes with the hands for 6 s and shakes no more than they do."""
    middle = np.array([0.38, 0.0, 1.12])
    time = np.arange(600)[:, None] * STEP
    path = middle + np.hstack([0.04 * np.sin(2 * time), 0 * time, 0.08 * np.sin(3 * time)])
    start = between_hands(model, middle[None], 0.004)[0]
    start[model.q_slice("ball")] = [*middle, 0, 0, 0, 1]
    sim = Simulation(model, 1)
    sim.set_root_drive(20000, 2000, 2000, 200)  # a passive player would lean over with its arms out
    sim.reset(joint_q=start)
    velocity = ball_velocities(sim, model, 600, between_hands(model, path, 0.04))
    assert sim.status[0] == 0
    ball = sim.body_q[0, model.body("ball"), :3]
    assert np.linalg.norm(ball - path[-1]) < 0.08  # the wrists give way to its weight
    acceleration = np.diff(velocity[200:], axis=0) / STEP
    wanted = np.diff(path[200:], 2, axis=0) / STEP**2
    assert rms(acceleration) < rms(wanted) + 0.5
