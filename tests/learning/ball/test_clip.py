"""A clip, here two cycles of the authored dribble in a row, root held: its windows are found one by one, each
with what comes behind it, and play back."""

from dataclasses import replace

import numpy as np
import pytest

from warpdribble.learning.ball.optimised import Optimised, played
from warpdribble.learning.graph import clip_graph
from warpdribble.learning.methods.ball import BallConfig, make, task
from warpdribble.learning.runs.stage import Context
from warpdribble.learning.tasks.fingers import with_ready_hands
from warpdribble.sims.authored.catalogue import authored_clip
from warpdribble.sims.ball.ball import Ball, find_checkpoints
from warpdribble.sims.reference import Reference


@pytest.fixture(scope="module")
def context(full):
    one = authored_clip(full, "dribble_right")
    joint_q = with_ready_hands(full, one.reference.joint_q, np.array([False, True]))
    joint_q = np.concatenate([joint_q[:-1], joint_q])
    touch = np.concatenate([one.ball.touch[:-1], one.ball.touch])
    path = joint_q[:, full.q_slice(full.roles.one("ball_joint"))][:, :3]
    rows = find_checkpoints(path[:, 2], touch)
    ball = Ball(path, touch, rows, one.ball.heights * len(rows))
    reference = Reference(joint_q, one.reference.timestep)
    graph = replace(clip_graph(full, reference, (), 0.1, ball), tracked=True)
    return Context(graph, BallConfig())


def test_windows_are_found_in_a_row_and_play_back(context):
    learner = make(context)
    assert len(learner.windows) > 1
    while not learner.done:
        assert learner.iterate().found
    found = Optimised.of(learner.result)
    np.testing.assert_array_equal(found.k, np.concatenate(learner.windows))
    assert 100.0 * np.nanmean(found.fingers) < 3.0
    lived, fingers = played(task(context, 8), found)
    assert (lived == len(found)).all()
    np.testing.assert_array_equal(fingers, found.fingers)
