"""A ball's way through hands that push: how it flies and is carried, nearest to where recorded hands have
it.

Flights are what gravity and the ground make of how a ball leaves a hand. In a hand it may be accelerated as
one likes, but for what that asks of a palm: a force the way it faces, within the friction of skin on leather.
Each hold begins as a flight ends, and ends as the next begins, the last as the first of the next cycle. Among
all ways that fit together, the one is taken that is least off the hands, asks them least to pull, and is
pushed most evenly: nonlinear least squares, linear but for the flights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

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
    rows: np.ndarray
    """(n,)"""
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
    """(k - 1, m) ... and by how much that changes [g]."""

    @classmethod
    def of(cls, hands: Hands, hand: int, first: int, stop: int) -> Hold:
        rows, step = np.arange(first, stop), hands.timestep
        times = (rows - first) * step
        knots = np.linspace(0.0, times[-1], max(4, round(times[-1] / KNOTS) + 1))
        shape = np.stack([np.interp(times, knots, unit) for unit in np.eye(len(knots))], axis=1)
        faster = _summed(shape, step)
        one, none = np.ones((len(rows), 1)), np.zeros((len(rows), 2))
        change = np.diff(np.eye(len(knots)), 2, axis=0) / GRAVITY
        return cls(
            hand,
            rows,
            hands.centre[rows, hand],
            hands.normal[rows, hand],
            np.hstack([one, times[:, None], _summed(faster, step)]),
            np.hstack([0.0 * one, one, faster]),
            np.hstack([none, shape / GRAVITY]),
            np.hstack([np.zeros((len(change), 2)), change]),
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
        """What is least in squares (r,): off the hand, pulled, uneven; and its slopes (r, 3 m) over the
        points."""
        hold, three = self.hold, np.eye(3)
        along = np.sum(self.force * hold.normal, axis=1, keepdims=True)
        across = self.force - along * hold.normal
        aside = np.sqrt(np.sum(across**2, axis=1, keepdims=True) + SOFT**2)
        over = aside - FRICTION * along
        root = np.sqrt(over**2 + SOFT**2)
        steep = 0.5 * (1.0 + over / root) * (across / aside - FRICTION * hold.normal)
        values = [self.shift / NEAR, 0.5 * (over + root) / PULL, hold.change @ self.points / EVEN]
        slopes = [
            np.kron(hold.way, three) / NEAR,
            (hold.push[:, :, None] * steep[:, None]).reshape(len(steep), -1) / PULL,
            np.kron(hold.change, three) / EVEN,
        ]
        share = [1.0 / np.sqrt(len(part)) for part in values]
        return (
            np.concatenate([by * part.ravel() for by, part in zip(share, values)]),
            np.concatenate([by * part for by, part in zip(share, slopes)]),
        )


class Chain:
    """The flights and holds of one cycle, each of which begins as the one before ends; numbers x of a flight
    are its place [m] and velocity [m/s], those of a hold its accelerations [10 m/s^2]."""

    def __init__(
        self,
        model: Model,
        cycle: Cycle,
        hands: Hands,
        flights: list[Flight],
        holds: list[Hold],
        restitution: float = BOUNCE,
    ):
        self.hands, self.flights, self.holds, self.restitution = hands, flights, holds, restitution
        count, number = cycle.reference.frame_count - 1, len(flights)
        sizes = [6] * number + [3 * (hold.way.shape[1] - 2) for hold in holds]
        ends = np.cumsum([0, *sizes])
        self.parts = [slice(a, b) for a, b in pairwise(ends.tolist())]
        start = []
        for way in flights:
            row, lasts = way.release - 1 + count, (way.catch - way.release + 1) * hands.timestep
            place, end = hands.centre[row, way.hand], hands.centre[way.catch + count, way.next_hand]
            speed = float(np.nan_to_num(speed_to_meet(place[2], end[2], lasts, hands.radius), nan=3.0))
            start.append(np.array([*place, *(end - place)[:2] / lasts, -speed]))
        for hold in holds:
            ridge = 1e-3 * np.eye(hold.way.shape[1])
            goal = np.vstack([hold.centre, 0.0 * ridge[:, :3]])
            start.append(0.1 * np.linalg.lstsq(np.vstack([hold.way, ridge]), goal, rcond=None)[0][2:].ravel())
        self.start = np.concatenate(start)
        turn = np.eye(3)
        turn[:2, :2] = rotation(cycle.turn)
        self.turn, self.ahead = turn, cycle.ahead(model, np.zeros((1, 3)))[0]

    def at(self, x: np.ndarray) -> tuple[list[Flown], list[Carried]]:
        """Flights and holds of numbers x."""
        pieces, number = [x[part] for part in self.parts], len(self.flights)
        own = self.hands.radius, self.hands.timestep, self.restitution
        flown = [Flown(way, p[:3], p[3:], *own) for way, p in zip(self.flights, pieces)]
        return flown, [
            Carried(hold, np.vstack([way.arrival, 10.0 * p.reshape(-1, 3)]))
            for way, hold, p in zip(flown, self.holds, pieces[number:])
        ]

    def gaps(self, flown: list[Flown], carried: list[Carried]) -> np.ndarray:
        """(flights, 6) [m], [10 m/s] from where each hold ends to where the next flight begins."""
        return np.array(
            [
                np.concatenate([one.path[-1] - place, 0.1 * (one.velocity[-1] - velocity)])
                for one, (place, velocity) in zip(carried, self._begins(flown))
            ]
        )

    def _begins(self, flown: list[Flown]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Places and velocities at which each hold should end: the last in the cycle that follows."""
        first = flown[0]
        following = (self.turn @ first.place + self.ahead, self.turn @ first.velocity)
        return [*((way.place, way.velocity) for way in flown[1:]), following]

    def off(self, x: np.ndarray) -> np.ndarray:
        """What is least in squares."""
        flown, carried = self.at(x)
        return np.concatenate([self.gaps(flown, carried).ravel() / CLOSED, *(c.misses()[0] for c in carried)])

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """Its derivatives by x."""
        (flown, carried), number = self.at(x), len(self.flights)
        ends, misses = np.zeros((6 * number, len(x))), []
        for i, (way, one) in enumerate(zip(flown, carried)):
            comes = np.zeros((6, 6))
            for j, small in enumerate(1e-6 * np.eye(6)):
                near = replace(way, place=way.place + small[:3], velocity=way.velocity + small[3:])
                comes[:, j] = (near.arrival - way.arrival).ravel() / 1e-6
            last = (one.hold.way[-1:], 0.1 * one.hold.speed[-1:])
            by_points = [one.misses()[1], *(np.kron(row, np.eye(3)) for row in last)]
            out = [np.zeros((len(part), len(x))) for part in by_points]
            for part, full in zip(by_points, out):
                full[:, self.parts[i]] = part[:, :6] @ comes
                full[:, self.parts[number + i]] = 10.0 * part[:, 6:]
            misses.append(out[0])
            ends[6 * i : 6 * i + 6] = np.concatenate(out[1:])
            then, turn = (i + 1) % number, np.eye(3) if i + 1 < number else self.turn
            ends[6 * i : 6 * i + 6, self.parts[then]] -= np.kron(np.diag([1.0, 0.1]), turn)
        return np.concatenate([ends / CLOSED, *misses])

    def solve(self) -> tuple[list[Flown], list[Carried]] | None:
        """The flights and holds that fit together, nearest to the recorded hands; None where none do."""
        fit = least_squares(self.off, self.start, self.slopes, method="lm", ftol=1e-4)
        flown, carried = self.at(fit.x)
        return (flown, carried) if np.abs(self.gaps(flown, carried)).max() < CLOSED else None


def holds_of(hands: Hands, flights: list[Flight], count: int) -> list[Hold]:
    """Of each flight, the hold after it; none where one does not begin with the hand that has the ball."""
    holds = []
    for way, following in zip(flights, [*flights[1:], *flights[:1]]):
        stop = following.release + (count if following is flights[0] else 0)
        if way.next_hand != following.hand or stop - way.catch < SHORTEST or stop > 2 * count:
            return []
        holds.append(Hold.of(hands, way.next_hand, way.catch + count, stop + count))
    return holds


def _summed(values: np.ndarray, step: float) -> np.ndarray:
    """Integral over time [s] of values (n, ...) by the trapezoidal rule, 0 in the first row."""
    parts = 0.5 * step * (values[1:] + values[:-1])
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(parts, axis=0)])
