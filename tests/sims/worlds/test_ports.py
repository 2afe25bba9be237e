"""Ports are live memory: what is written to them the worlds have, what becomes of the worlds they show, at
every lane count, from NumPy and from torch. Beside each simulation goes a twin without ports, to the bit."""

import gc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.reference import scenes
from warpdribble.sims import Simulation, State
from warpdribble.sims.worlds import Course, Place, Probe, terms
from warpdribble.sims.worlds.simulation import PORTS

SIZES = [(lanes, count) for lanes in (1, 16) for count in (1, 3, 16, 19)]


@pytest.fixture(scope="module")
def model():
    """A ball over the ground, and a driven arm: free, ball and hinge joints."""
    arm = (
        '<body name="arm" pos="2 0 1"><joint name="shoulder" type="ball" damping="1"/>'
        '<geom name="arm" type="capsule" size="0.05" fromto="0 0 0 0 0 -0.4"/>'
        '<body name="fore" pos="0 0 -0.4"><joint name="elbow" axis="0 1 0"/>'
        '<geom name="fore" size="0.05" pos="0.2 0 0"/></body></body>'
    )
    drive = '<actuator><position joint="elbow" kp="20" kv="2"/></actuator>'
    return scenes.scene(scenes.ground() + scenes.ball(height=0.2, restitution=0.5) + arm, rest=drive)


def views(sim, kind):
    """What is written to and looked at, by name."""
    if kind == "torch":
        pytest.importorskip("torch", reason="torch is an optional extra: learn")
        return {name: getattr(sim.torch, name) for name in PORTS}
    return {name: sim.port(name).numpy() for name in PORTS}


def write(view, worlds, values):
    """To some worlds of a view."""
    if isinstance(view, np.ndarray):
        view[worlds] = values
    else:
        import torch

        view[torch.as_tensor(worlds)] = torch.as_tensor(values)


def anything(model, name, random, count):
    """(count, n) values of a quantity."""
    n = model.nq if name.endswith("q") else model.nv
    values = random.uniform(-1, 1, (count, n))
    if name.endswith("q"):
        values[:, model.q_slice("ball").start + 2] += 1.2
        for k in model.quaternions():
            values[:, k : k + 4] /= np.linalg.norm(values[:, k : k + 4], axis=1, keepdims=True)
    return values.astype(np.float32)


class Twins:
    """A simulation with open ports, and one whose arrays are set from inside."""

    def __init__(self, model, lanes, count, kind):
        self.model, self.count = model, count
        self.sim, self.twin = (Simulation(model, count, lanes=lanes) for _ in range(2))
        self.both = (self.sim, self.twin)
        self.views = views(self.sim, kind)
        table = np.tile(model.start_q, (8, 1))
        table[:, model.q_slice("elbow")] = np.linspace(0, 1, 8)[:, None]
        self.courses = [Course(sim, table, ("elbow",), ("fore",)) for sim in self.both]
        of = {
            "place": terms.point(Place("fore", (0.2, 0.0, 0.0))),
            "spin": terms.spin(),
            "v": terms.velocity("fore"),
        }
        self.probes = [Probe(sim, of) for sim in self.both]
        self.start = self.twin.state()

    def begin(self):
        for sim in self.both:
            sim.place(self.start)
            sim.set_targets(self.model.start_q)
            sim.set_joint_force(np.zeros(self.model.nv))

    def some(self, random):
        return np.flatnonzero(random.random(self.count) < 0.5)

    def write(self, name, random):
        worlds = self.some(random)
        values = anything(self.model, name, random, len(worlds))
        write(self.views[name], worlds, values)
        self.twin._write(PORTS[name], worlds, values)

    def step(self, random):
        count = int(random.integers(1, 4))
        for sim in self.both:
            sim.step(count)

    def reset(self, random):
        worlds = self.some(random)
        q, qd = (anything(self.model, name, random, len(worlds)) for name in ("joint_q", "joint_qd"))
        for sim in self.both:
            sim.reset(worlds, q, qd)

    def place(self, random):
        pool = State.of(self.model, anything(self.model, "joint_q", random, 4))
        rows = random.integers(-1, 4, self.count)
        for sim in self.both:
            sim.place(pool, rows)

    def put_back(self, random):
        for sim in self.both:
            sim.place(self.start)

    def copy(self, random):
        sources = random.integers(0, self.count, self.count)
        for sim in self.both:
            sim.copy_worlds(sources)

    def copy_in_place(self, random):
        sources = np.where(random.random(self.count) < 0.5, 0, np.arange(self.count))
        for sim in self.both:
            sim.copy_worlds(sources)

    def targets(self, random):
        target = anything(self.model, "joint_target_q", random, self.count)
        for sim in self.both:
            sim.set_targets(target)

    def forces(self, random):
        force = anything(self.model, "joint_f", random, self.count)
        for sim in self.both:
            sim.set_joint_force(force)

    def push(self, random):
        worlds = self.some(random)
        for sim in self.both:
            sim.apply_force("arm", [5.0, -3.0, 1.0], worlds)

    def course(self, random):
        offset, push = random.uniform(-1, 1, (self.count, 1)), random.uniform(-1, 1, (self.count, 1, 3))
        rows = random.integers(0, 5, self.count)
        for course in self.courses:
            course.offset[:], course.push[:] = offset, push
            course.step(3, rows)

    def read(self, random):
        """Something that is computed from what was written."""
        readings = (
            lambda sim: sim.joint_q,
            lambda sim: sim.joint_qd,
            lambda sim: np.concatenate(sim.bodies(), axis=2),
            lambda sim: sim.mass_matrix(),
            lambda sim: sim.bias_force(),
            lambda sim: sim.contacts().gap,
            lambda sim: sim.state().joint_q,
            lambda sim: self.probes[self.both.index(sim)].read(),
        )
        reading = readings[random.integers(len(readings))]
        np.testing.assert_array_equal(*map(reading, self.both))

    def check(self, what):
        """The views show what the twin has, without being asked for anew."""
        for name, view in self.views.items():
            there = self.twin._read(getattr(self.twin._world, PORTS[name]))
            np.testing.assert_array_equal(np.asarray(view), there, err_msg=f"{name} after {what}")

    def end(self):
        one, two = (sim.state() for sim in self.both)
        for name in one.names:
            np.testing.assert_array_equal(one[name], two[name], err_msg=name)


