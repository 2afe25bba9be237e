"""When each foot of a recording is on the ground, and how it stands there.

A standing foot has one place and one heading. All it may do there is roll: about its heel while the toes
are up, about the ball of the foot, its toe joint, while the heel is up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, median_filter
from scipy.spatial.transform import Rotation

from ..signals import runs
from .sole import Foot, heading, sole_heights

SLOW = 0.4
"""[m/s] A point of the sole that stands is slower than this ..."""
NEAR = 0.045
"""[m] ... and lower than this."""
SHORTEST = 0.05
"""[s] of a stand; shorter ones, and gaps as short, are noise."""
QUIET = (0.1, 0.2, SLOW)
"""[m/s] A foot is flat where heel and ball are both slower than this; the first that any row is."""
TURNING = np.radians(20.0)
"""A foot that turns further while it stands pivots on its ball."""
SOFT = 0.02
"""[s] by which rolling is smoothed."""
FLAT = 0.05
"""[rad] A standing foot that is pitched less than this is nearly flat."""
HURRY = 2.0
"""[m/s^2] The way from one stand to the next takes at least the root of it over this ..."""
LONGEST = 0.16
"""[s] ... but no longer than this is taken off the stands for it."""


@dataclass(frozen=True)
class Tread:
    """A foot as it was recorded, on the model and its scale, the ground at 0."""

    ankle: np.ndarray
    """(frames, 3) [m]"""
    turn: Rotation
    """(frames,) of the foot."""
    ball: np.ndarray
    """(frames,) [m] height of the toe joint."""
    toes: np.ndarray
    """(frames,) [rad] angle of the toe joint."""

    def above(self, ground: np.ndarray) -> Tread:
        """The same over a ground at heights (frames,) [m], which is brought to 0."""
        up = ground[:, None] * [0.0, 0.0, 1.0]
        return replace(self, ankle=self.ankle - up, ball=self.ball - ground)

    def levelled(self, foot: Foot, timestep: float) -> Tread:
        """The same less the pitch and the angle of the toes that it shows where it stands flat, as recorded
        feet are seldom level there."""
        for slow in QUIET:
            flat = _touching(foot, self.ankle, self.turn, timestep, slow, np.inf).all(axis=0)
            if flat.sum() * timestep > SHORTEST:
                pitch = np.clip(np.median(heading(self.turn)[1][flat]), -0.25, 0.25)
                toes = np.clip(np.median(self.toes[flat]), -0.5, 0.5)
                level = self.turn * Rotation.from_euler("y", -pitch)
                return replace(self, turn=level, toes=self.toes - toes)
        return self


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

    @property
    def rows(self) -> slice:
        return slice(self.first, self.last + 1)

    def raised(self, by: np.ndarray, timestep: float) -> Stand:
        """With the heel higher by angles (frames,) [rad], smoothed so that it is nowhere lower."""
        rows = 2 * round(0.1 / timestep) + 1
        up = gaussian_filter1d(
            maximum_filter1d(by[self.rows], rows, mode="nearest"), rows / 4.0, mode="nearest"
        )
        return replace(self, pitch=self.pitch + up)

    def shortened(self, start: int, end: int) -> Stand:
        """Without that many rows at its start and end, half of it at most."""
        most = (self.last - self.first) // 2
        start, end = min(start, most), min(end, most)
        part = slice(start, len(self.yaw) - end)
        return Stand(self.first + start, self.last - end, self.place, self.yaw[part], self.pitch[part])


def find_stands(foot: Foot, tread: Tread, timestep: float) -> list[Stand]:
    """When and where a foot stands, with time between the stands for the ways between them."""
    heel, ball = _touching(foot, tread.ankle, tread.turn, timestep)
    yaw, pitch = heading(tread.turn)
    flat = heel & ball
    toe = (tread.ankle + tread.turn.apply(foot.ball))[:, :2]
    stands: list[Stand] = []
    for first, last in runs(heel | ball, shortest=max(2, round(SHORTEST / timestep))):
        part = slice(first, last + 1)
        best = next(m for m in (flat[part], ball[part], heel[part]) if m.any())
        facing = np.unwrap(yaw[part])
        soft = gaussian_filter1d(facing, 0.05 / timestep, mode="nearest")
        rolled = gaussian_filter1d(pitch[part], SOFT / timestep, mode="nearest")
        if np.ptp(soft) > TURNING:
            rolled = np.maximum(rolled, 0.0)
        else:
            soft = np.full(len(soft), facing[best].mean())
        # a small pitch is noise: nearly none is left of it, and nearly all of a large one, without a corner
        rolled = rolled**3 / (rolled**2 + FLAT**2)
        stand = Stand(first, last, toe[part][best].mean(axis=0), soft, rolled)
        if stands:
            way = float(np.linalg.norm(stand.place - stands[-1].place))
            needed = min(np.sqrt(way / HURRY), LONGEST) / timestep
            cut = max(0, int(np.ceil((needed - (first - stands[-1].last - 1)) / 2.0)))
            stands[-1], stand = stands[-1].shortened(0, cut), stand.shortened(cut, 0)
        stands.append(stand)
    return stands


def standing(stands: list[Stand], frames: int) -> np.ndarray:
    """(frames,) bool: the foot stands."""
    stood = np.zeros(frames, bool)
    for stand in stands:
        stood[stand.rows] = True
    return stood


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


def _touching(
    foot: Foot, ankle: np.ndarray, turn: Rotation, timestep: float, slow: float = SLOW, near: float = NEAR
) -> np.ndarray:
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
        touch = (speed < slow) & (heights[:, i] < near)
        out.append(median_filter(touch.astype(int), window, mode="nearest") > 0)
    return np.array(out)
