"""A ball's way through hands that push: how it flies and is carried, nearest to where recorded hands have
it.

Flights are what gravity and the ground make of how a ball leaves a hand. In a hand it may be accelerated as
one likes, but for what that asks of a palm: a force the way it faces, within the friction of skin on leather.
Each hold begins as a flight ends, and ends as the next begins, in a cycle the last as the first of the next
one. Among all ways that fit together, the one is taken that is least off the hands, asks them least to pull,
and is pushed most evenly: nonlinear least squares, linear but for the flights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..model import Model
from ..planar import rotation
from ..reference.reference import Cycle
from ..signals import smoothstep
from .flight import BOUNCE, GRAVITY, GRIP, Bounce, speed_to_meet
from .hands import Hands
from .possession import Flight

NEAR, PULL, EVEN = 0.05, 0.07, 0.5
"""What costs the same: [m] off the recorded hand, [g] of a pull, and [g] by which its force, from knot to
knot, changes more than before."""
HIT, HARDER = 1.0, 0.1
"""[g] A hand that meets a flying ball with more force hits it on; how much more costs the same."""
SOFT = 0.05
"""[g] over which a pull begins to count."""
KNOTS = 0.05
"""[s] between which its acceleration changes evenly."""
CLOSED = 0.001
"""[m], [10 m/s] Ways and speeds that meet so nearly are one."""
FRICTION = 0.7
"""[-] of fingers and palm, up to which a force costs nothing."""
FACING = 0.2
"""[rad] from the force to which a palm is turned: a ball rolls off one that pushes it aside."""
WEAK, LARGEST = 0.4, 1.2
"""[g] A weaker force does not turn the palm, and [rad] by which one turns it at most."""
SHORTEST = 4
"""rows of a hold"""


@dataclass(frozen=True)
class Hold:
    """A hand's time with the ball, n rows from the catch to the last before the release. The ball's way in it
    is told by m = 2 + k points (m, 3): where it comes from [m], how fast [m/s], and how it is accelerated
    [m/s^2] at k moments."""

    hand: int
    comes: int | None
    """The flight that it begins with; None: it begins with the recorded hand."""
    leaves: int | None
    """The flight that it ends with, None for none,"""
    later: bool
    """and whether that is the one of the next cycle."""
    rows: np.ndarray
    """(n,)"""
    begins: np.ndarray
    """(2, 3) place [m] and velocity [m/s] of the recorded hand in the first"""
    centre: np.ndarray
    """(n, 3) [m] where the recorded hand has it"""
    normal: np.ndarray
    """(n, 3) out of its palm"""
    way: np.ndarray
    """(n, m) of the points: the place, ..."""
    speed: np.ndarray
    """... the velocity, ..."""
    push: np.ndarray
    """... the force [g], without what carries its weight, ..."""
    change: np.ndarray
    """(k - 2, m) ... and by how much, from knot to knot, that changes more than before [g]."""
    meets: np.ndarray
    """(r, m) The force [g] at the first two knots after a flight, without what carries its weight."""

    @classmethod
    def of(
        cls,
        hands: Hands,
        hand: int,
        span: tuple[int, int],
        comes: int | None,
        leaves: int | None,
        later: bool = False,
    ) -> Hold:
        """Between two flights or none, of rows first to stop - 1."""
        first, stop = span
        rows, step = np.arange(first, stop), hands.timestep
        times = (rows - first) * step
        knots = np.linspace(0.0, times[-1], max(4, round(times[-1] / KNOTS) + 1))
        shape = np.stack([np.interp(times, knots, unit) for unit in np.eye(len(knots))], axis=1)
        faster = _summed(shape, step)
        one, none = np.ones((len(rows), 1)), np.zeros((len(rows), 2))
        change = np.diff(np.eye(len(knots)), 2, axis=0) / GRAVITY
        meets = np.eye(0 if comes is None else 2, len(knots)) / GRAVITY
        return cls(
            hand,
            comes,
            leaves,
            later,
            rows,
            np.stack([hands.centre[first, hand], hands.velocity[first, hand]]),
            hands.centre[rows, hand],
            hands.normal[rows, hand],
            np.hstack([one, times[:, None], _summed(faster, step)]),
            np.hstack([0.0 * one, one, faster]),
            np.hstack([none, shape / GRAVITY]),
            np.hstack([np.zeros((len(change), 2)), change]),
            np.hstack([np.zeros((len(meets), 2)), meets]),
        )


@dataclass(frozen=True)
class Flown:
    """A flight as it may be: where the ball leaves the hand, and how fast."""

    way: Flight
    place: np.ndarray
    """(3,) [m]"""
    velocity: np.ndarray
    """(3,) [m/s]"""
    radius: float
    """[m]"""
    timestep: float
    """[s]"""
    restitution: float

    @property
    def path(self) -> np.ndarray:
        """(rows, 3) [m] of the ball, from the last row in one hand to the first in the next."""
        bounce, times = self._bounce, np.arange(self.way.catch - self.way.release + 2) * self.timestep
        path = self.place + bounce.along(times)[:, None] * self.velocity
        path[:, 2] = bounce.at(times)
        return path

    @property
    def arrival(self) -> np.ndarray:
        """(2, 3) place [m] and velocity [m/s] in the last of those rows."""
        bounce, lasts = self._bounce, (self.way.catch - self.way.release + 1) * self.timestep
        place = self.place + bounce.along(lasts) * self.velocity
        up = bounce.restitution * bounce.impact - GRAVITY * (lasts - bounce.down)
        return np.array([[*place[:2], bounce.rising(lasts - bounce.down)], [*(GRIP * self.velocity[:2]), up]])

    @property
    def _bounce(self) -> Bounce:
        return Bounce(float(self.place[2]), -float(self.velocity[2]), self.radius, self.restitution)


@dataclass(frozen=True)
class Carried:
    """A hold as it may be."""

    hold: Hold
    points: np.ndarray
    """(m, 3)"""

    @property
    def path(self) -> np.ndarray:
        """(n, 3) [m] of the ball."""
        return self.hold.way @ self.points

    @property
    def velocity(self) -> np.ndarray:
        """(n, 3) [m/s] of the ball."""
        return self.hold.speed @ self.points

    @property
    def force(self) -> np.ndarray:
        """(n, 3) [g] of the hand on it."""
        return self.hold.push @ self.points + [0.0, 0.0, 1.0]

    @property
    def shift(self) -> np.ndarray:
        """(n, 3) [m] of the hand."""
        return self.path - self.hold.centre

    @property
    def turn(self) -> np.ndarray:
        """(n, 3) [rad], rotation vectors, of the palm: as little as it takes for the force to be one that it
        can give."""
        size = np.linalg.norm(self.force, axis=1, keepdims=True)
        axis = np.cross(self.hold.normal, self.force)
        sine = np.linalg.norm(axis, axis=1, keepdims=True)
        off = np.arctan2(sine, np.sum(self.hold.normal * self.force, axis=1, keepdims=True))
        angle = np.clip(off - FACING, 0.0, LARGEST)
        return axis / np.maximum(sine, 1e-9) * angle * smoothstep(np.clip(size / WEAK, 0.0, 1.0))

    def misses(self) -> tuple[np.ndarray, np.ndarray]:
        """What is least in squares (r,): off the hand, pulled, uneven, hit; and its slopes (r, 3 m) over the
        points."""
        hold, three = self.hold, np.eye(3)
        along = np.sum(self.force * hold.normal, axis=1, keepdims=True)
        across = self.force - along * hold.normal
        aside = np.sqrt(np.sum(across**2, axis=1, keepdims=True) + SOFT**2)
        over = aside - FRICTION * along
        root = np.sqrt(over**2 + SOFT**2)
        steep = 0.5 * (1.0 + over / root) * (across / aside - FRICTION * hold.normal)
        met = hold.meets @ self.points + [0.0, 0.0, 1.0]
        size = np.sqrt(np.sum(met**2, axis=1, keepdims=True) + SOFT**2)
        harder = np.maximum(size - HIT, 0.0)
        values = [
            self.shift / NEAR,
            0.5 * (over + root) / PULL,
            hold.change @ self.points / EVEN,
            harder / HARDER,
        ]
        slopes = [
            np.kron(hold.way, three) / NEAR,
            (hold.push[:, :, None] * steep[:, None]).reshape(len(steep), -1) / PULL,
            np.kron(hold.change, three) / EVEN,
            (hold.meets[:, :, None] * ((size > HIT) * met / size)[:, None]).reshape(-1, self.points.size)
            / HARDER,
        ]
        share = [1.0 / np.sqrt(max(len(part), 1)) for part in values]
        return (
            np.concatenate([by * part.ravel() for by, part in zip(share, values)]),
            np.concatenate([by * part for by, part in zip(share, slopes)]),
        )


@dataclass(frozen=True)
class Anchor:
    """Where a flight should begin or end that no single hand begins or ends."""

    flight: int
    ends: bool
    goal: np.ndarray
    """(3,) [m]"""


@dataclass(frozen=True)
class Links:
    """What a ball does in a clip or cycle, in rows of its hands."""

    flights: list[Flight]
    holds: list[Hold]
    anchors: list[Anchor]
    onward: tuple[np.ndarray, np.ndarray] = (np.eye(3), np.zeros(3))
    """(3, 3), (3,) [m] what turns and moves a cycle's places to where they are in the next"""


