"""Control graphs: fragments that tile a cycle, the table of targets, random walks along edges."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chisquare

from warpdribble.learning.graph import SHORTEST, STEPS, ControlGraph, Span, clip_graph, cyclic_graph, joined
from warpdribble.learning.starts import Starts
from warpdribble.sims import Model
from warpdribble.sims.reference.feedforward import SHARE, leading_targets
from warpdribble.sims.reference.reference import Cycle, Reference, resample_q

EXACT = 1e-9  # float64 through a few rotations, [m], [rad]; velocities divide by steps of 0.01 s


def tiled(player, cycle, name=""):
    """Its graph, carried by the feet."""
    return cyclic_graph(player, cycle, player.roles.both("feet"), name)


def heading(root):
    forward = Rotation.from_quat(root[3:7]).apply([1, 0, 0])
    return np.arctan2(forward[1], forward[0])


def of(edges, count=None, step=0.01, **rest):
    """A graph with edges and nothing else that counts."""
    count = int(np.max(edges)) + 1 if count is None else count
    rows = np.arange(count)[:, None]
    return ControlGraph(
        np.zeros((count * STEPS, 1)), rows, rows + 0.5, rows + 1, rows + 1.5, edges, step, **rest
    )


def check_tiles(player, graph, cycle):
    """Goals are the starts of what follows; over the seam, further along the ground."""
    count = graph.count
    assert graph.targets.shape == (count * STEPS, player.nq)
    for name, width in (
        ("start_q", player.nq),
        ("goal_q", player.nq),
        ("start_qd", player.nv),
        ("goal_qd", player.nv),
    ):
        assert getattr(graph, name).shape == (count, width)
    np.testing.assert_array_equal(graph.goal_q[:-1], graph.start_q[1:])
    np.testing.assert_array_equal(graph.goal_qd[:-1], graph.start_qd[1:])
    np.testing.assert_array_equal(graph.edges, [[k, (k + 1) % count] for k in range(count)])
    first, last = graph.start_q[0], graph.goal_q[-1]
    turned = Rotation.from_euler("z", cycle.turn)
    travel = Rotation.from_euler("z", cycle.turn).apply(
        [*cycle.travel, 0.0]
    )  # graphs are of the second cycle
    np.testing.assert_allclose(last[:3] - first[:3], travel, atol=EXACT)
    over = Rotation.from_quat(last[3:7]) * Rotation.from_quat(first[3:7]).inv()
    np.testing.assert_allclose((over * turned.inv()).magnitude(), 0.0, atol=1e-7)  # of an arc cosine about 0
    for name in player.joint_names[1:]:
        place = player.q_slice(name)
        sign = np.sign(last[place] @ first[place]) if player.joint_type(name) == "ball" else 1.0
        np.testing.assert_allclose(sign * last[place], first[place], atol=1e-7, err_msg=name)
    np.testing.assert_allclose(graph.goal_qd[-1, 3:], graph.start_qd[0, 3:], atol=1e-5)
    np.testing.assert_allclose(graph.goal_qd[-1, :3], turned.apply(graph.start_qd[0, :3]), atol=1e-5)


def test_a_cycle_in_place_is_tiled(player, dribble, graph):
    assert graph.count == 14 and graph.stretch == 1.0 and graph.period == pytest.approx(0.05)
    check_tiles(player, graph, dribble)
    np.testing.assert_allclose(graph.goal_q[-1], graph.start_q[0], atol=1e-7)


def test_a_cycle_along_a_curve_is_tiled(player, curve):
    graph = tiled(player, curve)
    check_tiles(player, graph, curve)
    assert heading(graph.goal_q[-1]) - heading(graph.start_q[0]) == pytest.approx(0.6, abs=1e-6)
    first = graph.start_q[0, :2] - curve.reference.joint_q[0, :2]
    np.testing.assert_allclose(first, curve.travel, atol=EXACT)


def test_recorded_walking_is_tiled(player, mocap):
    from warpdribble.skills.skill import read_skill
    from warpdribble.skills.staged import stage_skill

    full = Model.load("player")
    cycle = stage_skill(full, read_skill("walk"), mocap).cycle
    joint_q = player.convert_q(full, cycle.reference.joint_q)
    cycle = replace(cycle, reference=replace(cycle.reference, joint_q=joint_q))
    graph = tiled(player, cycle)
    assert np.linalg.norm(cycle.travel) > 0.5
    assert graph.count == round((cycle.reference.frame_count - 1) / STEPS)
    check_tiles(player, graph, cycle)


def with_rows(player, cycle, rows):
    """The cycle in another number of time steps."""
    at = np.linspace(0.0, cycle.reference.frame_count - 1, rows + 1)
    joint_q = resample_q(player, cycle.reference.joint_q, at)
    return replace(cycle, reference=replace(cycle.reference, joint_q=joint_q))


@pytest.mark.parametrize(("rows", "count"), [(65, 13), (68, 14), (71, 14), (72, 14), (74, 15)])
def test_time_is_stretched_to_whole_fragments(player, curve, rows, count):
    """Fragment k begins at the share k / count of the cycle; joint angles are on straight lines between
    rows."""
    cycle = with_rows(player, curve, rows)
    graph = tiled(player, cycle)
    assert graph.count == count and graph.stretch == pytest.approx(count * STEPS / rows, rel=1e-12)
    check_tiles(player, graph, cycle)
    knee = player.q_slice("l_knee").start
    expected = np.interp(
        np.arange(count) * rows / count, np.arange(rows + 1), cycle.reference.joint_q[:, knee]
    )
    np.testing.assert_allclose(graph.start_q[:, knee], expected, atol=EXACT)


def test_states_move_as_the_reference_does(player, dribble, graph):
    """Velocities against differences over two steps, the seam included; for joints with one axis, and the
    root's place."""
    q = np.array(dribble.reference.joint_q[:-1])
    speed = (np.roll(q, -1, axis=0) - np.roll(q, 1, axis=0)) / (2 * player.timestep)
    for name in ("l_knee", "r_elbow", "root"):
        width = 3 if name == "root" else 1
        place, dof = player.q_slice(name).start, player.dof_slice(name).start
        expected = speed[::STEPS, place : place + width]
        assert np.abs(expected).max() > 0.01
        np.testing.assert_allclose(graph.start_qd[:, dof : dof + width], expected, atol=1e-7)


