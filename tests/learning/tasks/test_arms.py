"""The ball as a control problem: what is steered, felt and judged, against NumPy on the bodies' poses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.learning import Ahead, OpenLoop, Rollout, Starts
from warpdribble.learning.graph import STEPS
from warpdribble.learning.tasks.arms import ARM, HELD, STATES, WRIST, Arms, BallWeights, active_hands
from warpdribble.learning.tasks.fingers import FINGERS, READY
from warpdribble.skills import read_skill, skill_graph

TIPS = [f"{side}_{finger}_tip" for side in "lr" for finger in FINGERS]


@pytest.fixture(scope="module")
def made(full):
    """A function that makes worlds of the authored dribble, legs left alone."""
    graph, _ = skill_graph(read_skill("dribble-right-authored"))
    return lambda worlds=2, graph=graph, **how: Arms(full, graph, worlds, OpenLoop(17), **how)


@pytest.fixture(scope="module")
def dribble(made):
    return made()


def begun(task, k, ball=None, velocity=None):
    """All worlds at the reference's fragment k, the ball elsewhere [m, m/s]."""
    k = np.full(task.worlds, k)
    q, qd = task.graph.start_q[k].copy(), task.graph.start_qd[k].copy()
    joint = task.model.roles.one("ball_joint")
    if ball is not None:
        q[:, task.model.q_slice(joint).start :][:, :3] = ball
    if velocity is not None:
        qd[:, task.model.dof_slice(joint).start :][:, :3] = velocity
    return Starts(k, q, qd)


def gaps(task):
    """(10,) [m] of the tips from the ball's surface in the first world, from the bodies' poses."""
    body_q = task.sim.body_q[0]
    ball = body_q[task.model.body(task.model.roles.one("ball")), :3]
    out = []
    for tip in TIPS:
        body, at, _ = task.model.sites[tip]
        place = body_q[body, :3] + Rotation.from_quat(body_q[body, 3:]).apply(at)
        out.append(np.linalg.norm(place - ball) - task.model.ball_radius)
    return np.array(out)


def test_the_state_of_the_paper_has_165_numbers(made):
    assert {state: made(state=state).obs for state in STATES}["paper"] == 165
    assert made(state="tips").obs == 18
    with pytest.raises(ValueError, match="no state 'all'"):
        made(state="all")


def test_on_the_reference_nothing_is_felt(made):
    for state in STATES:
        task = made(state=state)
        k = np.array([3, 9])
        task.reset(Starts(k, task.graph.start_q[k], task.graph.start_qd[k]))
        np.testing.assert_allclose(task.observe(k), 0.0, atol=2e-3, err_msg=state)


