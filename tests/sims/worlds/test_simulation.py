"""The surface of Simulation: shapes, arguments and their errors, independence of calls."""

import warnings

import numpy as np
import pytest

from tests.reference import scenes
from warpdribble.sims import Model, Simulation

WORLDS = 5


@pytest.fixture(scope="module")
def model():
    return scenes.scene(
        scenes.ground()
        + scenes.ball(height=1.0)
        + '<body name="arm" pos="2 0 2"><joint name="shoulder" type="ball"/>'
        '<geom name="arm" type="capsule" size="0.05" fromto="0 0 0 0 0 -0.4"/>'
        '<body name="fore" pos="0 0 -0.4"><joint name="elbow"/><geom name="fore" size="0.05" pos="0.2 0 0"/>'
        '<body name="tip" pos="0.3 0 0"><geom name="tip" size="0.03"/></body></body></body>'
    )


@pytest.fixture
def sim(model):
    return Simulation(model, WORLDS)


def test_shapes(sim, model):
    nq, nv, nbody = model.nq, model.nv, model.nbody
    assert (nq, nv, nbody) == (12, 10, 4)
    sim.step(3)
    for array, shape in (
        (sim.joint_q, (nq,)),
        (sim.joint_qd, (nv,)),
        (sim.body_q, (nbody, 7)),
        (sim.body_qd, (nbody, 6)),
        (sim.status, ()),
        (sim.mass_matrix(), (nv, nv)),
        (sim.bias_force(), (nv,)),
    ):
        assert array.shape == (WORLDS, *shape)
    touch = sim.contacts()
    n = len(touch.shapes)
    assert touch.gap.shape == (WORLDS, n)
    for vector in (touch.point, touch.normal, touch.impulse):
        assert vector.shape == (WORLDS, n, 3)


def test_starts_at_rest_in_the_start_pose(sim, model):
    np.testing.assert_allclose(sim.joint_q, np.tile(model.start_q, (WORLDS, 1)), atol=1e-7)
    assert not sim.joint_qd.any() and not sim.status.any()


@pytest.mark.parametrize("count", [0, -1, -100])
def test_world_count(model, count):
    with pytest.raises(ValueError, match="world_count"):
        Simulation(model, count)


@pytest.mark.parametrize("lanes", [2, 5, 32])
def test_lanes(model, lanes):
    with pytest.raises(ValueError, match="lanes"):
        Simulation(model, 4, lanes=lanes)


def test_threads(model):
    """More threads than groups are fine; a negative number must not quietly step nothing."""
    assert Simulation(model, 4, threads=64, lanes=4).threads == 1
    try:
        sim = Simulation(model, 4, threads=-1)
    except ValueError:
        return
    sim.step(5)
    assert sim.joint_qd.any()


@pytest.mark.parametrize("shape", [(3,), (WORLDS, 3), (WORLDS + 1, 12), (1, WORLDS, 12), ()])
def test_wrong_shape(sim, shape):
    values = np.ones(shape)
    for call, name in (
        (lambda: sim.reset(joint_q=values), "joint_q"),
        (lambda: sim.set_targets(values), "joint_target_q"),
        (lambda: sim.reset(joint_qd=values), "joint_qd"),
        (lambda: sim.set_joint_force(values), "joint_f"),
    ):
        with pytest.raises(ValueError, match=f"{name} must have shape"):
            call()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_not_finite(sim, model, bad):
    q = model.start_q.copy()
    q[0] = bad
    for call in (
        lambda: sim.reset(joint_q=q),
        lambda: sim.set_targets(q),
        lambda: sim.reset(joint_qd=np.full(model.nv, bad)),
        lambda: sim.set_joint_force(np.full(model.nv, bad)),
        lambda: sim.apply_force("ball", [0, bad, 0]),
    ):
        with pytest.raises(ValueError, match="not finite"):
            call()
    for call in (
        lambda: sim.set_mass("ball", bad),
        lambda: sim.set_contact("ball", "ground", friction=bad),
        lambda: sim.set_contact("ball", "ground", restitution=bad),
    ):
        with pytest.raises(ValueError):
            call()
    sim.step(2)
    assert not sim.status.any()


