"""Values over time: stretches counted by hand, SciPy's own interpolation, waves of known frequency."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from warpdribble.sims.signals import (
    continuous,
    interpolate_lines,
    interpolate_rotations,
    low_pass,
    low_pass_rotations,
    runs,
    smoothstep,
    speed,
)


def stretches(holds, join=0, shortest=1):
    """The same, value by value."""
    holds = list(holds)
    for i in range(len(holds)):
        gap = next((k for k in range(1, len(holds) - i) if holds[i + k]), 0)
        if holds[i] and 1 < gap <= join + 1:
            holds[i + 1 : i + gap] = [True] * (gap - 1)
    found = []
    for i, value in enumerate(holds):
        if value and (i == 0 or not holds[i - 1]):
            found.append([i, i])
        elif value:
            found[-1][1] = i
    return [(a, b) for a, b in found if b - a + 1 >= shortest]


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.lists(st.booleans(), max_size=30), st.integers(0, 4), st.integers(1, 4))
def test_runs(holds, join, shortest):
    found = runs(holds, join, shortest)
    assert found == stretches(holds, join, shortest)
    assert all(type(end) is int for pair in found for end in pair)


def test_runs_of_what_is_no_bool():
    assert runs(np.array([0, 3, 1, 0])) == [(1, 2)] and runs([]) == []


def test_smoothstep():
    """Starts and ends at rest, and is its own point reflection."""
    share = np.linspace(0.0, 1.0, 101)
    eased = smoothstep(share)
    assert (eased[0], eased[50], eased[-1]) == (0.0, 0.5, 1.0)
    np.testing.assert_allclose(eased + eased[::-1], 1.0, atol=1e-15)
    np.testing.assert_allclose(np.gradient(eased, share)[[0, -1]], 0.0, atol=0.03)
    assert (np.diff(eased) > 0.0).all()


@pytest.mark.parametrize("rate", [30.0, 120.0])
def test_speed_around_a_circle(rate):
    at = 2.0 * np.pi * 0.5 * np.arange(int(4 * rate)) / rate
    path = 1.5 * np.stack([np.cos(at), np.sin(at), 0.0 * at], axis=1)
    np.testing.assert_allclose(speed(path, rate)[1:-1], 1.5 * np.pi, rtol=0.003)
    assert speed(path[:1], rate).tolist() == [0.0] and len(speed(path[:0], rate)) == 0


@pytest.mark.parametrize(("frequency", "kept"), [(1.0, 1.0), (6.0, 0.5), (30.0, 0.0)])
def test_low_pass(frequency, kept):
    """Twice a second order filter halves the power of its cut-off twice; nothing is delayed."""
    wave = np.sin(2.0 * np.pi * frequency * np.arange(1200) / 120.0)
    filtered = low_pass(np.stack([wave, -2.0 * wave], axis=1), 120.0, 6.0)
    middle = slice(200, -200)
    np.testing.assert_allclose(filtered[middle, 0], kept * wave[middle], atol=0.01)
    np.testing.assert_allclose(filtered[:, 1], -2.0 * filtered[:, 0], atol=1e-9)


def test_what_cannot_be_filtered_is_returned():
    values = np.random.default_rng(0).random((15, 2))
    assert low_pass(values, 120.0, 6.0) is values
    long = np.tile(values, (9, 1))
    assert low_pass(long, 12.0, 6.0) is long and low_pass(long, 20.0, 6.0) is not long


def test_a_low_pass_keeps_a_spin_of_many_turns():
    spin = Rotation.from_rotvec(np.linspace(0, 6 * np.pi, 240)[:, None] * [0.0, 0.0, 1.0])
    soft = Rotation.from_quat(low_pass_rotations(spin.as_quat(), 120.0, 6.0))
    assert (soft.inv() * spin).magnitude()[30:-30].max() < 1e-3


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_a_low_pass_does_not_depend_on_signs_or_on_the_frame(seed):
    random = np.random.default_rng(seed)
    path = Rotation.from_rotvec(np.cumsum(random.normal(scale=0.1, size=(80, 3)), axis=0))
    left, right = Rotation.random(2, random_state=seed)
    signs = random.choice([-1.0, 1.0], size=(80, 1))
    filtered = Rotation.from_quat(low_pass_rotations(path.as_quat() * signs, 120.0, 6.0))
    turned = Rotation.from_quat(low_pass_rotations((left * path * right).as_quat(), 120.0, 6.0))
    assert (turned.inv() * (left * filtered * right)).magnitude().max() < 1e-6


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 1000), st.integers(1, 40))
def test_continuous(seed, frames):
    """The same rotations, each with the sign that is nearer; the first keeps its own."""
    random = np.random.default_rng(seed)
    quaternions = random.normal(size=(frames, 3, 4))
    signs = random.choice([-1.0, 1.0], size=(frames, 3, 1))
    out = continuous(quaternions * signs)
    np.testing.assert_array_equal(out[0], quaternions[0] * signs[0])
    np.testing.assert_array_equal(np.abs(out), np.abs(quaternions))
    products = [q[..., :, None] * q[..., None, :] for q in (out, quaternions)]
    np.testing.assert_array_equal(*products)
    near, far = (np.linalg.norm(out[1:] - s * out[:-1], axis=-1) for s in (1.0, -1.0))
    assert (near <= far).all()


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 1000), st.integers(2, 6), st.lists(st.floats(-1, 7), min_size=1, max_size=8))
def test_interpolation(seed, frames, at):
    """Lines as NumPy's, rotations as SciPy's; beyond the ends the ends stay."""
    at, known = np.array(at), np.arange(frames)
    inside = np.clip(at, 0.0, frames - 1.0)
    values = np.random.default_rng(seed).normal(size=(frames, 2, 3))
    lines = interpolate_lines(values, at)
    for i, j in np.ndindex(2, 3):
        np.testing.assert_allclose(lines[:, i, j], np.interp(at, known, values[:, i, j]), atol=1e-12)
    turns = Rotation.random(2 * frames, random_state=seed).as_quat().reshape(frames, 2, 4)
    between = interpolate_rotations(turns, at)
    for i in range(2):
        expected = Slerp(known, Rotation.from_quat(turns[:, i]))(inside)
        apart = (Rotation.from_quat(between[:, i]).inv() * expected).magnitude()
        assert apart.max() < 1e-7


def test_interpolation_is_a_geodesic_whatever_the_signs():
    ends = Rotation.from_rotvec([[0.0, 0.0, 0.2], [0.0, 0.0, 1.4]]).as_quat()
    for sign in (1.0, -1.0):
        between = interpolate_rotations(np.stack([ends[0], sign * ends[1]]), np.array([0.25]))
        assert np.allclose(Rotation.from_quat(between).as_rotvec(), [[0.0, 0.0, 0.5]])


def test_one_frame_is_everywhere():
    assert interpolate_lines(np.array([[3.0]]), np.array([-1.0, 0.0, 2.0])).tolist() == [[3.0]] * 3