def test_a_full_state_feels_how_fast_the_arms_turn_and_what_was_done_last(made):
    """What the state `ballistic` feels, then joint speeds off the reference's by joint, then offsets of the
    arm that acts."""
    task, other = made(state="full"), made(state="ballistic")
    model, k = task.model, np.array([3, 9])
    q, qd = task.graph.start_q[k].copy(), task.graph.start_qd[k].copy()
    arms = [f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist") for side in "lr"]
    dofs = np.concatenate([np.arange(model.nv)[model.dof_slice(joint)] for joint in arms])
    speed = np.random.default_rng(0).normal(size=(2, len(dofs)))
    qd[:, dofs] += speed
    for one in (task, other):
        one.reset(Starts(k, q, qd))
    felt, less = task.observe(k), other.observe(k)
    assert task.obs == felt.shape[1] == other.obs + 14 + 2 * ARM
    np.testing.assert_allclose(felt[:, : other.obs], less, atol=1e-6)
    np.testing.assert_allclose(felt[:, other.obs : other.obs + 14], speed / 3.0, atol=1e-5)
    np.testing.assert_array_equal(felt[:, -2 * ARM :], 0.0)
    action = np.full((2, 2 * ARM), 0.02)
    task.advance(k, action)
    task.judge(k)
    felt = task.observe(task.graph.follow(k))
    np.testing.assert_allclose(felt[:, -2 * ARM :], np.where(task.active[k], 0.2, 0.0), atol=1e-12)


def test_who_loses_the_ball_has_not_fallen(dribble):
    free = np.full(2, int(np.flatnonzero(dribble.held == 0)[0]))
    starts = begun(dribble, free[0], ball=[3.0, 0.0, 1.0])
    starts.joint_q[1, 2] -= 0.5
    dribble.reset(starts)
    dribble.advance(free, np.zeros((2, 2 * ARM)))
    _, failed = dribble.judge(free)
    assert failed.tolist() == [True, True] and dribble.fallen.tolist() == [False, True]


def test_fingers_are_measured_over_the_steps_of_H(dribble):
    """Eq. 7 over the frames of a fragment, and at its checkpoint, from poses after every step."""
    graph, k = dribble.graph, int(dribble.graph.checkpoints[0]) // STEPS
    rollout = Rollout(dribble, OpenLoop(2 * ARM), Ahead(), begun(dribble, k))
    seen = []
    obs = dribble.observe(rollout.k)
    for step in range(STEPS):
        dribble.advance(rollout.k, np.zeros((2, 2 * ARM)), step, 1)
        seen.append(gaps(dribble)[len(FINGERS) :])
    # in one go, as watches begin anew with every call
    dribble.reset(begun(dribble, k))
    dribble.advance(rollout.k, np.zeros((2, 2 * ARM)))
    dribble.judge(rollout.k)
    rows = np.flatnonzero(graph.touch[k * STEPS : (k + 1) * STEPS, 1])
    assert len(rows) == STEPS and len(obs) == 2
    assert dribble.fingers[0] == pytest.approx(np.mean([seen[row] for row in rows]), abs=2e-5)


def test_where_nobody_should_have_the_ball_nothing_is_measured(dribble):
    free = int(np.flatnonzero(dribble.held == 0)[0])
    dribble.reset(begun(dribble, free))
    dribble.advance(np.full(2, free), np.zeros((2, 2 * ARM)))
    cost, failed = dribble.judge(np.full(2, free))
    assert np.isnan(dribble.fingers).all() and np.isfinite(cost).all() and not failed.any()


@pytest.mark.parametrize(
    "off, why", [((0.0, 0.0, -0.25), "out of reach at the checkpoint"), ((3.0, 0.0, 0.0), "lost")]
)
def test_a_ball_out_of_reach_fails(dribble, off, why):
    model, k = dribble.model, int(dribble.graph.checkpoints[0]) // STEPS
    q = dribble.graph.start_q[k, model.q_slice(model.roles.one("ball_joint"))][:3]
    q = q - [0.0, 0.0, 0.02]  # or the wrist touches it
    starts = begun(dribble, k, ball=np.stack([q, q + off]))
    dribble.reset(starts)
    dribble.advance(starts.k, np.zeros((2, 2 * ARM)))
    cost, failed = dribble.judge(starts.k)
    assert failed.tolist() == [False, True], why
    assert np.isinf(cost[1]) and np.isfinite(cost[0])
    assert gaps(dribble)[len(FINGERS) :].mean() < HELD


def test_a_ball_on_the_body_fails(dribble):
    """It touches the shin, where it is still near its reference."""
    task, k = dribble, int(np.flatnonzero(dribble.held == 0)[0])
    shin = task.model.body("r_lower_leg")
    task.reset(begun(task, k))
    at = task.sim.body_q[0, shin, :3] + [0.16, -0.1, -0.15]
    task.reset(begun(task, k, ball=at, velocity=[-4.0, 2.0, 0.0]))
    task.advance(np.full(2, k), np.zeros((2, 2 * ARM)))
    _, failed = task.judge(np.full(2, k))
    assert failed.all()


def test_offsets_reach_their_joints(made):
    """A number of an action turns its joint by as much, a wrist by twice as much; fingers stay between flat
    and fist; the arm that does not act stays."""
    task = made(1)
    k = np.array([int(np.flatnonzero(task.active[:, ARM])[0])])
    assert not task.active[:, :ARM].any() and task.active[:, ARM:].all()
    model, row = task.model, int(k[0]) * STEPS
    action = np.zeros((1, 2 * ARM))
    action[0, :ARM] = 0.5  # the idle arm's
    action[0, ARM : ARM + 4], action[0, ARM + 4 : ARM + 7] = [0.1, 0.0, 0.0, 0.3], [0.0, 0.2, 0.0]
    action[0, ARM + 7 :] = 9.0
    task.reset(begun(task, int(k[0])))
    task.advance(k, action, 0, 1)
    target, table = task.sim.port("joint_target_q").numpy()[0], task.graph.targets[row]

    def turned(joint):
        part = model.q_slice(joint)
        return (Rotation.from_quat(table[part]).inv() * Rotation.from_quat(target[part])).as_rotvec()

    np.testing.assert_allclose(turned("r_shoulder"), [0.1, 0.0, 0.0], atol=1e-5)
    np.testing.assert_allclose(turned("r_wrist"), [0.0, WRIST * 0.2, 0.0], atol=1e-5)
    elbow = model.q_slice("r_elbow")
    assert (target - table)[elbow] == pytest.approx(0.3, abs=1e-5)
    for joint in ("l_shoulder", "l_wrist"):
        np.testing.assert_allclose(turned(joint), 0.0, atol=1e-5)
    pip = model.q_slice("r_index_pip")
    closed = (1.0 - READY) * float(model.keyframes["fist"][pip][0])
    assert (target - table)[pip] == pytest.approx(closed, abs=1e-5)


def test_active_hands_change_at_the_bounce(full):
    """X of P1 5.1, for hands in turn: the first arm until the ball is lowest, the other from there on."""
    graph, _ = skill_graph(read_skill("switch-hands"))
    active = active_hands(full, graph)[:, ::ARM]
    z = graph.motion[:, full.q_slice(full.roles.one("ball_joint")).start + 2].reshape(-1, STEPS)
    for k in range(graph.count):
        touch = graph.touch[k * STEPS : (k + 1) * STEPS].any(axis=0)
        assert (active[k] | ~touch).all()
    both = np.flatnonzero(active.all(axis=1))
    assert len(both) <= 2 and (z[both].min(axis=1) < 0.3).all()
    assert active.any(axis=1).all()


def test_a_snapshot_brings_everything_back(made):
    task = made(3)
    rng = np.random.default_rng(0)
    rollout = Rollout(task, Random(rng), Ahead(), begun(task, 2))
    for _ in rollout.fragments(4):
        pass
    kept, k = task.snapshot(), rollout.k
    one = [task.judge(i)[0] for i in walk(task, k, 5, np.random.default_rng(1))]
    task.recall(kept)
    two = [task.judge(i)[0] for i in walk(task, k, 5, np.random.default_rng(1))]
    np.testing.assert_array_equal(one, two)


def test_weights_reach_the_cost(made, full):
    """The cost is linear in its weights; without any it is nothing."""
    nothing = dict.fromkeys(("fingers", "ball", "speed", "hands", "action", "change"), 0.0)
    k = np.array([3, 5])
    costs = []
    for weights in ({}, {"ball": 2.0}, {"ball": 4.0}, {"action": 3.0}):
        task = made(weights=replace(BallWeights(**nothing), **weights))
        task.reset(Starts(k, task.graph.start_q[k], task.graph.start_qd[k]))
        task.advance(k, np.full((2, 2 * ARM), 0.1))
        costs.append(task.judge(k)[0])
    np.testing.assert_allclose(costs[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(costs[2], 2.0 * costs[1], rtol=1e-6)
    np.testing.assert_allclose(costs[3], 3.0 * np.sqrt(ARM * 0.01), rtol=1e-6)


def test_a_graph_without_a_ball_is_refused(full, made):
    graph = replace(made().graph, touch=None)
    with pytest.raises(ValueError, match="no ball"):
        Arms(full, graph, 1, OpenLoop(17))


class Random:
    """Small random actions."""

    def __init__(self, rng):
        self.rng = rng

    def act(self, obs, k):
        return 0.05 * self.rng.standard_normal((len(k), 2 * ARM))


def walk(task, k, count, rng):
    k = k.copy()
    for _ in range(count):
        task.advance(k, 0.05 * rng.standard_normal((task.worlds, 2 * ARM)))
        yield k
        k = task.graph.follow(k)
