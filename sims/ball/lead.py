"""Hands led to a ball that moves as balls do.

A ball that is told from the hands' motion alone is where their palms are, and no palm can pull. Where a
recorded hand would have to (wrists that markers do not show, a person of another size, a release that is a
few hundredths of a second off), no controller can follow both. So the ball's way is found first (`chain`),
and the arms are solved for palms that lie on it and face the way in which they push.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from ..model import Model, pose
from ..planar import over_ground
from ..reference.reference import Cycle, Reference
from ..retarget.reach import reach
from ..signals import smoothstep
from .ball import Ball
from .chain import SHORTEST, Carried, Chain, clip_links, cycle_links
from .hands import Hands, find_hands

EARLY = 0.04
"""[s] before it is told does a hand let go of the ball: by then it is slow, and the arm nearly straight."""
RESTITUTION = 0.75
"""[-] on which the ball's way counts. The simulated one's is higher: what comes higher than the hand can be
pushed down, of what comes lower nothing can be made."""
EASE = 0.14
"""[s] before and after it has the ball in which a hand comes from where it was recorded, and goes back."""
BRAKE = 0.05
"""[s] in which it loses the speed that it has more than the recorded one."""
SMOOTH = 0.03
"""[s] over which a palm's turn is smoothed."""
BENT, STRETCHED = 0.95, 0.985
"""[-] of its length to which an arm is stretched easily, and at most; the elbow of a straight one snaps."""
FAR, ASIDE = 0.35, 1.05
"""[m], [rad] Hands that would have to be led farther hardly have the ball when it is said that they do."""
HERE = np.zeros(2)
"""What vectors are turned about."""
SLIGHT, TURNED = 0.02, 0.2
"""[m], [rad] Hands that are so near to where they would be led stay as they are."""


