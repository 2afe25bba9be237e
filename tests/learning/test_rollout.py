"""The closed loop, on a task that keeps a ledger and on the player: what is asked of whom and when, step by
step as fragment by fragment; and that there is no other loop."""

import ast
from pathlib import Path

import numpy as np
import pytest

from warpdribble.learning.choose import Ahead, RandomWalk
from warpdribble.learning.evaluate.trials import run_trials
from warpdribble.learning.graph import STEPS, ControlGraph, clip_graph, cyclic_graph
from warpdribble.learning.methods import STAGES
from warpdribble.learning.rollout import Rollout
from warpdribble.learning.runs.folder import Run
from warpdribble.learning.starts import Starts, Streams, reference_starts
from warpdribble.learning.tasks.disturbance import Disturbance, Disturber
from warpdribble.learning.tasks.follow import Follow, OpenLoop
from warpdribble.learning.tasks.locomotion import Locomotion
from warpdribble.sims import Model
from warpdribble.sims.authored.dribble import dribble_right
from warpdribble.sims.reference.reference import Cycle

ROOT = Path(__file__).resolve().parents[2]


def randoms(seed, count=1):
    return [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(count)]


# ------------------------------------------------------------------------------------------- the order


class Ledger:
    """A task whose worlds are a number each, to which actions are added; it notes what it is asked."""

    actions = obs = 1

    def __init__(self, worlds, count=5):
        self.worlds, self.asked = worlds, []
        k, none = np.arange(count), np.zeros((count, 1))
        edges = np.stack([k, (k + 1) % count], axis=1)
        self.graph = ControlGraph(np.zeros((count * STEPS, 1)), none, none, none, none, edges, 0.01)

    def reset(self, starts, which=None):
        self.asked.append("reset")
        if which is None:
            self.value = np.array(starts.joint_q[:, 0])
        else:
            self.value[which] = starts.joint_q[:, 0]

    def observe(self, k):
        self.asked.append("observe")
        return self.value[:, None] + 100.0 * k[:, None]

    def advance(self, k, action, first=0, count=STEPS):
        self.asked.append(("advance", first, count))
        self.value = self.value + action[:, 0] * count / STEPS

    def judge(self, k):
        self.asked.append("judge")
        failed = self.value > 900.0
        return np.where(failed, np.inf, self.value + k), failed

    def become(self, sources):
        self.value = self.value[sources]

    def calm(self):
        self.asked.append("calm")


class Adds:
    """A controller: one more in every fragment than in the one before it."""

    def act(self, obs, k):
        return (1.0 + k)[:, None]


class Blows:
    def apply(self, task):
        task.asked.append("disturb")


def starts(k, values):
    values = np.array(values, float)[:, None]
    return Starts(np.array(k), values, values)


def begun(k=(0, 3), values=(10.0, 20.0), disturber=None):
    return Rollout(Ledger(len(k)), Adds(), Ahead(), starts(k, values), disturber)


def test_who_is_asked_what_and_when():
    rollout = begun(disturber=Blows())
    assert rollout.task.asked == ["calm", "reset"]
    assert sum(1 for _ in rollout.fragments(2)) == 2
    whole = ["disturb", "observe", ("advance", 0, STEPS), "judge"]
    assert rollout.task.asked[2:] == [*whole, *whole, "calm"]
    rollout.task.asked.clear()
    assert list(rollout.steps(1)) == list(range(STEPS))
    steps = [("advance", step, 1) for step in range(STEPS)]
    assert rollout.task.asked == ["disturb", "observe", *steps, "judge", "calm"]


def test_what_a_fragment_says():
    rollout = begun()
    first, second = rollout.fragments(2)
    assert (first.row, second.row, rollout.row) == (0, 1, 2)
    np.testing.assert_array_equal([first.k, second.k], [[0, 3], [1, 4]])
    np.testing.assert_array_equal(rollout.k, [2, 0])
    np.testing.assert_array_equal(first.obs[:, 0], [10.0, 320.0])
    np.testing.assert_array_equal(second.obs[:, 0], [111.0, 424.0])
    np.testing.assert_array_equal(second.action[:, 0], [2.0, 5.0])
    np.testing.assert_array_equal(second.cost, [13.0 + 1, 29.0 + 4])
    assert not second.failed.any()


def test_it_goes_on_where_it_was():
    whole, parts = begun(), begun()
    rows = [f.obs for f in whole.fragments(7)]
    seen = [f.obs for count in (3, 0, 4) for f in parts.fragments(count)]
    np.testing.assert_array_equal(seen, rows)


def test_the_given_starts_stay_as_they_are():
    given = starts([0, 3], [10.0, 20.0])
    list(Rollout(Ledger(2), Adds(), Ahead(), given).fragments(3))
    np.testing.assert_array_equal(given.k, [0, 3])


