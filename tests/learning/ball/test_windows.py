"""Windows of cycles, moments that go on as if nothing had been, and what is seen of candidates."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdribble.learning.ball.newton import NewtonConfig, with_beyond
from warpdribble.learning.ball.windows import LONGEST, Moment, actions_of, attempt, holding, windows_of
from warpdribble.learning.graph import STEPS, ControlGraph
from warpdribble.learning.starts import Starts
from warpdribble.learning.tasks.arms import Arms
from warpdribble.sims.model import pose
from warpdribble.sims.worlds import BAD_CONTACT, FALL, NONFINITE


def cycle(count, checkpoints, after=None):
    """A graph of nothing but fragments."""
    rows = np.arange(count)
    after = (rows + 1) % count if after is None else after
    none = np.zeros((count, 1))
    return ControlGraph(
        np.zeros((count * STEPS, 1)),
        *(none for _ in range(4)),
        np.stack([rows, after], axis=1),
        0.01,
        checkpoints=np.array(checkpoints, int),
    )


def test_one_checkpoint_makes_one_window():
    (window,) = windows_of(cycle(6, [2 * STEPS + 3]))
    np.testing.assert_array_equal(window, [3, 4, 5, 0, 1, 2])


def test_two_checkpoints_make_two_windows():
    first, second = windows_of(cycle(6, [1 * STEPS, 4 * STEPS + 4]))
    np.testing.assert_array_equal(first, [2, 3, 4])
    np.testing.assert_array_equal(second, [5, 0, 1])


def test_checkpoints_of_one_fragment_end_one_window():
    assert len(windows_of(cycle(6, [10, 12]))) == 1


@pytest.mark.parametrize(
    ("graph", "said"),
    [
        (cycle(6, []), "no checkpoint"),
        (cycle(4, [3], after=[1, 2, 3, 2]), "no cycle"),
        (cycle(4, [3, 17], after=[1, 0, 3, 2]), "no cycle"),
    ],
)
def test_what_is_no_cycle_is_refused(graph, said):
    with pytest.raises(ValueError, match=said):
        windows_of(graph)


def test_candidates_say_what_is_free():
    free = np.array([[True, False, True], [False, True, False]])
    action = actions_of(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), free)
    np.testing.assert_array_equal(action[:, 0], [[1, 0, 2], [0, 3, 0]])
    np.testing.assert_array_equal(action[:, 1], [[4, 0, 5], [0, 6, 0]])


@pytest.fixture(scope="module")
def task(full, dribbled, legs):
    return Arms(full, dribbled, 8, legs, closely=True)


def begun(task, k):
    """All worlds where the reference begins fragment k."""
    graph, worlds = task.graph, task.worlds
    starts = (np.array([k]), graph.start_q[k : k + 1], graph.start_qd[k : k + 1])
    task.reset(Starts(*(np.repeat(part, worlds, axis=0) for part in starts)))
    return Moment.of(task, k)


def test_a_moment_goes_on_to_the_bit(task):
    """Also in the midst of contacts, and read back from a file's arrays."""
    k, random = np.arange(8, 13), np.random.default_rng(0)
    action = 0.05 * random.standard_normal((5, 8, 20))
    whole = attempt(task, begun(task, 8), k, action, 2)
    for world in (0, 5):
        moment = Moment.from_arrays(whole.moment(world, 2, 10).arrays)
        rest = attempt(task, moment, k[2:], action[2:], 3)
        for name in ("joint_q", "joint_qd", "felt", "fingers", "trouble", "height", "missed", "failed"):
            np.testing.assert_array_equal(
                getattr(rest, name)[:, world], getattr(whole, name)[2:, world], err_msg=name
            )


def test_trouble_height_and_room_are_those_of_single_steps(task, full):
    k = np.arange(8, 12)
    random = np.random.default_rng(1)
    action = 0.2 * random.standard_normal((4, 8, 20))
    tried = attempt(task, begun(task, 8), k, action, 4)
    begun(task, 8)
    arms = [full.body(f"{side}_lower_arm") for side in "lr"]
    ends = [next(s for s in full.shapes if s.name == f"{side}_lower_arm_b") for side in "lr"]
    room = np.full((4, 8, 2), np.inf)
    trouble, height = np.full((4, 8), -1), np.zeros((4, 8))
    ball = full.q_slice(full.roles.one("ball_joint")).start
    (checkpoint,) = task.graph.checkpoints
    for i in range(4):
        for step in range(STEPS):
            task.advance(np.full(8, k[i]), action[i], step, 1)
            body_q = pose.forward(full, task.sim.joint_q)
            for side, (body, end) in enumerate(zip(arms, ends)):
                tip = np.array(end.pos) * (1.0 + end.size[1] / np.linalg.norm(end.pos))
                at = body_q[:, body, :3] + Rotation.from_quat(body_q[:, body, 3:]).apply(tip)
                off = np.linalg.norm(at - task.sim.joint_q[:, ball : ball + 3], axis=1)
                room[i, :, side] = np.minimum(room[i, :, side], off - full.ball_radius - end.size[0])
            bad = task.sim.status & (BAD_CONTACT | FALL | NONFINITE) != 0
            trouble[i] = np.where(bad & (trouble[i] < 0), step, trouble[i])
            if STEPS * k[i] + step == checkpoint:
                height[i] = task.sim.joint_q[:, ball + 2]
    np.testing.assert_array_equal(tried.trouble, trouble[: len(tried.trouble)])
    np.testing.assert_allclose(tried.room, room[: len(tried.room)], atol=1e-5)
    at = checkpoint // STEPS - 8
    np.testing.assert_allclose(tried.height[at], height[at], rtol=1e-6)
    assert (trouble > 0).any() and (trouble < 0).any()


