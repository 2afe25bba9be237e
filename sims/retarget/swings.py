"""The path of a foot that stands where it stands and swings as recorded, without a jerk where one becomes the
other, and clear of the ground.

Between stands the ball of the foot rises as the recorded one does over where it stood, so that feet of other
lengths clear the ground alike; higher up the ankle does. What is moving clears the ground by CLEAR: first by
toes that bend back, then by the whole foot.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter1d, maximum_filter1d
from scipy.spatial.transform import Rotation

from ..signals import continuous, smoothstep
from .easing import eased
from .planting import Stand, Tread, standing, standing_foot
from .sole import Foot, heading, lowest

OVER, UP, TURN, TOES = 0.04, 0.015, 0.02, 0.012
"""[s] over which a foot comes to a stand, and leaves it: over the ground, upward, turning, its toes."""
HIGH = 0.2
"""[m] From the ground up to this, the ankle's height counts more and more, the ball's less and less."""
FLATTER = np.radians(10.0)
"""By which toes that are up are lowered at most, rather than the foot lifted off its heel."""
CLEAR, RISE = 0.01, 0.03
"""[m] by which a foot that moves clears the ground, at the latest so many [s] after it stood."""


def swinging(
    foot: Foot, tread: Tread, stands: list[Stand], timestep: float
) -> tuple[np.ndarray, Rotation, np.ndarray]:
    """The foot's path with its stands: ankle (frames, 3) [m], rotation (frames,), toe joint angle (frames,)
    [rad]. Toes are flat on the ground while the foot stands, and as recorded between."""
    frames = len(tread.ankle)
    if not stands:
        return tread.ankle, tread.turn, tread.toes
    tread, stands = _heel_within(foot, tread, stands, timestep)
    stood = standing(stands, frames)
    like = continuous(tread.turn.as_quat())
    ankle, quat, toes = tread.ankle.copy(), like.copy(), tread.toes.copy()
    for stand in stands:
        ankle[stand.rows], turn = standing_foot(foot, stand)
        own = turn.as_quat()
        far = np.sum(own * like[stand.rows], axis=1, keepdims=True) < 0.0
        quat[stand.rows] = np.where(far, -own, own)
        toes[stand.rows] = -np.maximum(stand.pitch, 0.0)
    turn = Rotation.from_quat(eased(quat, like, stood, TURN / timestep))
    path = _ball(foot, tread, stands, stood, ankle, turn, timestep)
    lift = np.zeros(frames)
    away = distance_transform_edt(~stood) * timestep
    clear = CLEAR * smoothstep(np.clip(away / RISE, 0.0, 1.0))
    pitch, length = heading(turn)[1], max(float(np.linalg.norm(foot.tips.mean(axis=0))), 1e-3)
    for _ in range(2):
        # the tip of the toes is as high as the ball less length sin(pitch + toes)
        high = path[:, 2] + lift - foot.drop - clear
        most = np.arcsin(np.clip(high / length, -1.0, 1.0)) - pitch
        bent = np.where(stood, toes, np.minimum(tread.toes, most))
        bent = eased(bent[:, None], tread.toes[:, None], stood, TOES / timestep)[:, 0]
        place = path - turn.apply(foot.ball)
        short = np.where(stood, 0.0, np.maximum(clear - lowest(foot, place, turn, bent), 0.0))
        short = np.where(stood, 0.0, maximum_filter1d(short, 2 * round(UP / timestep) + 1))
        lift = eased(short[:, None], np.zeros((frames, 1)), stood, UP / timestep)[:, 0]
    place[:, 2] += lift
    return place, turn, bent


def _heel_within(foot: Foot, tread: Tread, stands: list[Stand], timestep: float) -> tuple[Tread, list[Stand]]:
    """The same with toes that are up only as far as leaves room for the heel, whose edge is farther back than
    a recorded heel's round: under a ball as high as recorded. By FLATTER at most."""
    known, floor = [], []
    for stand in stands:
        flat = tread.ball[stand.rows][stand.pitch >= 0.0]
        if len(flat):
            known.append((stand.first + stand.last) // 2)
            floor.append([np.median(flat)])
    if not known:
        return tread, stands
    rows = np.arange(len(tread.ball))
    over = tread.ball - _between(np.array(known), np.array(floor), rows)[:, 0]
    over = over - np.where(standing(stands, len(rows)), 0.0, CLEAR)
    least = -np.arcsin(np.clip(over / (foot.ball - foot.heel)[0], 0.0, 1.0))
    least = gaussian_filter1d(least, TURN / timestep, mode="nearest")
    by = gaussian_filter1d(_short(heading(tread.turn)[1], least), TURN / timestep, mode="nearest")
    turn = tread.turn * Rotation.from_euler("y", by[:, None])
    lower = [replace(s, pitch=s.pitch + _short(s.pitch, least[s.rows])) for s in stands]
    return replace(tread, turn=turn), lower


def _short(pitch: np.ndarray, least: np.ndarray) -> np.ndarray:
    """[rad] by which toes that are up (pitch below 0) come down to `least` (below 0)."""
    return np.clip(least - np.minimum(pitch, 0.0), 0.0, FLATTER) * (pitch < 0.0)


def _ball(
    foot: Foot,
    tread: Tread,
    stands: list[Stand],
    stood: np.ndarray,
    ankle: np.ndarray,
    turn: Rotation,
    timestep: float,
) -> np.ndarray:
    """Path (frames, 3) [m] of the toe joint. ankle, turn: the foot's where it stands; turn also between."""
    rows = np.arange(len(ankle))
    stand_at = ankle + turn.apply(foot.ball)
    like = tread.ankle + tread.turn.apply(foot.ball)
    ends = np.concatenate([[s.first, s.last] for s in stands])
    like[:, :2] += _between(ends, (stand_at - like)[ends, :2], rows)
    over = [[np.median(a[s.rows] - b[s.rows]) for a, b in
             ((stand_at[:, 2], tread.ball), (ankle[:, 2], tread.ankle[:, 2]))] for s in stands]  # fmt: skip
    level = _between(np.array([(s.first + s.last) // 2 for s in stands]), np.array(over), rows)
    by_ball = tread.ball + level[:, 0]
    by_ankle = tread.ankle[:, 2] + level[:, 1] + turn.apply(foot.ball)[:, 2]
    share = smoothstep(np.clip((by_ball - foot.drop) / HIGH, 0.0, 1.0))
    like[:, 2] = by_ball + share * (by_ankle - by_ball)
    wanted = np.where(stood[:, None], stand_at, like)
    over_ground = eased(wanted[:, :2], like[:, :2], stood, OVER / timestep)
    return np.column_stack([over_ground, eased(wanted[:, 2:], like[:, 2:], stood, UP / timestep)])


def _between(known: np.ndarray, values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Values (n, k) known at rows `known`, rising, eased over from one to the next at `rows`."""
    after = np.clip(np.searchsorted(known, rows), 0, len(known) - 1)
    before = np.clip(after - (known[after] > rows), 0, len(known) - 1)
    gap = np.maximum(known[after] - known[before], 1)
    share = smoothstep(np.clip((rows - known[before]) / gap, 0.0, 1.0))[:, None]
    return values[before] + share * (values[after] - values[before])