def test_targets_lead_where_the_step_leads(player, dribble):
    """Row j of a fragment is given over the step to the reference's row j + 1: there, ahead by damping over
    stiffness times the rate, as far as the effort limit lets it. Without feet no torque is added."""
    graph = cyclic_graph(player, dribble, ())
    q = dribble.reference.joint_q[:-1]
    for name in ("l_elbow", "r_elbow", "l_knee"):
        place, dof = player.q_slice(name).start, player.dof_slice(name).start
        kp, kd = (player.tables[table][dof] for table in ("dof_kp", "dof_kd"))
        now, later = np.roll(q[:, place], -1), np.roll(q[:, place], -2)
        limit = SHARE * player.tables["link_effort"][player.joint_link[player.joint(name)]] / kp
        ahead = np.clip(kd / kp * (later - now) / player.timestep, -limit, limit)
        assert np.abs(ahead).max() > 1e-3
        np.testing.assert_allclose(graph.targets[:, place], now + ahead, atol=1e-7)


def test_feet_carry_the_weight(player, dribble, graph):
    """With feet, targets ask for torques at the legs on top of that, and none at the root's dofs."""
    light = cyclic_graph(player, dribble, ())
    ankle, root = player.q_slice("l_ankle"), player.q_slice("root")
    assert np.abs(graph.targets[:, ankle] - light.targets[:, ankle]).max() > 1e-3
    np.testing.assert_array_equal(graph.targets[:, root], light.targets[:, root])
    np.testing.assert_array_equal(graph.start_q, light.start_q)


@pytest.mark.parametrize("rows", [2, (SHORTEST - 1) * STEPS + 1])
def test_a_cycle_too_short_is_refused(player, dribble, rows):
    with pytest.raises(ValueError, match="too short"):
        tiled(player, with_rows(player, dribble, rows))


def test_the_shortest_cycle(player, dribble):
    assert tiled(player, with_rows(player, dribble, SHORTEST * STEPS)).count == SHORTEST


def test_saved_and_read(player, curve, tmp_path):
    graph = tiled(player, curve, "a curve, über")
    graph.save(tmp_path / "graph.npz")
    read = ControlGraph.load(tmp_path / "graph.npz")
    for field in fields(ControlGraph):
        one, two = getattr(graph, field.name), getattr(read, field.name)
        assert type(one) is type(two)
        np.testing.assert_array_equal(one, two)
    k = np.arange(graph.count)
    np.testing.assert_array_equal(read.follow(k), (k + 1) % graph.count)


def test_older_files_lack_spans_and_the_motion_inside_fragments(player, graph, tmp_path):
    """One span of all; fragments run straight from their start to their goal."""
    graph.save(tmp_path / "graph.npz")
    with np.load(tmp_path / "graph.npz") as file:
        np.savez(tmp_path / "old.npz", **{n: file[n] for n in file.files if n not in ("spans", "motion")})
    old = ControlGraph.load(tmp_path / "old.npz")
    assert old.motion is None and old.spans == (Span("", 0, graph.count),) and old.cycle == graph.cycle
    np.testing.assert_array_equal(old.targets, graph.targets)
    rows, knee = old.rows(player, 3), player.q_slice("l_knee").start
    np.testing.assert_allclose(rows[[0, -1]], [graph.start_q[3], graph.goal_q[3]], atol=EXACT)
    np.testing.assert_allclose(rows[:, knee], np.linspace(*rows[[0, -1], knee], STEPS + 1), atol=EXACT)