def led(
    model: Model, cycle: Cycle, ball: Ball, early: float = EARLY, restitution: float = RESTITUTION
) -> tuple[Cycle, Ball, str] | None:
    """The cycle with its hands led to the ball, that ball, and a note on it; None where hands are right as
    they are, both have the ball at once, or no ball moves so. early: [s] by which a hand lets go before it is
    told to."""
    hands = find_hands(model, cycle.repeat(model, 3))
    count = cycle.reference.frame_count - 1
    ball = _let_go_early(ball, round(early / hands.timestep), count)
    flights = sorted(ball.flights, key=lambda way: way.release)
    links = cycle_links(hands, cycle, flights, model)
    found = None if links is None else _lead(hands, Chain(hands, links, restitution))
    if found is None:
        return None
    path, shift, turn = np.empty((count + 1, 3)), *np.zeros((2, count + 1, 2, 3))
    for rows, places in found.path:
        for cycles in np.unique(rows // count):
            now = rows // count == cycles
            path[rows[now] % count] = _back(model, cycle, places[now], int(cycles))
    for hand, rows, *vectors in found.hands:
        for cycles in np.unique(rows // count):
            now = rows // count == cycles
            for out, own in zip((shift, turn), vectors):
                out[rows[now] % count, hand] += over_ground(own[now], HERE, HERE, -cycle.turn * cycles)
    path[-1] = cycle.ahead(model, path[:1])[0]
    for out in (shift, turn):
        out[-1] = over_ground(out[0], HERE, HERE, cycle.turn)
    joint_q = place_hands(model, cycle.reference.joint_q, shift, turn)
    reference = replace(cycle.reference, joint_q=joint_q)
    return replace(cycle, reference=reference), _along(ball, path), found.note


def led_once(
    model: Model, reference: Reference, ball: Ball, early: float = EARLY, restitution: float = RESTITUTION
) -> tuple[Reference, Ball, str] | None:
    """The same for what happens once; where both hands have the ball, they stay as they are."""
    hands, frames = find_hands(model, reference), reference.frame_count
    ball = _let_go_early(ball, round(early / hands.timestep))
    flights = sorted(ball.flights, key=lambda way: way.release)
    links = clip_links(hands, ball.touch, ball.path, flights)
    found = None if links is None else _lead(hands, Chain(hands, links, restitution))
    if found is None:
        return None
    path, shift, turn = ball.path.copy(), *np.zeros((2, frames, 2, 3))
    for rows, places in found.path:
        path[rows] = places
    for hand, rows, *vectors in found.hands:
        inside = (rows >= 0) & (rows < frames)
        for out, own in zip((shift, turn), vectors):
            out[rows[inside], hand] += own[inside]
    joint_q = place_hands(model, reference.joint_q, shift, turn)
    return replace(reference, joint_q=joint_q), _along(ball, path), found.note


@dataclass(frozen=True)
class Led:
    """What a chain does to ball and hands."""

    path: list[tuple[np.ndarray, np.ndarray]]
    """Rows (n,) and places (n, 3) [m] of the ball."""
    hands: list[tuple[int, np.ndarray, np.ndarray, np.ndarray]]
    """A hand, rows (n,), offsets (n, 3) [m] and turns (n, 3) [rad]."""
    note: str


def _lead(hands: Hands, chain: Chain) -> Led | None:
    """What leads the hands to a chain's ball; None where they are near enough, or no ball moves so."""
    found = chain.solve()
    if found is None:
        return None
    flown, carried = found
    moved, turned = (
        max(float(np.linalg.norm(vectors, axis=1).max()) for vectors in each)
        for each in ([one.shift for one in carried], [one.turn for one in carried])
    )
    if moved < SLIGHT and turned < TURNED:
        return None
    ease = min(EASE, 0.5 * hands.timestep * min(len(way.path) for way in flown))
    by = f"{100 * moved:.0f} cm and {np.degrees(turned):.0f} degrees"
    doubt = ": look whether they have it then" if moved > FAR or turned > ASIDE else ""
    return Led(
        [
            *((np.arange(way.way.release - 1, way.way.catch + 1), way.path) for way in flown),
            *((one.hold.rows, one.path) for one in carried),
        ],
        [(one.hold.hand, *part) for one in carried for part in _eased(one, hands, ease)],
        f"hands led to a ball that can be pushed so, by up to {by}{doubt}",
    )


def _along(ball: Ball, path: np.ndarray) -> Ball:
    """The ball on another way."""
    return replace(ball, path=path, heights=tuple(float(path[row, 2]) for row in ball.checkpoints))


def _let_go_early(ball: Ball, rows: int, count: int | None = None) -> Ball:
    """The same with every flight begun so many rows before. count: rows of a cycle."""
    flights, touch = [], ball.touch.copy()
    for way in ball.flights:
        sooner = np.arange(way.release - rows - SHORTEST, way.release)
        if count is None and (sooner[0] < 0 or not touch[sooner, way.hand].all()):
            flights.append(way)
            continue
        touch[sooner[SHORTEST:] % (count or len(touch)), way.hand] = False
        later = count if count and way.release < rows else 0
        flights.append(replace(way, release=way.release - rows + later, catch=way.catch + later))
    if count:
        touch[-1] = touch[0]
    return replace(ball, touch=touch, flights=tuple(flights))


def place_hands(model: Model, joint_q: np.ndarray, shift: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """joint_q (frames, nq) with the arms solved for hands moved by `shift` (frames, 2, 3) [m],
    with a ball on each, and turned about that ball by `turn` (frames, 2, 3) [rad]."""
    joint_q = joint_q.copy()
    for hand, (palm, elbow) in enumerate(zip(model.roles.both("palms"), model.roles.elbows)):
        if not (shift[:, hand].any() or turn[:, hand].any()):
            continue
        body, place, facing = model.sites[palm]
        before = pose.forward(model, joint_q, [body])[:, body]
        was = Rotation.from_quat(before[:, 3:])
        arm = np.asarray(place) + model.ball_radius * Rotation.from_quat(facing).apply([0.0, 0.0, 1.0])
        centre = before[:, :3] + was.apply(arm) + shift[:, hand]
        now = Rotation.from_rotvec(turn[:, hand]) * was
        reach(model, joint_q, elbow, _within_reach(model, joint_q, elbow, centre - now.apply(arm)), now)
    return joint_q


def _within_reach(model: Model, joint_q: np.ndarray, elbow: str, wrist: np.ndarray) -> np.ndarray:
    """Places (frames, 3) [m] for a wrist, those that would stretch the arm brought nearer to the shoulder."""
    upper = pose.limb_bodies(model, elbow)[0]
    shoulder = pose.forward(model, joint_q, [upper])[:, upper, :3]
    away = np.linalg.norm(wrist - shoulder, axis=1, keepdims=True)
    arm = pose.limb(model, elbow)
    share = away / (np.linalg.norm(arm.upper) + np.linalg.norm(arm.lower))
    room = STRETCHED - BENT
    near = np.where(share > BENT, BENT + room * np.tanh((share - BENT) / room), share)
    return shoulder + (wrist - shoulder) * near / share


def _eased(one: Carried, hands: Hands, ease: float) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Rows, offsets [m] and turns [rad] of a hand while it has the ball, and `ease` [s] after and before."""
    step, rows = hands.timestep, one.hold.rows
    shift, turn = one.shift, gaussian_filter1d(one.turn, SMOOTH / step, axis=0, mode="nearest")
    faster, out = one.velocity - hands.velocity[rows, one.hold.hand], [(rows, shift, turn)]
    since = np.arange(1, round(ease / step))
    times = since[:, None] * step
    share, braked = smoothstep(1.0 - times / ease), times * np.maximum(1.0 - times / BRAKE, 0.0) ** 2
    for sign, end in ((1, -1), (-1, 0)):
        back = share * shift[end] + braked * sign * faster[end]
        out.append((rows[end] + sign * since, back, share * turn[end]))
    return out


def _back(model: Model, cycle: Cycle, points: np.ndarray, cycles: int) -> np.ndarray:
    """Points (n, 3) [m] so many cycles before."""
    for _ in range(abs(cycles)):
        points = cycle.behind(model, points) if cycles > 0 else cycle.ahead(model, points)
    return points