def test_an_attempt_ends_where_all_have_missed(task):
    """The ball lies far away."""
    q = task.graph.start_q[9].copy()
    ball = task.model.q_slice(task.model.roles.one("ball_joint")).start
    q[ball] += 3.0
    task.reset(Starts(np.full(8, 9), np.tile(q, (8, 1)), np.tile(task.graph.start_qd[9], (8, 1))))
    tried = attempt(task, Moment.of(task, 9), np.arange(9, 14), np.zeros((5, 8, 20)), 5)
    assert len(tried.fingers) == 2 and tried.missed[1].all() and tried.after is None
    assert len(tried.k) == 5


def test_who_looks_not_closely_sees_the_same_otherwise(task, full, dribbled, legs):
    plain = Arms(full, dribbled, 8, legs)
    action, k = np.zeros((3, 8, 20)), np.arange(9, 12)
    a, b = (attempt(one, begun(one, 9), k, action, 3) for one in (task, plain))
    np.testing.assert_array_equal(a.joint_q, b.joint_q)
    np.testing.assert_array_equal(a.fingers, b.fingers)
    assert (b.trouble == -1).all()


def clip(count, touch, marks):
    """A graph that happens once, as far as windows look at it."""
    after = np.minimum(np.arange(count) + 1, count - 1)
    held = np.zeros((count * STEPS, 2), bool)
    for first, last in touch:
        held[first:last, 1] = True
    rows = np.zeros((count, 1))
    edges, still = np.stack([np.arange(count), after], axis=1), np.zeros((count * STEPS, 1))
    marked = {"checkpoints": np.array(marks), "heights": np.ones(len(marks))}
    return ControlGraph(still, rows, rows, rows, rows, edges, 0.01, motion=still, touch=held, **marked)


def test_windows_of_a_clip_begin_with_the_first_hold_and_end_with_it():
    graph = clip(12, touch=[(12, 24), (45, 50)], marks=[20, 47])
    assert graph.ends
    assert [w.tolist() for w in windows_of(graph)] == [[3, 4], [5, 6, 7, 8, 9], [10, 11]]
    assert holding(graph, 3).tolist() == [False, True] and not holding(graph, 0).any()


def test_a_clip_that_begins_in_the_hand():
    graph = clip(6, touch=[(0, 12)], marks=[10])
    assert holding(graph, 0).tolist() == [False, True]
    assert [w.tolist() for w in windows_of(graph)] == [[0, 1, 2], [3, 4, 5]]


def test_long_windows_are_cut_while_a_hand_has_the_ball():
    graph = clip(40, touch=[(0, 200)], marks=[4])
    parts = windows_of(graph)
    assert np.concatenate(parts).tolist() == list(range(40))
    assert max(len(part) for part in parts[1:]) <= LONGEST
    free = clip(40, touch=[(0, 8)], marks=[4])
    assert [len(part) for part in windows_of(free)] == [1, 39], "nobody has it: nowhere to cut"


def test_what_comes_behind_is_found_along_in_a_clip_only():
    """Until a hand has the ball again, here after row 45, or the clip ends."""
    c, graph = NewtonConfig(beyond=4), clip(12, touch=[(12, 24), (45, 50)], marks=[20, 47])
    ways = [[k.tolist() for k in with_beyond(graph, window, c)] for window in windows_of(graph)]
    assert ways == [
        [[3, 4, 5, 6, 7, 8, 9], [3, 4]],
        [[5, 6, 7, 8, 9, 10, 11], [5, 6, 7, 8, 9]],
        [[10, 11]],
    ]
    (window,) = windows_of(cycle(6, [13]))
    (way,) = with_beyond(cycle(6, [13]), window, c)
    assert way is window