def test_zero_quaternion(sim, model):
    q = model.start_q.copy()
    q[model.q_slice("shoulder")] = 0
    for call in (sim.set_targets, lambda q: sim.reset(joint_q=q)):
        with pytest.raises(ValueError, match="unit quaternion"):
            call(q)


def test_quaternions_are_normalised(sim, model):
    q = model.start_q.copy()
    q[model.q_slice("shoulder")] = [0, 2, 0, 2]
    sim.reset(joint_q=q)
    np.testing.assert_allclose(sim.joint_q[0, model.q_slice("shoulder")], np.sqrt([0, 0.5, 0, 0.5]))


@pytest.mark.parametrize("worlds", [[WORLDS], [-1], [0, 99], WORLDS])
def test_worlds_out_of_range(sim, worlds):
    for call in (
        lambda: sim.reset(worlds),
        lambda: sim.apply_force("ball", [0, 0, 1], worlds),
        lambda: sim.set_mass("ball", 1.0, worlds),
        lambda: sim.set_contact("ball", "ground", friction=0.1, worlds=worlds),
    ):
        with pytest.raises(IndexError, match="worlds must lie in"):
            call()


def test_mask_of_the_wrong_length(sim):
    with pytest.raises(ValueError, match="mask of worlds"):
        sim.reset(np.ones(WORLDS + 1, bool))


@pytest.mark.parametrize("worlds", [[0.5], [1.0, 2.7], ["0"]])
def test_worlds_must_be_integers(sim, worlds):
    """0.5 is no world; it must not become world 0."""
    with pytest.raises((ValueError, IndexError, TypeError)):
        sim.apply_force("ball", [0, 0, 1], worlds)


def test_no_worlds_at_all(sim):
    before = sim.joint_q.copy()
    sim.step(3)
    moved = sim.joint_q.copy()
    assert not np.array_equal(before, moved)
    sim.reset(np.zeros(WORLDS, bool))
    sim.reset([])
    assert np.array_equal(sim.joint_q, moved)


def test_unknown_names(sim):
    with pytest.raises(KeyError, match="no body named 'leg'"):
        sim.apply_force("leg", [0, 0, 1])
    with pytest.raises(KeyError, match="no body named 'leg'"):
        sim.set_mass("leg", 1.0)
    with pytest.raises(ValueError, match="no shape or body named 'leg'"):
        sim.set_contact("leg", "ground", friction=1.0)
    with pytest.raises(ValueError, match="'elbow' is not a free joint"):
        sim.set_root_drive(1, 1, 1, 1, "elbow")


@pytest.mark.parametrize("body", [-1, 4, 1000])
def test_body_index_out_of_range(sim, body):
    with pytest.raises((IndexError, KeyError, ValueError), match=r"body|bodies"):
        sim.apply_force(body, [0, 0, 1])


def test_force_shapes(sim):
    sim.apply_force("ball", np.zeros((WORLDS, 3)))
    sim.apply_force("ball", np.zeros((2, 3)), [1, 2])
    for force, worlds in ((np.zeros((2, 3)), None), (np.zeros((3, 3)), [1, 2]), ([0, 1], None)):
        with pytest.raises(ValueError, match="force must have shape"):
            sim.apply_force("ball", force, worlds)


def test_values_by_world_of_the_wrong_number(sim):
    for call in (
        lambda: sim.set_mass("ball", np.ones(3)),
        lambda: sim.set_mass("ball", np.ones(3), [0, 1]),
        lambda: sim.set_contact("ball", "ground", friction=np.ones(WORLDS + 1)),
        lambda: sim.reset([0, 1], joint_q=np.ones((3, 12))),
    ):
        with pytest.raises(ValueError):
            call()


def test_impossible_parameters(sim):
    for mass in (0.0, -1.0):
        with pytest.raises(ValueError, match="mass must be positive"):
            sim.set_mass("ball", mass)
    with pytest.raises(ValueError, match="friction must not be negative"):
        sim.set_contact("ball", "ground", friction=-0.1)
    with pytest.raises(ValueError, match="restitution must not be negative"):
        sim.set_contact("ball", "ground", restitution=-0.1)
    with pytest.raises(ValueError, match="never touch"):
        sim.set_contact("tip", "fore", friction=0.5)
    with pytest.raises(ValueError, match="fixed to another"):
        sim.set_mass("tip", 1.0)


