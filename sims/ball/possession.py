"""When the hands have the ball, told from the hands' motion alone (the set H of P1 5.1).

Two things show. Palms that face each other a ball apart hold one between them. And a dribbling hand pushes:
no arm that merely swings goes down as fast, palm down, for a ball that is not pushed does not come back. The
ball leaves the hand just after the hand's fastest moment, falls, bounces and is met by the hand that pushes
next. The thresholds were chosen on BallPlay-M's clips beside CMU's, on the motion of the player.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d

from ..signals import runs
from .flight import BOUNCE, GRAVITY, Bounce
from .hands import SMOOTH, Hands

PUSH = 1.3
"""[m/s] A hand that pushes the ball goes down at least this fast ..."""
RETURN = 0.87
"""[-] ... which brings the ball back to this share of the height of the push; it leaves the hand lower."""
PALM_DOWN, LOW = (-0.58, 0.2), 0.65
"""[-] Most that the palm's normal looks up, over and under a height of LOW [m]: low dribbles come from the
side, arms that swing have their palms to the body."""
STROKE = 0.24
"""[m] A dribbling hand goes up and down by at least this."""
APART = 0.22
"""[s] Pushes are at least so far apart."""
FLICK = 1.4
"""[-] The wrist and fingers make the ball this much faster than the palm."""
LEAVES = 0.055
"""[s] after the palm's fastest moment the fingers let the ball go."""
RISES = 0.06
"""[m] by which a hand comes up again after a push."""
LONGEST = 1.2
"""[s] of a flight from hand to hand."""
REACHES = 0.06
"""[m] Fingers reach down to the ball by this."""
CLOSE, NEARLY, OPEN = 0.22, 0.28, 0.32
"""[m] A ball is taken between two hands when the centres it would have at each come nearer than the first, or
than the second and rest, and let go when they part by more than the third."""
CLOSING, STILL = 0.5, 0.15
"""[m/s] Hands that come together faster than the first have no ball between them yet; hands that stay apart
as they are, within the second, have one although they are not quite as near."""
SHORTEST = 0.15
"""[s] Hands that pass each other are near for less than this."""
THROW = 1.8
"""[m/s] A hand that goes up this fast, above the shoulder, throws."""


@dataclass(frozen=True)
class Flight:
    """The ball on its way over the ground from one hand to the same or the other."""

    release: int
    """Row at which it leaves ..."""
    catch: int
    """... and is met; the row after the last when that lies beyond the clip."""
    hand: int
    next_hand: int


@dataclass(frozen=True)
class Possession:
    touch: np.ndarray
    """(frames, 2) bool: the left, the right hand has the ball."""
    flights: tuple[Flight, ...]


def infer(hands: Hands) -> Possession:
    """Who has the ball when. With nothing to show that there is a ball, nobody does."""
    both = between_hands(hands)
    touch = np.repeat(both[:, None], 2, axis=1)
    flights: list[Flight] = []
    for first, last in runs(~both):
        flights += _without_both(hands, touch, first, last + 1)
    return Possession(touch, tuple(flights))


def _without_both(hands: Hands, touch: np.ndarray, begin: int, end: int) -> list[Flight]:
    """One stretch of rows, begin to end - 1, in which no two hands hold the ball: fills touch, and returns
    the flights in it."""
    frames = len(touch)
    pushed = find_pushes(hands, begin, end)
    flights: list[Flight] = []
    if pushed:
        hand, start = pushed[0][1], begin
    elif begin == 0 or (end == frames and not _throw(hands, begin, end, _higher(hands, begin))):
        return []
    else:
        hand, start = _higher(hands, begin), begin
    for push, after in zip(pushed, [*pushed[1:], None]):
        thrown = _throw(hands, start, push[0], hand)
        if thrown:
            touch[start:thrown, hand] = True
            return flights
        flight = _flight(hands, push, after, end)
        touch[start : flight.release, hand] = True
        flights.append(flight)
        start, hand = flight.catch, flight.next_hand
    touch[start : _throw(hands, start, end, hand) or end, hand] = True
    return flights


def _higher(hands: Hands, row: int) -> int:
    """The hand that keeps the ball when two hands part at a row: the one whose palm looks up more."""
    return int(np.argmax(hands.normal[row, :, 2]))


def _throw(hands: Hands, begin: int, end: int, hand: int) -> int:
    """Row at which a hand that has the ball from `begin` throws it before `end`; 0 when it does not."""
    part = slice(begin, end)
    up, high = hands.velocity[part, hand, 2], hands.centre[part, hand, 2] > hands.shoulder[part, hand]
    fast = runs((up > THROW) & high)
    if not fast:
        return 0
    first, last = fast[-1]
    return min(end, begin + first + int(np.argmax(up[first : last + 1])) + round(LEAVES / hands.timestep))