class Chain:
    """Flights and holds, each of which begins as the one before ends; numbers x of a flight are its place [m]
    and velocity [m/s], those of a hold its accelerations [10 m/s^2]."""

    def __init__(self, hands: Hands, links: Links, restitution: float = BOUNCE):
        self.hands, self.links, self.restitution = hands, links, restitution
        sizes = [6] * len(links.flights) + [3 * (hold.way.shape[1] - 2) for hold in links.holds]
        ends = np.cumsum([0, *sizes])
        self.parts = [slice(a, b) for a, b in pairwise(ends.tolist())]
        start = []
        for way in links.flights:
            lasts = (way.catch - way.release + 1) * hands.timestep
            place, end = hands.centre[way.release - 1, way.hand], hands.centre[way.catch, way.next_hand]
            speed = float(np.nan_to_num(speed_to_meet(place[2], end[2], lasts, hands.radius), nan=3.0))
            start.append(np.array([*place, *(end - place)[:2] / lasts, -speed]))
        for hold in links.holds:
            ridge = 1e-3 * np.eye(hold.way.shape[1])
            goal = np.vstack([hold.centre, 0.0 * ridge[:, :3]])
            start.append(0.1 * np.linalg.lstsq(np.vstack([hold.way, ridge]), goal, rcond=None)[0][2:].ravel())
        self.start = np.concatenate(start)

    def at(self, x: np.ndarray) -> tuple[list[Flown], list[Carried]]:
        """Flights and holds of numbers x."""
        pieces, number = [x[part] for part in self.parts], len(self.links.flights)
        own = self.hands.radius, self.hands.timestep, self.restitution
        flown = [Flown(way, p[:3], p[3:], *own) for way, p in zip(self.links.flights, pieces)]
        carried = []
        for hold, p in zip(self.links.holds, pieces[number:]):
            begins = hold.begins if hold.comes is None else flown[hold.comes].arrival
            carried.append(Carried(hold, np.vstack([begins, 10.0 * p.reshape(-1, 3)])))
        return flown, carried

    def gaps(self, flown: list[Flown], carried: list[Carried]) -> np.ndarray:
        """(6 n,) [m], [10 m/s] from where each of n holds ends to where the flight after it begins."""
        out = [np.zeros(0)]
        for one in carried:
            if one.hold.leaves is not None:
                way = flown[one.hold.leaves]
                turn, move = self.links.onward if one.hold.later else (np.eye(3), np.zeros(3))
                out.append(one.path[-1] - turn @ way.place - move)
                out.append(0.1 * (one.velocity[-1] - turn @ way.velocity))
        return np.concatenate(out)

    def off(self, x: np.ndarray) -> np.ndarray:
        """What is least in squares."""
        flown, carried = self.at(x)
        anchored = [
            ((flown[a.flight].arrival[0] if a.ends else flown[a.flight].place) - a.goal) / NEAR
            for a in self.links.anchors
        ]
        return np.concatenate(
            [self.gaps(flown, carried) / CLOSED, *(c.misses()[0] for c in carried), *anchored]
        )

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """Its derivatives by x."""
        (flown, carried), number = self.at(x), len(self.links.flights)
        comes = [_slopes(way) for way in flown]
        ends, misses, anchored = [np.zeros((0, len(x)))], [], []
        for j, one in enumerate(carried):
            last = np.vstack([one.hold.way[-1:], 0.1 * one.hold.speed[-1:]])
            both = []
            for part in (one.misses()[1], np.kron(last, np.eye(3))):
                full = np.zeros((len(part), len(x)))
                if one.hold.comes is not None:
                    full[:, self.parts[one.hold.comes]] = part[:, :6] @ comes[one.hold.comes]
                full[:, self.parts[number + j]] = 10.0 * part[:, 6:]
                both.append(full)
            misses.append(both[0])
            if one.hold.leaves is not None:
                turn = self.links.onward[0] if one.hold.later else np.eye(3)
                both[1][:, self.parts[one.hold.leaves]] -= np.kron(np.diag([1.0, 0.1]), turn)
                ends.append(both[1])
        for anchor in self.links.anchors:
            full = np.zeros((3, len(x)))
            own = comes[anchor.flight][:3] if anchor.ends else np.eye(3, 6)
            full[:, self.parts[anchor.flight]] = own / NEAR
            anchored.append(full)
        return np.concatenate([np.concatenate(ends) / CLOSED, *misses, *anchored])

    def solve(self) -> tuple[list[Flown], list[Carried]] | None:
        """The flights and holds that fit together, nearest to the recorded hands; None where none do."""
        from scipy.optimize import least_squares  # not every skill needs it

        fit = least_squares(self.off, self.start, self.slopes, method="lm", ftol=1e-4)
        flown, carried = self.at(fit.x)
        return (flown, carried) if np.abs(self.gaps(flown, carried)).max(initial=0.0) < CLOSED else None