def test_no_free_joint():
    arm = scenes.scene('<body><joint name="j"/><geom size="0.1"/></body>')
    with pytest.raises(ValueError, match="no free joint"):
        Simulation(arm, 1).set_root_drive(1, 1, 1, 1)


def test_inputs_are_not_kept(sim, model):
    """Changing an array after the call changes nothing."""
    q, target = model.start_q.copy(), model.start_q.copy()
    sim.reset(joint_q=q)
    sim.set_targets(target)
    q[:], target[:] = 99.0, 99.0
    sim.step(5)
    assert np.abs(sim.joint_q).max() < 5


def test_targets_follow_the_pose_until_set(model):
    q = model.start_q.copy()
    q[model.q_slice("elbow")] = 0.7
    drive = '<actuator><position joint="elbow" kp="50" kv="5"/></actuator>'
    driven = scenes.scene(
        '<body><joint name="elbow"/><geom size="0.1" pos="0.1 0 0"/></body>', gravity="0 0 0", rest=drive
    )
    sim = Simulation(driven, 2)
    sim.reset(joint_q=[0.7])
    sim.step(100)
    np.testing.assert_allclose(sim.joint_q, 0.7, atol=1e-6)
    sim.set_targets([0.2])
    sim.reset(joint_q=[0.7])
    sim.step(300)
    np.testing.assert_allclose(sim.joint_q, 0.2, atol=1e-3)


def test_model_without_anything_to_touch():
    """No shapes, no drives, no contacts: still steps."""
    lone = scenes.scene('<body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>')
    sim = Simulation(lone, 3)
    sim.step(100)
    np.testing.assert_allclose(sim.joint_qd[:, 2], -9.81, rtol=1e-5)
    touch = sim.contacts()
    assert touch.gap.shape == (3, 0) and touch.impulse.shape == (3, 0, 3)


def test_welded_bodies_move_with_their_parent(sim):
    sim.apply_force("fore", [3.0, 1.0, 0.0])
    sim.step(50)
    x = sim.body_q
    apart = np.linalg.norm(x[:, 3, :3] - x[:, 2, :3], axis=1)
    np.testing.assert_allclose(apart, 0.3, atol=1e-6)
    np.testing.assert_allclose(x[:, 3, 3:], x[:, 2, 3:], atol=1e-6)


def test_force_on_a_welded_body_acts_at_its_own_centre(model):
    """A force on the tip turns the elbow by its own lever: (0.3, 0, 0) x f."""
    sim = Simulation(model, 2)
    base = sim.bias_force()[0]
    sim.apply_force("tip", [0.0, 0.0, 2.0])
    change = sim.bias_force()[0] - base
    elbow = model.dof_slice("elbow").start
    at = sim.body_q[0, model.body("tip"), :3] - sim.body_q[0, model.body("fore"), :3]
    axis = np.array([0, 0, 1.0])  # MuJoCo's default
    assert change[elbow] == pytest.approx(-axis @ np.cross(at, [0, 0, 2.0]), abs=1e-6)
    sim.apply_force("tip", [0.0, 2.0, 0.0])
    change = sim.bias_force()[0] - base
    assert change[elbow] == pytest.approx(-axis @ np.cross(at, [0, 2.0, 0]), abs=1e-6)
    assert abs(change[elbow]) > 0.5


def test_mass_matrix_is_symmetric_and_positive(model):
    sim = Simulation(Model.load("player"), 2)
    M = sim.mass_matrix()
    assert np.array_equal(M, M.transpose(0, 2, 1))
    assert (np.linalg.eigvalsh(M.astype(float)) > 0).all()


def test_loading_the_player_warns_of_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Model.load("player")


def test_memory_per_world():
    """At most 48 KiB a world (the goal of the first issue)."""
    sim = Simulation(Model.load("player"), 64)
    print(f"{sim.memory_per_world / 1024:.1f} KiB a world")
    assert sim.memory_per_world <= 48 * 1024