def between_hands(hands: Hands) -> np.ndarray:
    """(frames,) bool: a ball is held between both hands."""
    apart = hands.centre[:, 0] - hands.centre[:, 1]
    gap = np.linalg.norm(apart, axis=1)
    rate = np.gradient(gaussian_filter1d(gap, SMOOTH / hands.timestep, mode="nearest"), hands.timestep)
    near = (gap < CLOSE) & (rate > -CLOSING) | (gap < NEARLY) & (np.abs(rate) < STILL)
    out, held = np.zeros(len(gap), bool), False
    for row in range(len(gap)):
        held = gap[row] < OPEN if held else near[row]
        out[row] = held
    for first, last in runs(out):
        thrown = [_throw(hands, first, last + 1, hand) for hand in (0, 1)]
        end = max(thrown) if all(thrown) else last + 1
        out[first : last + 1] = last - first > SHORTEST / hands.timestep
        out[end : last + 1] = False
    return out


def find_pushes(hands: Hands, begin: int, end: int) -> list[tuple[int, int]]:
    """(row, hand) of every push from row `begin` to `end` - 1, in order: a hand's fastest moment on its way
    down, with the palm down and so fast that a ball would come back."""
    found = []
    for hand in (0, 1):
        down, height = -hands.velocity[:, hand, 2], hands.centre[:, hand, 2]
        apex = np.zeros(len(down), bool)
        apex[1:-1] = (down[1:-1] >= down[:-2]) & (down[1:-1] > down[2:])
        fall = np.maximum(height - hands.radius, 0.0)
        rises = BOUNCE**2 * ((FLICK * down) ** 2 / (2.0 * GRAVITY) + fall)
        good = apex & (down > PUSH) & (rises > RETURN * fall) & (height > hands.radius)
        tilt = np.where(height > LOW, *PALM_DOWN)
        good &= (hands.normal[:, hand, 2] < tilt) & (height < hands.shoulder[:, hand])
        good &= -hands.velocity[:, 1 - hand, 2] < 0.8 * down
        good &= _comes_up_again(height, round(0.5 / hands.timestep))
        window = 2 * round(0.6 / hands.timestep) + 1
        good &= maximum_filter1d(height, window) - minimum_filter1d(height, window) > STROKE
        found += [(int(row), hand, down[row]) for row in np.flatnonzero(good) if begin <= row < end]
    kept: list[tuple[int, int]] = []
    for row, hand, _ in sorted(found, key=lambda push: -push[2]):
        if all(abs(row - r) * hands.timestep >= APART for r, _ in kept):
            kept.append((row, hand))
    return sorted(kept)


def _comes_up_again(height: np.ndarray, rows: int) -> np.ndarray:
    """(frames,) bool: within so many rows the hand rises from where it was lowest, or the clip ends."""
    out = np.ones(len(height), bool)
    for row in range(len(height) - rows):
        after = height[row : row + rows]
        lowest = int(np.argmin(after))
        out[row] = after[lowest:].max() - after[lowest] > RISES
    return out


def _flight(hands: Hands, push: tuple[int, int], after: tuple[int, int] | None, end: int) -> Flight:
    """The ball from a push to where the hand that pushes next meets it; without one, the hand that comes
    nearer."""
    row, hand = push
    release = min(row + round(LEAVES / hands.timestep), end)
    last = min(end if after is None else after[0], row + round(LONGEST / hands.timestep))
    ways = []
    for other in (hand, 1 - hand) if after is None else (after[1],):
        catch = _meets(hands, row, hand, other, release, last)
        across = hands.centre[min(catch, end - 1), other] - hands.centre[row, hand]
        across = across[:2] - hands.velocity[row, hand, :2] * (catch - row) * hands.timestep
        ways.append((float(np.linalg.norm(across)), Flight(release, catch, hand, other)))
    return min(ways, key=lambda way: way[0])[1]


def _meets(hands: Hands, row: int, hand: int, other: int, release: int, last: int) -> int:
    """First row, up to `last`, at which the bounced ball is as high as the hand that catches it; where it
    seems to pass below, the one at which that hand comes up fastest."""
    bounce = Bounce(hands.centre[row, hand, 2], -FLICK * hands.velocity[row, hand, 2], hands.radius)
    first = max(release + 2, row + round(bounce.down / hands.timestep))
    rows = np.arange(first, last)
    if not len(rows):
        return int(last)
    ball = bounce.at((rows - row) * hands.timestep)
    met = np.flatnonzero(ball > hands.centre[rows, other, 2] - REACHES)
    if len(met):
        return int(rows[met[0]])
    up = hands.velocity[rows, other, 2]
    return int(rows[np.argmax(up)]) if up.max() > 0.5 else int(last)