def test_a_world_becomes_another_and_goes_its_way():
    rollout = begun((0, 3, 1), (10.0, 20.0, 30.0))
    for fragment in rollout.fragments(2):
        if fragment.row == 0:
            np.testing.assert_array_equal(fragment.k, [0, 3, 1])
            rollout.become(np.array([1, 1, 0]))
            np.testing.assert_array_equal(rollout.task.value, [24.0, 24.0, 11.0])
    np.testing.assert_array_equal(fragment.k, [4, 4, 1])  # where the others' ways lead
    np.testing.assert_array_equal(fragment.obs[:, 0], [424.0, 424.0, 111.0])


def test_some_begin_anew():
    """In the very fragments that their starts say; the others go on."""
    rollout = begun((0, 3, 1), (10.0, 20.0, 30.0))
    for fragment in rollout.fragments(3):
        if fragment.row == 0:
            rollout.restart(starts([4, 2], [500.0, 600.0]), np.array([True, False, True]))
        if fragment.row == 1:
            np.testing.assert_array_equal(fragment.k, [4, 4, 2])
            np.testing.assert_array_equal(fragment.obs[:, 0], [900.0, 424.0, 800.0])
    np.testing.assert_array_equal(fragment.k, [0, 0, 3])


def test_copies_of_those_who_began_anew_begin_with_them():
    rollout = begun((0, 3, 1), (10.0, 20.0, 30.0))
    for fragment in rollout.fragments(2):
        if fragment.row == 0:
            rollout.restart(starts([2], [500.0]), np.array([True, False, False]))
            rollout.become(np.array([0, 0, 1]))
    np.testing.assert_array_equal(fragment.k, [2, 2, 4])
    np.testing.assert_array_equal(fragment.obs[:, 0], [700.0, 700.0, 424.0])


def test_who_has_failed_is_said():
    rollout = begun((0, 0), (10.0, 899.5))
    (fragment,) = rollout.fragments(1)
    np.testing.assert_array_equal(fragment.failed, [False, True])
    assert np.isinf(fragment.cost[1])


# ------------------------------------------------------------------------------------------ the player


@pytest.fixture(scope="module")
def learned():
    return Run.load("dribble-right-authored").learned(STAGES, "locomotion")


PUSHED = Disturbance(push=200.0, push_every=0.5, arms=0.1, hands=10.0)


def walked(task, learned, disturbance=PUSHED, seed=2):
    streams = Streams(randoms(seed), task.worlds)
    begin = learned.starts.draw(streams, 0.1)
    return Rollout(task, learned.controller, RandomWalk(streams), begin, Disturber(disturbance, streams))


def test_steps_add_up_to_fragments(learned):
    """To the bit, disturbed, and whichever of the two comes first."""
    task, seen = learned.task(5), []
    for order in (("fragments", "fragments"), ("steps", "steps"), ("steps", "fragments")):
        rollout = walked(task, learned)
        for name in order:
            for _ in getattr(rollout, name)(6):
                pass
        seen.append((task.sim.joint_q, task.sim.joint_qd, rollout.k, np.array(rollout.row), task.felt))
    for other in seen[1:]:
        for one, two in zip(seen[0], other):
            np.testing.assert_array_equal(one, two)
    assert seen[0][3] == 12


def test_it_is_the_loop_written_out(learned):
    """Disturb, act, advance, follow, by hand."""
    task, other = learned.task(5), learned.task(5)
    rollout, streams = walked(task, learned), Streams(randoms(2), 5)
    begin = learned.starts.draw(streams, 0.1)
    k, disturber = begin.k, Disturber(PUSHED, streams)
    other.reset(begin)
    for fragment in rollout.fragments(8):
        disturber.apply(other)
        obs = other.observe(k)
        action = learned.controller.act(obs, k)
        other.advance(k, action)
        cost, _ = other.judge(k)
        for one, two in zip(
            (fragment.k, fragment.obs, fragment.action, fragment.cost), (k, obs, action, cost)
        ):
            np.testing.assert_array_equal(one, two)
        np.testing.assert_array_equal(task.sim.joint_q, other.sim.joint_q)
        k = task.graph.follow(k)


def test_disturbances_end_with_the_last_fragment(learned):
    task = learned.task(4)
    disturbed = Disturbance(push=300.0, push_every=0.05, arms=0.3, hands=20.0)
    for go in ("fragments", "steps"):
        rollout = walked(task, learned, disturbed)
        for _ in getattr(rollout, go)(3):
            assert task.course.push.any() and task.course.offset[:, task.actions :].any()
        assert not task.course.push.any() and not task.course.offset[:, task.actions :].any()


def test_a_new_rollout_begins_calm(learned):
    """Also after one that was left in the middle; what it does is what it does in new worlds."""
    task, fresh = learned.task(4), learned.task(4)
    loud = Disturbance(push=300.0, push_every=0.05, arms=0.3, hands=20.0)
    left = walked(task, learned, loud).fragments(9)
    next(left)
    calm = Rollout(task, learned.controller, Ahead(), learned.starts.draw(Streams(randoms(1), 4)))
    assert not task.course.push.any()
    expected = Rollout(fresh, learned.controller, Ahead(), learned.starts.draw(Streams(randoms(1), 4)))
    for one, two in zip(calm.fragments(5), expected.fragments(5)):
        np.testing.assert_array_equal(one.cost, two.cost)
    np.testing.assert_array_equal(task.sim.joint_q, fresh.sim.joint_q)