# ------------------------------------------------------------------------------------------ rows, spans


def test_the_rows_of_fragments_are_the_reference(player, dribble, graph):
    for k in range(graph.count):
        expected = dribble.reference.joint_q[k * STEPS : (k + 1) * STEPS + 1]
        np.testing.assert_allclose(np.abs(graph.rows(player, k)), np.abs(expected), atol=1e-7)
    np.testing.assert_array_equal(graph.rows(player, 4)[0], graph.start_q[4])
    np.testing.assert_array_equal(graph.rows(player, 4)[-1], graph.goal_q[4])


@pytest.mark.parametrize(("rows", "count"), [(1, 1), (5, 1), (6, 2), (70, 14), (68, 14), (66, 14)])
def test_a_clip_from_its_first_row_to_its_last(player, dribble, rows, count):
    """What is missing to a whole fragment is held still; the last fragment follows itself."""
    reference = replace(dribble.reference, joint_q=dribble.reference.joint_q[: rows + 1])
    feet = player.roles.both("feet")
    graph = clip_graph(player, reference, feet, 0.1)
    assert graph.count == count and graph.spans == (Span("", 0, count),) and graph.stretch == 1.0
    through = np.concatenate([graph.rows(player, 0)[:1], *(graph.rows(player, k)[1:] for k in range(count))])
    np.testing.assert_array_equal(through[: rows + 1], reference.joint_q)
    np.testing.assert_array_equal(through[rows:], np.tile(reference.joint_q[-1], (len(through) - rows, 1)))
    targets = leading_targets(player, reference, feet, 0.1)
    np.testing.assert_array_equal(graph.targets[:rows], targets[1:])
    assert (graph.targets[rows:] == targets[-1]).all()
    k, walk = np.array([0]), []
    for _ in range(count + 2):
        walk.append(int(k[0]))
        k = graph.follow(k)
    assert walk == [*range(count), count - 1, count - 1] and not graph.branches


def test_spans_say_what_a_graph_is_made_of(player, dribble, graph):
    assert graph.spans == (Span("dribble", 0, 14),) and graph.cycle == 14
    other = of([[0, 1], [1, 0]], spans=[Span("short", 0, 2)])
    plain = of([[0, 1], [1, 2], [2, 0]])
    assert plain.spans == (Span("", 0, 3),)
    both = joined([other, plain, other], [])
    assert both.spans == (Span("short", 0, 2), Span("", 2, 3), Span("short", 5, 2)) and both.cycle == 3
    again = joined([both, other], [])
    assert again.spans == (*both.spans, Span("short", 7, 2))


def test_joined_graphs_are_saved_with_their_spans(player, graph, curve, tmp_path):
    both = joined([graph, tiled(player, curve, "curve")], [((0, 3), (1, 4))])
    both.save(tmp_path / "both.npz")
    read = ControlGraph.load(tmp_path / "both.npz")
    assert read.spans == both.spans == (Span("dribble", 0, 14), Span("curve", 14, 14))
    for k in (0, 13, 14, 20):
        np.testing.assert_array_equal(read.rows(player, k), both.rows(player, k))
    np.testing.assert_array_equal(both.rows(player, 18)[0], both.start_q[18])


def test_joined_with_an_older_graph_nothing_is_known_inside_fragments(player, graph):
    both = joined([graph, replace(graph, motion=None)], [])
    assert both.motion is None and both.rows(player, 20).shape == (STEPS + 1, player.nq)


def test_branches(graph):
    assert not graph.branches
    assert joined([graph, graph], [((0, 0), (1, 0))]).branches
    assert not joined([graph, graph], []).branches


# --------------------------------------------------------------------------------------- random walks


@st.composite
def edge_lists(draw):
    """Every fragment has a few that follow it; no edge twice."""
    count = draw(st.integers(1, 8))
    after = [draw(st.sets(st.integers(0, count - 1), min_size=1, max_size=count)) for _ in range(count)]
    edges = [[k, j] for k, js in enumerate(after) for j in js]
    return count, draw(st.permutations(edges))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(edge_lists())
def test_walks_take_every_edge_equally_often(case):
    """By chi-square; one in a million graphs would fail by chance, and 40 fixed ones are tried."""
    count, edges = case
    graph = of(edges, count)
    draws, random = 400, np.random.default_rng(1)
    for k in range(count):
        after = graph.follow(np.full(draws, k), random.random(draws))
        assert set(graph.after(k)) == {j for i, j in edges if i == k}
        allowed = sorted(j for i, j in edges if i == k)
        found, often = np.unique(after, return_counts=True)
        assert set(found) <= set(allowed)
        expected = draws / len(allowed)
        often = [dict(zip(found, often)).get(j, 0) for j in allowed]
        assert len(allowed) == 1 or chisquare(often, [expected] * len(allowed)).pvalue > 1e-6


