"""Worlds side by side, the layout that CUDA uses, give what worlds in rows give."""

import numpy as np
import pytest

from warpdribble.sims import Simulation, State
from warpdribble.sims.worlds import Course, Group, Place, Probe, Watch, terms
from warpdribble.sims.worlds.batch import Batch, find_device
from warpdribble.sims.worlds.watch import first, gap, least, total, trouble


@pytest.fixture
def pair(player, monkeypatch):
    """Two simulations of three players: worlds in rows, and side by side."""
    rows = Simulation(player, 3, lanes=1)
    monkeypatch.setattr(Batch, "_side_by_side", property(lambda self: True, lambda self, on: None), False)
    columns = Simulation(player, 3, lanes=1)
    monkeypatch.undo()
    columns._side_by_side = True
    assert columns._world.q.strides[0] < columns._world.q.strides[1]
    assert rows._world.q.strides[0] > rows._world.q.strides[1]
    return rows, columns


def test_side_by_side_gives_the_same_bits(player, pair):
    rows, columns = pair
    q = np.tile(player.keyframes["hold"], (3, 1))
    q[1, 2] += 0.01
    for sim in pair:
        sim.reset(joint_q=q)
        sim.set_targets(q[0])
        sim.set_mass("ball", [0.5, 0.6, 0.7])
        sim.set_contact("ball", "ground", restitution=0.7, worlds=[2])
        sim.apply_force("torso", [20.0, 0.0, 0.0], worlds=[0])
        sim.step(20)
        sim.reset(worlds=[2], joint_q=q[0])
        sim.step(20)
    np.testing.assert_array_equal(rows.joint_q, columns.joint_q)
    np.testing.assert_array_equal(rows.joint_qd, columns.joint_qd)
    np.testing.assert_array_equal(rows.contacts().impulse, columns.contacts().impulse)
    np.testing.assert_array_equal(rows.mass_matrix(), columns.mass_matrix())
    for a, b in zip(rows.bodies(), columns.bodies()):
        np.testing.assert_array_equal(a, b)


def test_what_crosses_the_edge_side_by_side(player, pair):
    """Courses with signals and forces, probes with costs, watches."""
    random = np.random.default_rng(0)
    targets = np.tile(player.start_q, (12, 1))
    offset = 0.2 * random.standard_normal((3, 5))
    offset[:, 3] = np.abs(offset[:, 3])
    push = random.uniform(-30, 30, (3, 1, 3))
    goals, weight = (targets, np.zeros((12, player.nv))), random.random(12)
    steered = ("l_hip", "r_knee", {"r_index_pip": 1.0, "r_index_dip": 0.5})
    of = {
        "foot": terms.point("l_foot"),
        "miss": terms.miss(("neck",)),
        "momentum": terms.momentum(),
        "way": terms.between(Place("r_hand", (0.1, 0.0, 0.0)), "ball"),
        "ball": terms.ballistic("ball", 0.12, 0.9, 0.8),
    }
    near = gap("r_palm", "ball")
    watched = {"near": least(near), "sum": total(near, weight), "bad": first(trouble())}
    seen = []
    for sim in pair:
        course = Course(sim, targets, steered, ("torso",))
        course.offset[:], course.push[:] = offset, push
        probe = Probe(sim, of, goals, [Group("foot", 2.0), Group("miss", 1.0, (1, 2))])
        probe.want(np.linspace(0, 1, 12 * probe.size).reshape(12, -1))
        watch = Watch(sim, watched, 12)
        course.step(5, [0, 3, 7], watch)
        sim.copy_worlds([0, 0, 2])
        course.step(5, [1, 2, 3])
        felt, cost = probe.judge([0, 1, 2])
        seen.append(np.concatenate([felt, cost[:, None], watch.read(), sim.joint_q, sim.joint_qd], axis=1))
    np.testing.assert_array_equal(*seen)


def test_states_between_the_layouts(player, pair):
    """Of one into the other, as a whole and by rows; what was written to a port is in them."""
    for one, two in (pair, pair[::-1]):
        one.step(10)
        one.port("joint_qd").numpy()[2, 0] = 0.25
        state = one.state()
        assert state.joint_qd[2, 0] == 0.25
        two.place(state)
        for name in state.names:
            np.testing.assert_array_equal(two.state()[name], state[name], err_msg=name)
        two.place(state, [-1, 0, 1])
        for name in state.names:
            np.testing.assert_array_equal(two.state()[name], state[name][[0, 0, 1]], err_msg=name)
        two.place(State.of(player, player.start_q), [0, -1, -1])
        assert not two.state()["impulse"][0].any() and two.state()["impulse"][1].any()


def test_what_is_copied_to_a_device_arrives(pair):
    """On CUDA ports and rows are assigned to: no array of one layout is taken for the other's."""
    values = np.arange(12, dtype=np.float32).reshape(3, 4)
    for sim in pair:
        port, rows = sim.new_port(4), sim.new_rows()
        port.assign(values)
        np.testing.assert_array_equal(port.numpy(), values)
        rows.assign(np.broadcast_to(np.asarray(5, np.int32), (3,)))
        np.testing.assert_array_equal(rows.numpy(), [5, 5, 5])


def test_unknown_device_names_those_there_are():
    with pytest.raises(ValueError, match=r"no device 'cuda:99' here; there are: cpu"):
        find_device("cuda:99")
