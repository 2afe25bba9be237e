"""Balls of their own for each world: as they bounce and fall, not as they were set."""

import numpy as np
import pytest

from warpdribble.learning.tasks.arms import RESTITUTION
from warpdribble.learning.tasks.balls import Balls, widened
from warpdribble.sims import Model, Simulation

WORLDS = 5
DRAWN = np.stack([np.linspace(-1.0, 1.0, WORLDS), np.linspace(1.0, -1.0, WORLDS)], axis=1)


class Held:
    """As much of a task as balls are put into."""

    def __init__(self):
        self.model, self.worlds = Model.load("player"), WORLDS
        self.sim = Simulation(self.model, WORLDS)


def bounced(task):
    """(worlds,) square root of the share of its height to which a ball that falls beside the player comes
    back."""
    q, qd = np.array(task.sim.joint_q), np.zeros_like(task.sim.joint_qd)
    place = task.model.q_slice(task.model.roles.one("ball_joint")).start
    q[:, place : place + 3] = [2.0, 0.0, 0.6]
    task.sim.reset(joint_q=q, joint_qd=qd)
    heights = []
    for _ in range(90):
        task.sim.step()
        heights.append(task.sim.joint_q[:, place + 2])
    first = 30  # it falls for 31 steps
    assert np.argmin(np.array(heights)[:60], axis=0).max() <= first + 2
    own = task.model.ball_radius
    return np.sqrt((np.max(heights[first + 3 :], axis=0) - own) / (0.6 - own))


@pytest.fixture(scope="module")
def task():
    one = Held()
    ball = one.model.roles.one("ball_joint")
    rate = np.array(one.sim.joint_qd)
    one.sim.step()
    fell = one.sim.joint_qd[0] - rate[0]
    own = one.model.dof_slice(ball)
    one.up = int(np.argmin(fell[own]))
    return one


def test_they_bounce_as_they_were_drawn(task):
    Balls(restitution=0.15).put(task, 1.0, DRAWN)
    np.testing.assert_allclose(bounced(task), RESTITUTION + 0.15 * DRAWN[:, 0], atol=0.005)
    Balls(restitution=0.15).put(task, 0.4, DRAWN)
    np.testing.assert_allclose(bounced(task), RESTITUTION + 0.06 * DRAWN[:, 0], atol=0.005)


def test_they_weigh_as_they_were_drawn(task):
    """A force pulls them accordingly."""
    Balls(mass=0.3).put(task, 0.5, DRAWN)
    ball = task.model.roles.one("ball")
    joint = task.model.roles.one("ball_joint")
    place, speed = task.model.q_slice(joint).start, task.model.dof_slice(joint)
    q = np.array(task.sim.joint_q)
    q[:, place : place + 3] = [2.0, 0.0, 1.0]
    task.sim.reset(joint_q=q, joint_qd=np.zeros_like(task.sim.joint_qd))
    mass = task.model.body_mass[task.model.body(ball)]
    task.sim.apply_force(ball, [4.0, 0.0, 0.0])
    task.sim.step()
    v = np.abs(task.sim.joint_qd[:, speed])
    v[:, task.up] = 0.0
    np.testing.assert_allclose(v.max(axis=1), 0.01 * 4.0 / (mass * (1.0 + 0.15 * DRAWN[:, 1])), rtol=2e-3)


def test_each_end_has_a_share_of_its_own(task):
    Balls(restitution=0.15).put(task, np.array([[0.4, 1.0], [0.3, 0.3]]), DRAWN)
    wanted = 0.15 * DRAWN[:, 0] * np.where(DRAWN[:, 0] < 0.0, 0.4, 1.0)
    np.testing.assert_allclose(bounced(task), RESTITUTION + wanted, atol=0.005)


def test_ends_go_out_where_balls_near_them_are_kept():
    """Less restitution is lost too often, a little too often on the other side; of masses, one end is as far
    as it goes, and at the other nobody had a ball."""
    drawn = np.array([[-0.9, 0.95], [-0.85, 0.0], [0.0, 0.9], [0.9, 0.5], [0.5, -0.7]])
    lost = np.array([0.08, 0.02, 0.0, 0.03, 1.0])
    share = np.array([[0.5, 0.5], [0.5, 0.98]])
    got = widened(share, drawn, lost, few=0.02, by=1.1)
    np.testing.assert_allclose(got, [[0.5 / 1.1, 0.5], [0.5, 0.98 / 1.0]])
    lost[:] = 0.0
    got = widened(share, drawn, lost, few=0.02, by=1.1)
    np.testing.assert_allclose(got, [[0.55, 0.55], [0.5, 1.0]])
    for _ in range(99):
        got = widened(got, drawn, np.ones(5), few=0.02, by=1.1)
    np.testing.assert_allclose(got, [[0.1, 0.1], [0.5, 0.1]])


def test_what_is_kept_goes_out_to_the_end():
    """Where balls are lost beyond a place, the end settles near it, from either side."""
    rng = np.random.default_rng(0)
    share = np.array([[0.1, 1.0], [0.1, 0.1]])
    for _ in range(200):
        drawn = rng.uniform(-1.0, 1.0, (1024, 2))
        ends = np.where(drawn < 0.0, *share.T)
        lost = 0.1 * (np.abs(ends[:, 0] * drawn[:, 0]) > 0.6)
        share = widened(share, drawn, lost, few=0.02, by=1.03)
    assert np.all((share[0] > 0.6) & (share[0] < 0.75)) and np.all(share[1] == 1.0)
