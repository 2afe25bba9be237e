"""Feet that stay where they stand: when each foot is on the ground, and the path of a foot that then does
not slide, sink or float.

A standing foot has one place and one heading. All it may do there is roll: about its heel while the toes
are up, about the ball of the foot, its toe joint, while the heel is up. Between two stands the foot moves as
recorded, bent at both ends to where it stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter
from scipy.spatial.transform import Rotation

from ..model import Model, gaps
from ..planar import wrapped
from ..signals import runs, smoothstep

SLOW = 0.45
"""[m/s] A point of the sole that stands is slower than this ..."""
NEAR = 0.045
"""[m] ... and lower than this."""
SHORTEST = 0.05
"""[s] of a stand; shorter ones, and gaps as short, are noise."""
TURNING = np.radians(20.0)
"""A foot that turns further while it stands pivots on its ball."""
SOFT = 0.02
"""[s] by which rolling is smoothed."""


@dataclass(frozen=True)
class Foot:
    """The sole of one foot of a model. Points are in the foot's frame [m]."""

    body: int
    toes: int
    toe_joint: str
    heel: np.ndarray
    """(3,) rear edge of the sole."""
    ball: np.ndarray
    """(3,) toe joint."""
    drop: float
    """[m] from the toe joint to the ground under a flat foot."""
    corners: np.ndarray
    """(4, 3) of the sole."""
    tips: np.ndarray
    """(2, 3) middles of the round ends of the toes, in the toes' frame; `drop` is their radius too."""


@dataclass(frozen=True)
class Stand:
    """A foot on the ground, from row `first` to row `last`, both included."""

    first: int
    last: int
    place: np.ndarray
    """(2,) [m] of the toe joint."""
    yaw: np.ndarray
    """(rows,) [rad] heading; one value throughout unless the foot pivots."""
    pitch: np.ndarray
    """(rows,) [rad], positive with the heel up, negative with the toes up."""


def find_foot(model: Model, body: str) -> Foot:
    """The sole of a foot body. Raises ValueError when no toes hang from it or it has no shape."""
    zero = model.zero_pose[None]
    foot = model.body(body)
    toes = model.children(foot)
    boxes = [s for s in model.shapes if s.body == foot]
    if not toes or not boxes:
        raise ValueError(f"the body '{body}' is no foot: it needs a shape, and toes that hang from it")
    bottom = gaps.lowest_point(model, zero, [foot, toes[0]])[0]
    half = boxes[0].size if boxes[0].kind == "box" else np.zeros(3)
    ankle, ball = zero[0, foot, :3], zero[0, toes[0], :3] - zero[0, foot, :3]
    corners = [[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)] * np.array(half[:3]) + boxes[0].pos
    heel = np.array([corners[0, 0], 0.0, bottom - ankle[2]])
    drop = zero[0, toes[0], 2] - bottom
    tips = np.zeros((2, 3))
    for shape in (s for s in model.shapes if s.body == toes[0] and s.kind == "capsule"):
        along = Rotation.from_quat(shape.quat).apply([0.0, 0.0, shape.size[1]])
        tips = np.array([shape.pos - along, shape.pos + along])
    return Foot(foot, toes[0], model.body_joint(toes[0]), heel, ball, drop, corners, tips)


def sole_heights(foot: Foot, ankle: np.ndarray, turn: Rotation) -> np.ndarray:
    """Heights (frames, 2) [m] of the sole at the heel and under the ball, with the foot at ankle (frames,
    3)."""
    heel = ankle[:, 2] + turn.apply(foot.heel)[:, 2]
    return np.stack([heel, ankle[:, 2] + turn.apply(foot.ball)[:, 2] - foot.drop], axis=1)


def find_stands(foot: Foot, ankle: np.ndarray, turn: Rotation, timestep: float) -> list[Stand]:
    """When and where a foot stands. ankle: (frames, 3) [m]; turn: (frames,) of the foot; ground at 0."""
    heel, ball = _touching(foot, ankle, turn, timestep)
    yaw, pitch = heading(turn)
    flat = heel & ball
    pitch = pitch - (np.clip(np.median(pitch[flat]), -0.25, 0.25) if flat.any() else 0.0)
    toe = (ankle + turn.apply(foot.ball))[:, :2]
    stands = []
    for first, last in runs(heel | ball, shortest=max(2, round(SHORTEST / timestep))):
        part = slice(first, last + 1)
        best = next(m for m in (flat[part], ball[part], heel[part]) if m.any())
        facing = np.unwrap(yaw[part])
        soft = gaussian_filter1d(facing, 0.05 / timestep, mode="nearest")
        pivots = np.ptp(soft) > TURNING
        if not pivots:
            soft = np.full(len(soft), facing[best].mean())
        place = toe[part][best].mean(axis=0)
        up = np.maximum(_heel_up(foot, ankle[part], place, soft), 0.0)
        down = 0.0 if pivots else np.minimum(pitch[part], 0.0)
        rolled = np.where(flat[part], 0.0, np.where(ball[part], up, down))
        rolled = gaussian_filter1d(rolled, SOFT / timestep, mode="nearest")
        stands.append(Stand(first, last, place, soft, rolled))
    return stands