DO = {f"write {name}": (lambda twins, random, name=name: twins.write(name, random)) for name in PORTS}
DO |= {
    done.__name__: done
    for done in (
        Twins.step,
        Twins.reset,
        Twins.place,
        Twins.put_back,
        Twins.copy,
        Twins.copy_in_place,
        Twins.targets,
        Twins.forces,
        Twins.push,
        Twins.course,
        Twins.read,
    )
}


@pytest.mark.parametrize("kind", ["numpy", "torch"])
@pytest.mark.parametrize(("lanes", "count"), SIZES)
def test_no_write_is_lost_and_no_view_stale(model, lanes, count, kind):
    """Whatever is written, done and read, in any order."""
    twins = Twins(model, lanes, count, kind)

    @settings(max_examples=25, deadline=None, derandomize=True)
    @given(st.lists(st.tuples(st.sampled_from(sorted(DO)), st.integers(0, 2**16)), min_size=2, max_size=10))
    def run(done):
        twins.begin()
        twins.check("the beginning")
        for k, (what, seed) in enumerate(done):
            DO[what](twins, np.random.default_rng(seed))
            twins.check([name for name, _ in done[: k + 1]])
        twins.end()

    run()


@pytest.mark.parametrize("kind", ["numpy", "torch"])
@pytest.mark.parametrize(("lanes", "count"), SIZES)
def test_a_write_survives_what_is_done_to_other_worlds(model, lanes, count, kind):
    """The last world, which the unused ones follow, is written to; the first is reset, placed, copied, ..."""
    q = anything(model, "joint_q", np.random.default_rng(0), 1)[0]
    others = np.arange(count - 1)
    rows, sources = np.where(np.arange(count) < count - 1, 0, -1), np.arange(count)
    sources[: count - 1] = 0
    done = {
        "reset": lambda sim: sim.reset(others),
        "place": lambda sim: sim.place(State.of(model, model.start_q), rows),
        "copy": lambda sim: sim.copy_worlds(sources),
        "targets": lambda sim: sim.set_targets(model.start_q),
        "forces": lambda sim: sim.set_joint_force(np.zeros(model.nv)),
        "force": lambda sim: sim.apply_force("ball", [1.0, 0.0, 0.0]),
        "mass": lambda sim: sim.set_mass("ball", 0.7),
        "nothing": lambda sim: sim.reset([]),
    }
    for name, do in done.items():
        sim = Simulation(model, count, lanes=lanes)
        view = views(sim, kind)["joint_q"]
        write(view, [count - 1], q)
        do(sim)
        np.testing.assert_array_equal(np.asarray(view)[-1], q, err_msg=name)
        np.testing.assert_array_equal(sim.joint_q[-1], q, err_msg=name)
        np.testing.assert_array_equal(sim.body_q[-1, model.body("ball"), :3], q[:3], err_msg=name)
        if count > 1:
            assert not np.array_equal(sim.joint_q[0], q)


