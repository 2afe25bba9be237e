"""A policy step by step does what it does fragment by fragment, on any model that has the player's joints."""

import numpy as np
import pytest

from warpdribble.learning.evaluate.steer import Steered
from warpdribble.learning.evaluate.trials import reference_states, run_trials
from warpdribble.learning.graph import STEPS, cyclic_graph
from warpdribble.learning.runs.folder import Run
from warpdribble.learning.tasks.disturbance import Disturbance
from warpdribble.learning.tasks.locomotion import Locomotion
from warpdribble.sims import Model
from warpdribble.sims.authored.dribble import dribble_right
from warpdribble.sims.reference.reference import Cycle


@pytest.fixture(scope="module")
def learned():
    return Run.load("dribble-right-authored")


def test_steps_add_up_to_fragments(learned):
    task = learned.task(5)
    k = np.array([0, 3, 7, 12, 13])
    start = learned.graph.start_q[k], learned.graph.start_qd[k]
    felt = task.reset(k, *start)
    at = k
    for _ in range(6):
        felt = task.advance(at, learned.policy.act(task.state(felt, at), at))
        at = (at + 1) % learned.graph.count
    whole = task.sim.joint_q
    task.reset(k, *start)
    steered = Steered(task, learned.policy, k, np.random.default_rng(0))
    for _ in range(6 * STEPS):
        steered.step()
    np.testing.assert_array_equal(task.sim.joint_q, whole)
    np.testing.assert_array_equal(steered.k, (at - 1) % learned.graph.count)


def test_learned_on_stiff_hands_it_carries_the_full_player_and_a_ball(learned):
    """101 degrees of freedom, a ball in play, pushes of up to 200 N: all stand; the open loop falls."""
    model = Model.load("player")
    graph = cyclic_graph(model, Cycle(dribble_right(model).reference))
    task = Locomotion(model, graph, 32)
    pushed = Disturbance(push=200.0, push_every=2.0)
    blind = task.open_loop()
    lasted = [
        run_trials(task, policy, reference_states(graph), 20, 1, 0.15, pushed).survived.mean()
        for policy in (learned.policy, blind)
    ]
    assert lasted[0] == 1.0 and lasted[1] < 0.2