def _heel_up(foot: Foot, ankle: np.ndarray, place: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Pitch (rows,) [rad] about the toe joint at place (2,) that brings the foot's ankle nearest to ankle
    (rows, 3) [m]."""
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    back = np.sum((ankle[:, :2] - place) * ahead, axis=1)
    flat = np.arctan2(-foot.ball[2], -foot.ball[0])
    turned = flat - np.arctan2(ankle[:, 2] - foot.drop, back)
    return np.clip(wrapped(turned), -0.5, 1.1)


def standing_foot(foot: Foot, stand: Stand) -> tuple[np.ndarray, Rotation]:
    """Ankle (rows, 3) [m] and rotation (rows,) of a foot that stands; it rolls about heel or ball."""
    count = len(stand.yaw)
    flat = Rotation.from_euler("z", stand.yaw[:, None])
    turn = Rotation.from_euler("ZY", np.stack([stand.yaw, stand.pitch], axis=1))
    joint = np.column_stack([np.tile(stand.place, (count, 1)), np.full(count, foot.drop)])
    on_heel = joint + flat.apply(foot.heel - foot.ball)
    ankle = np.where(
        stand.pitch[:, None] < 0.0, on_heel - turn.apply(foot.heel), joint - turn.apply(foot.ball)
    )
    return ankle, turn


def planted(
    foot: Foot, ankle: np.ndarray, turn: Rotation, stands: list[Stand]
) -> tuple[np.ndarray, Rotation, np.ndarray]:
    """The foot's path with its stands: ankle (frames, 3) [m], rotation (frames,), toe joint angle (frames,)
    [rad]. Toes are flat while the foot stands and bend back between."""
    frames = len(ankle)
    place, quat, toes = ankle.copy(), turn.as_quat(), np.zeros(frames)
    known: list[int] = []
    moved, turned = [], []
    for stand in stands:
        part = slice(stand.first, stand.last + 1)
        place[part], now = standing_foot(foot, stand)
        quat[part] = now.as_quat()
        toes[part] = -np.maximum(stand.pitch, 0.0)
        known += range(stand.first, stand.last + 1)
        moved.append(place[part] - ankle[part])
        turned.append((now * turn[part].inv()).as_rotvec())
    if known:
        free = np.setdiff1d(np.arange(frames), known)
        bend = _between(np.array(known), np.concatenate(moved), free)
        place[free] += bend
        by = Rotation.from_rotvec(_between(np.array(known), np.concatenate(turned), free))
        quat[free] = (by * turn[free]).as_quat()
        toes[free] = _between(np.array(known), toes[known][:, None], free)[:, 0]
    turn = Rotation.from_quat(quat)
    standing = np.isin(np.arange(frames), known)
    place[:, 2] -= np.where(standing, 0.0, np.minimum(_lowest(foot, place, turn, toes), 0.0))
    return place, turn, toes


def _lowest(foot: Foot, ankle: np.ndarray, turn: Rotation, toes: np.ndarray) -> np.ndarray:
    """Height (frames,) [m] of the lowest point of a foot: corners of its sole, tips of its toes."""
    bent = turn * Rotation.from_euler("y", toes[:, None])
    joint = ankle + turn.apply(foot.ball)
    points = [ankle[:, 2] + turn.apply(corner)[:, 2] for corner in foot.corners]
    points += [joint[:, 2] + bent.apply(tip)[:, 2] - foot.drop for tip in foot.tips]
    return np.min(points, axis=0)


def heading(turn: Rotation) -> tuple[np.ndarray, np.ndarray]:
    """Yaw and pitch (frames,) [rad] of a foot: where its toes point, and how far down."""
    forward = turn.apply([1.0, 0.0, 0.0])
    return np.arctan2(forward[:, 1], forward[:, 0]), np.arcsin(np.clip(-forward[:, 2], -1.0, 1.0))


def _touching(foot: Foot, ankle: np.ndarray, turn: Rotation, timestep: float) -> np.ndarray:
    """(2, frames) bool: the heel touches, the ball of the foot touches."""
    heights = sole_heights(foot, ankle, turn)
    window = max(3, round(SHORTEST / timestep))
    out = []
    for i, point in enumerate((foot.heel, foot.ball)):
        path = gaussian_filter1d(ankle + turn.apply(point), 0.015 / timestep, axis=0, mode="nearest")
        if len(path) > 2:
            speed = np.linalg.norm(np.gradient(path, timestep, axis=0), axis=1)
        else:
            speed = np.zeros(len(path))
        touch = (speed < SLOW) & (heights[:, i] < NEAR)
        out.append(median_filter(touch.astype(int), window, mode="nearest") > 0)
    return np.array(out)


def _between(known: np.ndarray, values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Values (n, 3) known at rows `known`, eased over from one to the next at the rows in between."""
    after = np.clip(np.searchsorted(known, rows), 0, len(known) - 1)
    before = np.clip(after - (known[after] > rows), 0, len(known) - 1)
    gap = np.maximum(known[after] - known[before], 1)
    share = smoothstep(np.clip((rows - known[before]) / gap, 0.0, 1.0))[:, None]
    return values[before] + share * (values[after] - values[before])
