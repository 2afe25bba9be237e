"""Parts of a motion that end as they begin: candidates for cyclic clips.

Two frames are alike when the joints are in the same places and on the same way, seen from the person: the
horizontal position and the heading are taken off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, minimum_filter
from scipy.spatial.transform import Rotation

from ..recording.motion import Motion
from .mapping import Mapping, find_mapping

RATE = 60.0
"""[Hz] at which frames are compared."""
AHEAD = 0.08
"""[s] by which a joint's velocity counts beside its place."""
FAR = 0.06
"""[m] A cycle has a frame that is at least this unlike its ends; standing still is none."""
SHARE = 0.4
"""[-] A gap up to this share of what lies between is a gap that can be blended."""
TURNED = 0.5
"""[rad] A change of heading by this counts like twice the gap: a cycle that goes straight is preferred."""


@dataclass(frozen=True)
class Candidate:
    """A range of frames, both included, whose ends are alike."""

    first: int
    last: int
    duration: float
    """[s]"""
    pose_gap: float
    """[m], root mean square over the joints of how far the ends are apart."""
    speed_gap: float
    """[m/s], the same of their velocities."""
    excursion: float
    """[m], root mean square over the joints between the first frame and the one least like it."""
    travel: float
    """[m] over the ground."""
    turn: float
    """[rad] of the heading."""


def find_cycles(
    motion: Motion,
    mapping: Mapping | None = None,
    shortest: float = 0.4,
    longest: float = 2.5,
    most: int = 12,
) -> list[Candidate]:
    """Candidates of `shortest` to `longest` seconds, best first: the smallest gap for what moves in between.

    mapping: which joints count; None takes the shipped one that fits. Raises MappingError (a ValueError).
    """
    mapping = mapping or find_mapping(motion)
    motion = mapping.plain(motion)
    step = max(1, round(motion.rate / RATE))
    places, heading, root = seen_from_person(motion, mapping)
    rate = motion.rate
    speed = np.gradient(gaussian_filter1d(places, 0.02 * rate, axis=0, mode="nearest"), 1.0 / rate, axis=0)
    places, speed = places[::step], speed[::step]
    count = places.shape[1]
    rows = np.concatenate([places, AHEAD * speed], axis=1).reshape(len(places), -1) / np.sqrt(count)
    low, high = (max(1, round(s * rate / step)) for s in (shortest, longest))
    apart = _distances(rows, high)
    likely = _minima(apart, low)
    found = []
    for i, k in likely:
        out = float(apart[i, 1 : k + 1].max())
        if out > FAR and apart[i, k] < SHARE * out:
            turned = abs(float(heading[min((i + k) * step, len(heading) - 1)] - heading[i * step]))
            found.append((apart[i, k] / out * (1.0 + turned / TURNED), i, i + k, out))
    kept: list[tuple[float, int, int, float]] = []
    for one in sorted(found):
        if all(max(abs(one[1] - o[1]), abs(one[2] - o[2])) * step / rate > 0.12 for o in kept):
            kept.append(one)
        if len(kept) == most:
            break
    return [_candidate(places, speed, heading, root, one, step, rate) for one in kept]


def pose_gap(motion: Motion, mapping: Mapping, first: int, last: int) -> float:
    """[m], `Candidate.pose_gap` of the ends of any part. Raises MappingError for joints that are missing."""
    places, _, _ = seen_from_person(mapping.plain(motion), mapping)
    return _rms(places[last] - places[first])


def seen_from_person(motion: Motion, mapping: Mapping) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places (frames, joints, 3) [m] of the mapping's joints without position and heading, the heading
    (frames,) [rad], the root (frames, 2) [m] over the ground."""
    at = motion.places()
    hips = [at[:, motion.index(joints[0])] for joints in mapping.legs.values()]
    across = hips[0] - hips[1]
    heading = np.unwrap(np.arctan2(-across[:, 0], across[:, 1]))
    root = np.mean(hips, axis=0) * [1.0, 1.0, 0.0]
    used = sorted({motion.index(joint) for joint in mapping.joints()})
    back = Rotation.from_euler("z", -heading[:, None])
    places = np.stack([back.apply(at[:, joint] - root) for joint in used], axis=1)
    return places, heading, root[:, :2]


def _distances(rows: np.ndarray, high: int) -> np.ndarray:
    """(frames, high + 1): how far row i is from row i + k; infinite beyond the end."""
    out = np.full((len(rows), high + 1), np.inf)
    for k in range(min(high, len(rows) - 1) + 1):
        out[: len(rows) - k, k] = np.linalg.norm(rows[k:] - rows[: len(rows) - k], axis=1)
    return out


def _minima(apart: np.ndarray, low: int) -> list[tuple[int, int]]:
    """(first row, length) of the places where neither end can be moved a little for a smaller gap."""
    least = minimum_filter(apart, 5, mode="nearest") == apart
    least[:, :low] = False
    return [(int(i), int(k)) for i, k in np.argwhere(least & np.isfinite(apart))]


def _candidate(
    places: np.ndarray,
    speed: np.ndarray,
    heading: np.ndarray,
    root: np.ndarray,
    one: tuple[float, int, int, float],
    step: int,
    rate: float,
) -> Candidate:
    _, i, j, out = one
    first, last = i * step, min(j * step, len(heading) - 1)
    return Candidate(
        first=first,
        last=last,
        duration=(last - first) / rate,
        pose_gap=_rms(places[j] - places[i]),
        speed_gap=_rms(speed[j] - speed[i]),
        excursion=out,
        travel=float(np.linalg.norm(root[last] - root[first])),
        turn=float(heading[last] - heading[first]),
    )


def _rms(vectors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=-1))))
