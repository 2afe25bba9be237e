"""Values over time: stretches in which something holds, filters, what lies between two frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation


def runs(holds: ArrayLike, join: int = 0, shortest: int = 1) -> list[tuple[int, int]]:
    """First and last index of each stretch of true values (n,). Stretches parted by `join` or fewer false
    ones are one; those of fewer than `shortest` values are left out."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], np.asarray(holds, bool), [False]])))
    found: list[tuple[int, int]] = []
    for first, stop in edges.reshape(-1, 2).tolist():
        if found and first - found[-1][1] - 1 <= join:
            first = found.pop()[0]
        found.append((first, stop - 1))
    return [(first, last) for first, last in found if last - first + 1 >= shortest]


def smoothstep(share: np.ndarray) -> np.ndarray:
    """From 0 to 1 as `share` goes from 0 to 1, at rest at both ends."""
    return share**2 * (3.0 - 2.0 * share)


def speed(path: np.ndarray, rate: float) -> np.ndarray:
    """Speed (frames,) [m/s] along a path (frames, n) [m] at `rate` [Hz]."""
    if len(path) < 2:
        return np.zeros(len(path))
    return np.linalg.norm(np.gradient(path, axis=0), axis=1) * rate


def low_pass(values: np.ndarray, rate: float, cut_off: float) -> np.ndarray:
    """Butterworth low-pass below `cut_off` [Hz] of values (frames, ...) at `rate` [Hz], forward and backward
    so that nothing is delayed; what is too short or too slow to filter is returned as it is."""
    if len(values) < 16 or cut_off >= 0.45 * rate:
        return values
    from scipy.signal import butter, sosfiltfilt  # a second to import, which not every command needs

    return sosfiltfilt(butter(2, cut_off, fs=rate, output="sos"), values, axis=0)


def continuous(quaternions: np.ndarray) -> np.ndarray:
    """Quaternions (frames, ..., 4) with the sign that makes each the nearer one to the one before."""
    along = np.sum(quaternions[1:] * quaternions[:-1], axis=-1)
    sign = np.cumprod(np.where(along < 0.0, -1.0, 1.0), axis=0)
    return np.concatenate([quaternions[:1], quaternions[1:] * sign[..., None]])


def low_pass_rotations(quaternions: np.ndarray, rate: float, cut_off: float) -> np.ndarray:
    """The same for unit quaternions (frames, ..., 4): filtered with continuous signs in the four dimensions
    they live in, and put back on the sphere, so that any number of turns stays what it is."""
    if not quaternions.size:
        return quaternions
    filtered = low_pass(continuous(quaternions), rate, cut_off)
    return filtered / np.linalg.norm(filtered, axis=-1, keepdims=True)


def interpolate_lines(values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Linear interpolation of values (frames, ...) at fractional frame numbers `at` (n,)."""
    low, share = _bracket(len(values), at)
    share = share.reshape(-1, *(1,) * (values.ndim - 1))
    high = np.minimum(low + 1, len(values) - 1)
    return values[low] + share * (values[high] - values[low])


def interpolate_rotations(quaternions: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Geodesic interpolation of quaternions (frames, ..., 4) xyzw at fractional frame numbers `at` (n,)."""
    low, share = _bracket(len(quaternions), at)
    high = np.minimum(low + 1, len(quaternions) - 1)
    shape = (len(at), *quaternions.shape[1:])
    start = Rotation.from_quat(quaternions[low].reshape(-1, 4))
    turn = (start.inv() * Rotation.from_quat(quaternions[high].reshape(-1, 4))).as_rotvec()
    turn = turn.reshape(*shape[:-1], 3) * share.reshape(-1, *(1,) * (len(shape) - 1))
    return (start * Rotation.from_rotvec(turn.reshape(-1, 3))).as_quat().reshape(shape)


def _bracket(frames: int, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    at = np.clip(np.asarray(at, dtype=float), 0.0, frames - 1.0)
    low = np.minimum(at.astype(int), max(frames - 2, 0))
    return low, at - low