def test_each_walker_draws_for_itself():
    graph = of([[0, 0], [0, 1], [1, 0], [1, 1]])
    k = np.repeat([0, 1], 50)
    where = np.random.default_rng(2).random(100)
    after = graph.follow(k, where)
    assert len(set(after[:50])) == len(set(after[50:])) == 2
    np.testing.assert_array_equal(after, graph.follow(k, where))


def test_a_dead_end_is_refused():
    with pytest.raises(ValueError, match="no fragment follows fragment 1"):
        of([[0, 1], [2, 0]], 3)
    with pytest.raises(ValueError, match="no fragment follows fragment 0"):
        of(np.zeros((0, 2)), 1)


@pytest.mark.parametrize("edge", [[0, 3], [3, 0], [-1, 0], [0, -1]])
def test_an_edge_outside_is_refused(edge):
    with pytest.raises(ValueError, match="outside the 3 fragments"):
        of([[0, 1], [1, 2], [2, 0], edge], 3)


def test_joined():
    """Numbers of the second graph go on after those of the first; transitions lead between them."""
    a, b = of([[0, 1], [1, 0]]), of([[0, 1], [1, 2], [2, 0]])
    both = joined([a, b], [((0, 1), (1, 0)), ((1, 2), (0, 0))])
    assert both.count == 5 and len(both.targets) == 5 * STEPS
    for name in ("targets", "start_q", "start_qd", "goal_q", "goal_qd"):
        np.testing.assert_array_equal(
            getattr(both, name), np.concatenate([getattr(a, name), getattr(b, name)])
        )
    edges = {tuple(edge) for edge in both.edges}
    assert edges == {(0, 1), (1, 0), (2, 3), (3, 4), (4, 2), (1, 2), (4, 0)}
    random, seen, k = np.random.default_rng(3), set(), np.zeros(20, int)
    for _ in range(60):
        after = both.follow(k, random.random(20))
        seen |= set(zip(k.tolist(), after.tolist()))
        k = after
    assert seen == edges


def test_joined_without_transitions():
    a = of([[0, 1], [1, 0]])
    assert {tuple(edge) for edge in joined([a, a], []).edges} == {(0, 1), (1, 0), (2, 3), (3, 2)}


def test_joined_graphs_are_walked_in_the_simulation(player, graph, curve, task):
    """A table of both, whose fragments begin and end in their own states."""
    other = tiled(player, curve)
    both = joined([graph, other], [((0, 0), (1, 1)), ((1, 0), (0, 1))])
    worlds = task(4, graph=both)
    k = np.array([0, graph.count, 3, graph.count + 3])
    worlds.reset(Starts(k, both.start_q[k], both.start_qd[k]))
    np.testing.assert_allclose(worlds.observe(k), 0.0, atol=1e-3)  # units of deviation, from float32
    worlds.advance(k, np.zeros((4, worlds.actions)))
    cost, failed = worlds.judge(k)
    assert np.isfinite(cost).all() and not failed.any()


def test_a_transition_from_outside_its_graph_is_refused():
    a = of([[0, 1], [1, 0]])
    with pytest.raises(ValueError):
        joined([a, a], [((0, 2), (1, 0))])


def test_graphs_with_different_time_steps_are_not_joined():
    with pytest.raises(ValueError):
        joined([of([[0, 0]]), of([[0, 0]], step=0.005)], [])


def test_turned_reference_gives_turned_graph(player, dribble, graph):
    """Heading and place of a clip go through, and nothing else changes."""
    by, place = Rotation.from_euler("z", 2.0), [3.0, 1.0, 0.0]
    joint_q = np.array(dribble.reference.joint_q)
    joint_q[:, :3] = by.apply(joint_q[:, :3]) + place
    joint_q[:, 3:7] = (by * Rotation.from_quat(joint_q[:, 3:7])).as_quat()
    turned = tiled(player, Cycle(Reference(joint_q, dribble.reference.timestep)))
    np.testing.assert_allclose(turned.start_q[:, :3], by.apply(graph.start_q[:, :3]) + place, atol=EXACT)
    np.testing.assert_allclose(turned.start_q[:, 7:], graph.start_q[:, 7:], atol=EXACT)
    np.testing.assert_allclose(turned.start_qd[:, 3:], graph.start_qd[:, 3:], atol=1e-6)
    np.testing.assert_allclose(turned.targets[:, 7:], graph.targets[:, 7:], atol=1e-6)