@pytest.mark.parametrize("kind", ["numpy", "torch"])
@pytest.mark.parametrize(("lanes", "count"), SIZES)
def test_targets_and_forces_act_on_the_next_step(model, lanes, count, kind):
    """The drive turns the elbow to where it is told, and back; a force turns it the other way; each in the
    world that is meant."""
    sim, elbow, own = Simulation(model, count, lanes=lanes), model.q_slice("elbow").start, count - 1
    still, dof = Simulation(model, count, lanes=lanes), model.dof_slice("elbow").start
    seen = views(sim, kind)
    for name, column, value in (
        ("joint_target_q", elbow, 0.5),
        ("joint_target_q", elbow, -0.5),
        ("joint_f", dof, 3.0),
        ("joint_f", dof, -3.0),
    ):
        sim.reset()
        still.reset()
        view = seen[name]
        before = float(view[own, column])
        view[own, column] = value
        sim.step()
        still.step()
        change = sim.joint_qd[:, dof] - still.joint_qd[:, dof]
        assert np.sign(value) * change[own] > 0.05
        assert not change[:own].any()
        assert float(view[own, column]) == value  # until changed
        view[own, column] = before
    sim.reset()
    still.reset()
    sim.step(5)
    still.step(5)
    np.testing.assert_array_equal(sim.joint_q, still.joint_q)


def test_open_ports_change_no_bit(player):
    """Of players that stand, fall, are reset and copied; nor does looking at them."""
    one, two = (Simulation(player, 19, lanes=16) for _ in range(2))
    seen = views(one, "numpy")
    q = np.tile(player.start_q, (19, 1))
    q[:, 2] += np.linspace(0, 0.3, 19)
    for sim in (one, two):
        sim.set_targets(player.start_q)
        sim.reset(joint_q=q)
        sim.apply_force("torso", [30.0, 0.0, 0.0], [2])
        for k in range(4):
            sim.step(10)
            sim.reset([k, 18])
            sim.copy_worlds(np.roll(np.arange(19), k))
    np.testing.assert_array_equal(seen["joint_qd"], two.joint_qd)
    for name in one.state().names:
        np.testing.assert_array_equal(one.state()[name], two.state()[name], err_msg=name)
    np.testing.assert_array_equal(one.status, two.status)


@pytest.mark.parametrize("lanes", [1, 16])
def test_opened_late_it_shows_the_present(model, lanes):
    """And what was written to another before."""
    sim = Simulation(model, 3, lanes=lanes)
    sim.step(3)
    rates = sim.port("joint_qd").numpy()
    np.testing.assert_array_equal(rates, sim.joint_qd)
    rates[1] = 2.0
    places = sim.port("joint_q").numpy()
    np.testing.assert_array_equal(places, sim.joint_q)
    assert sim.port("joint_qd").numpy()[1, 0] == 2.0
    other = sim.port("joint_qd").numpy()  # the same memory
    other[2] = -1.0
    assert rates[2, 0] == -1.0 and sim.joint_qd[2, 0] == -1.0


@pytest.mark.parametrize("lanes", [1, 16])
def test_to_open_the_targets_is_to_set_them(model, lanes):
    """Else a reset would write its pose over what was written to them."""
    sim, elbow = Simulation(model, 3, lanes=lanes), model.q_slice("elbow").start
    q = model.start_q.copy()
    q[elbow] = 0.7
    sim.reset(joint_q=q)
    target = sim.port("joint_target_q").numpy()
    np.testing.assert_allclose(target[:, elbow], 0.7)
    target[1, elbow] = -0.2
    sim.reset()
    sim.reset([1])
    np.testing.assert_allclose(target[:, elbow], [0.7, -0.2, 0.7])


@pytest.mark.parametrize("kind", ["numpy", "torch"])
@pytest.mark.parametrize("lanes", [1, 16])
def test_views_outlive_the_simulation(model, lanes, kind):
    """Their memory is theirs, too."""
    sim = Simulation(model, 3, lanes=lanes)
    sim.step(2)
    seen, expected = views(sim, kind), sim.joint_q
    del sim
    gc.collect()
    others = [Simulation(model, 3, lanes=lanes) for _ in range(3)]
    np.testing.assert_array_equal(np.asarray(seen["joint_q"]), expected)
    write(seen["joint_q"], [1], np.full(model.nq, 7.0, np.float32))
    assert not any((other.joint_q == 7.0).any() for other in others)


@pytest.mark.parametrize("lanes", [1, 16])
def test_shapes(model, lanes):
    sim = Simulation(model, 19, lanes=lanes)
    for name in PORTS:
        n = model.nq if name.endswith("q") else model.nv
        assert sim.port(name).shape == (19, n) == sim.port(name).numpy().shape
    with pytest.raises(
        ValueError, match=r"no port 'q'; there are joint_q, joint_qd, joint_target_q, joint_f"
    ):
        sim.port("q")
