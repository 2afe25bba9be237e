"""The mirror of states and actions, against the mirror of references: a simulated player and its mirror image
feel mirrored states, and go on as mirror images."""

from dataclasses import replace

import numpy as np
import pytest

from warpdribble.learning import STAGES, Run
from warpdribble.learning.choose import Ahead
from warpdribble.learning.rollout import Rollout
from warpdribble.learning.starts import Starts
from warpdribble.learning.tasks.arms import STATES, Arms
from warpdribble.learning.tasks.follow import OpenLoop
from warpdribble.learning.tasks.locomotion import STEERED
from warpdribble.learning.tasks.mirror import Mirror, observed, other_side, turned
from warpdribble.sims import Model, Reference
from warpdribble.sims.reference.mirror import FLIP, mirrored
from warpdribble.sims.worlds import terms
from warpdribble.skills import read_skill, skill_graph

SKILL = "dribble-right-authored"


@pytest.fixture(scope="module")
def model():
    return Model.load("player")


@pytest.fixture(scope="module")
def graphs():
    """A dribble with the right hand, and its twin."""
    skill = read_skill(SKILL)
    return skill_graph(skill)[0], skill_graph(replace(skill, mirror=True))[0]


def image(model, starts):
    """States in the mirror."""
    q = mirrored(model, Reference(starts.joint_q, model.timestep)).joint_q
    qd = np.zeros_like(starts.joint_qd)
    for joint in model.joints:
        other = model.joints[model.joint(other_side(joint.name))]
        if joint.kind == "hinge":
            sign = np.sign(FLIP * other.axis @ joint.axis)
        else:
            sign = FLIP if joint.kind == "ball" else np.array([1.0, -1.0, 1.0, *FLIP])
        qd[:, joint.dof] = sign * starts.joint_qd[:, other.dof]
    return Starts(starts.k, q, qd)


@pytest.mark.parametrize("state", STATES)
def test_mirror_images_feel_mirrored_states_and_stay_mirror_images(model, graphs, state):
    one, other = (Arms(model, graph, 4, OpenLoop(STEERED), state=state) for graph in graphs)
    feel, act = one.mirrored()
    rng = np.random.default_rng(0)
    k = np.array([0, 3, 7, 11])
    starts = Starts(
        k, graphs[0].start_q[k].copy(), graphs[0].start_qd[k] + 0.1 * rng.normal(size=(4, model.nv))
    )
    place = model.q_slice(model.roles.one("ball_joint")).start
    starts.joint_q[:, place : place + 3] += 0.02 * rng.normal(size=(4, 3))
    one.reset(starts)
    other.reset(image(model, starts))
    assert len(feel) == one.obs and len(act) == one.actions
    seen = one.observe(k)
    assert np.abs(seen).max() > 0.1
    np.testing.assert_allclose(other.observe(k), feel(seen), atol=2e-3)
    np.testing.assert_allclose(feel(feel(seen)), seen, atol=1e-12)
    action = 0.2 * rng.normal(size=(4, one.actions))
    np.testing.assert_array_equal(act(act(action)), action)
    np.testing.assert_array_equal(other.active[k], one.active[k][:, act.source])
    one.advance(k, action)
    other.advance(k, act(action))
    k = k + 1
    np.testing.assert_allclose(other.observe(k), feel(one.observe(k)), atol=0.05)


def test_legs_steer_in_the_mirror(model, graphs):
    """Ten fragments of a stride: the twin's legs do the mirrored actions."""
    run = Run.load(SKILL)
    learned = run.learned(STAGES, "locomotion")
    legs = learned.controller
    one = learned.task(1)
    twin = type(one)(one.model, graphs[1].on(one.model, model), 1)
    feel, act = one.mirrored()

    class Twin:
        def act(self, s, k):
            return act(legs.act(feel(s), k))

    starts = learned.starts[:1]
    seen = []
    for task, who, begin in ((one, legs, starts), (twin, Twin(), image(one.model, starts))):
        rollout = Rollout(task, who, Ahead(), begin)
        seen.append(np.array([fragment.obs[0] for fragment in rollout.fragments(10)]))
    np.testing.assert_allclose(seen[1], feel(seen[0]), atol=0.1)


def test_what_lacks_its_other_side_is_refused(model):
    with pytest.raises(ValueError, match="'l_foot' has no 'r_foot' beside it"):
        observed({"l_foot": terms.point("l_foot")}, ["l_foot"])
    with pytest.raises(ValueError, match="'l_hip' has no 'r_hip' beside it"):
        turned(model, ["l_hip"])
    assert other_side("to l_thumb_tip") == "to r_thumb_tip" and other_side("all_round") == "all_round"


def test_parts_stay_apart():
    swap, stay = Mirror(np.array([1, 0]), np.array([1.0, -1.0])), Mirror(np.array([0]), np.array([-1.0]))
    np.testing.assert_array_equal(Mirror.joined([stay, swap])(np.array([1.0, 2.0, 3.0])), [-1.0, 3.0, -2.0])