def test_copies_go_on_as_their_originals(learned):
    """Without disturbances worlds that became one do the same ever after, contacts included."""
    rollout = walked(learned.task(4), learned, Disturbance())
    for fragment in rollout.fragments(12):
        if fragment.row == 4:
            rollout.become(np.array([2, 1, 2, 2]))
    joint_q = rollout.task.sim.joint_q
    np.testing.assert_array_equal(joint_q[[0, 3]], joint_q[[2, 2]])
    assert not np.array_equal(joint_q[1], joint_q[2])
    np.testing.assert_array_equal(fragment.obs[0], fragment.obs[2])


def test_who_begins_anew_does_so_as_in_new_worlds(learned):
    """And leaves the others as they are, to the bit."""
    task, states = learned.task(4), learned.starts
    some, which = states[[5, 9]], np.array([0, 1, 0, 1], bool)
    alone = Rollout(learned.task(2), learned.controller, Ahead(), some)
    begin = states[:4]
    undisturbed = Rollout(learned.task(4), learned.controller, Ahead(), begin)
    rollout = Rollout(task, learned.controller, Ahead(), begin)
    for fragment in rollout.fragments(8):
        if fragment.row == 2:
            rollout.restart(some, which)
    whole, fresh = list(undisturbed.fragments(8))[-1], list(alone.fragments(5))[-1]
    np.testing.assert_array_equal(fragment.k[~which], whole.k[~which])
    np.testing.assert_array_equal(fragment.cost[~which], whole.cost[~which])
    np.testing.assert_array_equal(fragment.k[which], fresh.k)
    np.testing.assert_array_equal(fragment.cost[which], fresh.cost)
    np.testing.assert_array_equal(task.sim.joint_q[which], alone.task.sim.joint_q)


def test_learned_on_stiff_hands_it_carries_the_full_player_and_a_ball(learned):
    """101 degrees of freedom, a ball in play, pushes of up to 200 N: all stand; the open loop falls."""
    model = Model.load("player")
    graph = cyclic_graph(model, Cycle(dribble_right(model).reference), model.roles.both("feet"))
    task, pushed = Locomotion(model, graph, 32), Disturbance(push=200.0, push_every=2.0)
    lasted = [
        run_trials(task, policy, reference_starts(graph), 20, 1, 0.15, pushed).survived.mean()
        for policy in (learned.controller, OpenLoop(task.actions))
    ]
    assert lasted[0] == 1.0 and lasted[1] < 0.2


def test_the_open_loop_is_stepping_along_the_targets(player, dribble):
    """`set_targets` and `step`, row by row, but for rounding of two compiled forms; the last fragment is
    held."""
    graph = clip_graph(player, dribble.reference, player.roles.both("feet"))
    task = Follow(player, graph, 3)
    begin = Starts(np.zeros(3, int), *(np.tile(x[0], (3, 1)) for x in (graph.start_q, graph.start_qd)))
    rollout = Rollout(task, OpenLoop(), Ahead(), begin)
    by_hand = Follow(player, graph, 3).sim
    by_hand.reset(joint_q=begin.joint_q, joint_qd=begin.joint_qd)
    for fragment in rollout.fragments(graph.count):
        for row in range(STEPS):
            by_hand.set_targets(graph.targets[fragment.k * STEPS + row])
            by_hand.step()
        np.testing.assert_allclose(task.sim.joint_q, by_hand.joint_q, atol=3e-4)
    assert (fragment.k == graph.count - 1).all() and (rollout.k == graph.count - 1).all()


# --------------------------------------------------------------------------------------- no other loop


def loops(path):
    """(line, call) of all calls of `act` and `advance` in a file, but for those in methods of that name,
    which pass on."""
    stack = [(ast.parse(path.read_text(encoding="utf-8")), ())]
    while stack:
        node, inside = stack.pop()
        if isinstance(node, ast.FunctionDef):
            inside = (*inside, node.name)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            name = node.func.attr
            if name in ("act", "advance") and name not in inside:
                yield node.lineno, ast.unparse(node.func)
        stack += [(child, inside) for child in ast.iter_child_nodes(node)]


def test_nothing_else_acts_and_advances():
    """Whoever wants a closed loop folds over a `Rollout`; legs that go along act within a fragment, and a
    policy with exploration does what another does and something beside it."""
    loop = ROOT / "learning" / "rollout.py"
    assert {call for _, call in loops(loop)} == {"self.controller.act", "self.task.advance"}
    for folder in ("learning", "warpdribble"):
        for path in (ROOT / folder).rglob("*.py"):
            found = {call for _, call in loops(path)} - {"self.legs.act", "self.policy.act"}
            assert path == loop or not found, path.relative_to(ROOT)