def cycle_links(hands: Hands, cycle: Cycle, flights: list[Flight], model: Model) -> Links | None:
    """Of a cycle's flights, in order, the middle ones of three cycles; None where one does not begin with the
    hand in which the one before ended."""
    count, number, holds = cycle.reference.frame_count - 1, len(flights), []
    for i, (way, following) in enumerate(zip(flights, [*flights[1:], *flights[:1]])):
        last = i + 1 == number
        stop = following.release + (count if last else 0)
        if way.next_hand != following.hand or stop - way.catch < SHORTEST or stop > 2 * count:
            return None
        span = (way.catch + count, stop + count)
        holds.append(Hold.of(hands, way.next_hand, span, i, (i + 1) % number, last))
    turn = np.eye(3)
    turn[:2, :2] = rotation(cycle.turn)
    own = [replace(way, release=way.release + count, catch=way.catch + count) for way in flights]
    return Links(own, holds, [], (turn, cycle.ahead(model, np.zeros((1, 3)))[0])) if own else None


def clip_links(hands: Hands, touch: np.ndarray, path: np.ndarray, flights: list[Flight]) -> Links | None:
    """Of a clip's flights, in order, with who has the ball, touch (frames, 2), and its way (frames, 3) [m];
    None for none. Where both hands have it, it stays where it is."""
    flights = [way for way in flights if 0 < way.release < way.catch < len(touch)]
    alone = touch & ~touch[:, ::-1]
    holds, anchors, led_to = [], [], set()
    for i, way in enumerate(flights):
        before = way.release - _length(alone[: way.release, way.hand][::-1])
        comes = (
            i - 1 if i and flights[i - 1].catch == before and flights[i - 1].next_hand == way.hand else None
        )
        if way.release - before < SHORTEST:
            anchors.append(Anchor(i, False, path[way.release - 1]))
        else:
            holds.append(Hold.of(hands, way.hand, (before, way.release), comes, i))
            led_to.add(comes)
    for i, way in enumerate(flights):
        if i not in led_to:
            length = _length(alone[way.catch :, way.next_hand])
            if length < SHORTEST:
                anchors.append(Anchor(i, True, path[way.catch]))
            else:
                holds.append(Hold.of(hands, way.next_hand, (way.catch, way.catch + length), i, None))
    return Links(flights, holds, anchors) if holds else None


def _length(holds: np.ndarray) -> int:
    """How many of the first values (n,) bool are true without a break."""
    return int(np.argmin([*holds, False]))


def _slopes(way: Flown) -> np.ndarray:
    """(6, 6) derivatives of a flight's arrival by its place and velocity."""
    out, near = np.zeros((6, 6)), 1e-6
    for j, small in enumerate(near * np.eye(6)):
        moved = replace(way, place=way.place + small[:3], velocity=way.velocity + small[3:])
        out[:, j] = (moved.arrival - way.arrival).ravel() / near
    return out


def _summed(values: np.ndarray, step: float) -> np.ndarray:
    """Integral over time [s] of values (n, ...) by the trapezoidal rule, 0 in the first row."""
    parts = 0.5 * step * (values[1:] + values[:-1])
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(parts, axis=0)])
