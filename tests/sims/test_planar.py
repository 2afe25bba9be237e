"""Poses over the ground against complex numbers and SciPy's rotations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from warpdribble.sims.planar import (
    composed,
    heading,
    over_ground,
    planar,
    relative,
    rotation,
    turned,
    wrapped,
)

number = st.floats(-100, 100)
triples = st.integers(1, 4).flatmap(
    lambda n: st.tuples(*[st.lists(st.tuples(number, number, number), min_size=n, max_size=n)] * 3)
)
EXACT = 1e-9  # float64 of some 100 m and rad


def complex_of(a):
    """Place and unit direction."""
    return a[:, 0] + 1j * a[:, 1], np.exp(1j * a[:, 2])


def assert_same(a, b):
    """The same places, and angles that differ by whole turns."""
    np.testing.assert_allclose(a[:, :2], b[:, :2], atol=EXACT)
    np.testing.assert_allclose(np.exp(1j * a[:, 2]), np.exp(1j * b[:, 2]), atol=EXACT)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(triples)
def test_going_on_and_seen_from(three):
    """Composition is the product of complex numbers; `relative` undoes it; it is associative."""
    a, b, c = map(np.array, three)
    place, turn = complex_of(a)
    there, facing = complex_of(b)
    at, ahead = complex_of(composed(a, b))
    np.testing.assert_allclose(at, place + turn * there, atol=EXACT)
    np.testing.assert_allclose(ahead, turn * facing, atol=EXACT)
    seen, way = complex_of(relative(a, b))
    np.testing.assert_allclose(seen, (there - place) / turn, atol=EXACT)
    np.testing.assert_allclose(way, facing / turn, atol=EXACT)
    assert_same(composed(a, relative(a, b)), b)
    assert_same(relative(a, composed(a, b)), b)
    assert_same(composed(composed(a, b), c), composed(a, composed(b, c)))
    assert_same(relative(composed(c, a), composed(c, b)), relative(a, b))  # who looks from where it is


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.lists(st.floats(-1000, 1000), min_size=1, max_size=5).map(np.array))
def test_wrapped(angle):
    inside = wrapped(angle)
    assert (inside >= -np.pi).all() and (inside <= np.pi).all()
    turns = (inside - angle) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    near = np.abs(angle) < np.pi - 1e-9
    np.testing.assert_allclose(inside[near], angle[near], atol=1e-12)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(
        st.tuples(number, number, st.floats(-3.1, 3.1), st.floats(-1.4, 1.4), st.floats(-3, 3)), min_size=1
    )
)
def test_planar(cases):
    """The heading is the yaw of yaw, pitch and roll, for a pitch short of a right angle."""
    x, y, yaw, pitch, roll = np.array(cases).T
    q = np.zeros((len(x), 9))
    q[:, 0], q[:, 1], q[:, 2] = x, y, 1.0
    q[:, 3:7] = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1)).as_quat()
    np.testing.assert_allclose(planar(q), np.stack([x, y, yaw], axis=1), atol=EXACT)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-4, 4), st.floats(0.1, 10))
def test_the_heading_is_of_unit_quaternions_of_any_number(yaw, size):
    """No axes, one and two; the size of float32 is kept."""
    turn = Rotation.from_euler("z", yaw)
    one = heading(turn.as_quat())
    assert np.shape(one) == () and np.exp(1j * one) == pytest.approx(np.exp(1j * yaw), abs=EXACT)
    many = heading(np.tile(turn.as_quat().astype(np.float32), (3, 2, 1)))
    assert many.shape == (3, 2) and many.dtype == np.float32
    np.testing.assert_allclose(np.exp(1j * many), np.exp(1j * yaw), atol=1e-5)


def test_a_broken_root_has_no_place():
    q = np.full((2, 8), np.nan)
    q[1] = [1, 2, 3, 0, 0, 0, 1, 0]
    assert np.isfinite(planar(q)).all(axis=1).tolist() == [False, True]


@settings(max_examples=100, deadline=None, derandomize=True)
@given(*[st.tuples(number, number)] * 3, number)
def test_over_ground(point, pivot, place, turn):
    """The pivot comes to the place, all else turns about it; heights stay, attitudes turn along."""
    z, c, p = (complex(*v) for v in (point, pivot, place))
    attitude = Rotation.random(2, random_state=1)
    poses = np.zeros((2, 7))
    poses[:, :2], poses[:, 2], poses[:, 3:] = [point, pivot], [4.0, 5.0], attitude.as_quat()
    moved = over_ground(poses, np.array(pivot), np.array(place), turn)
    expected = np.array([(z - c) * np.exp(1j * turn) + p, p])
    np.testing.assert_allclose(moved[:, 0] + 1j * moved[:, 1], expected, atol=EXACT)
    np.testing.assert_array_equal(moved[:, 2], [4.0, 5.0])
    apart = Rotation.from_quat(moved[:, 3:]) * (Rotation.from_euler("z", turn) * attitude).inv()
    assert apart.magnitude().max() < 1e-7
    points = over_ground(poses[:, :3], np.array(pivot), np.array(place), turn)
    np.testing.assert_array_equal(points, moved[:, :3])
    np.testing.assert_array_equal(poses[:, :2], [point, pivot])  # what was given stays


@pytest.mark.parametrize("angle", [0.0, 0.3, -2.0, 7.0])
def test_rotation(angle):
    way = rotation(angle) @ [2.0, -1.0]
    assert complex(*way) == pytest.approx((2 - 1j) * np.exp(1j * angle))


def test_states_turned_move_as_before():
    """Turned to and fro, they are as they were; a player that runs ahead still does, and spins as fast."""
    random = np.random.default_rng(0)
    q, qd, by = random.normal(size=(5, 9)), random.normal(size=(5, 8)), random.uniform(-4, 4, 5)
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    there = turned(q, qd, by, np.ones((5, 2)))
    assert_same(np.c_[np.ones((5, 2)), heading(q[:, 3:7]) + by], planar(there[0]))
    before, after = (Rotation.from_quat(x[:, 3:7]).inv().apply(v[:, :3]) for x, v in ((q, qd), there))
    np.testing.assert_allclose(after, before, atol=EXACT)
    np.testing.assert_array_equal(there[1][:, 3:], qd[:, 3:])
    np.testing.assert_array_equal(there[0][:, 7:], q[:, 7:])
    back = turned(*there, -by, q[:, :2])
    np.testing.assert_allclose(np.abs(np.sum(back[0][:, 3:7] * q[:, 3:7], axis=1)), 1.0, atol=EXACT)
    np.testing.assert_allclose(back[1], qd, atol=EXACT)
