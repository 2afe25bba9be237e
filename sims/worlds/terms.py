"""What a `Probe` can observe: each term says how many numbers it has, and in which unit.

Vectors are in the facing frame; see `probe`. A new kind is a branch of `kernels.probe.observe` and a
function here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .places import Place

Where = str | Place


@dataclass(frozen=True)
class Term:
    """One observation: a kind of `kernels.probe`, its numbers, the places and values that it needs."""

    kind: str
    count: int
    places: tuple[Where, ...] = ()
    values: tuple[float, ...] = ()
    judged: tuple[str, ...] = ()


def lean() -> Term:
    """(2) x and y of the root's third axis."""
    return Term("LEAN", 2)


def height() -> Term:
    """(1) of the root [m]."""
    return Term("HEIGHT", 1)


def spin() -> Term:
    """(3) angular velocity of the root [rad/s]."""
    return Term("SPIN", 3)


def facing() -> Term:
    """(2) cosine and sine of the way that the root's first axis points over the ground: the one observation
    that says where a character stands to the world."""
    return Term("FACING", 2)


def com() -> Term:
    """(3) centre of mass of the root's tree, from the ground below the root [m]."""
    return Term("COM", 3)


def com_velocity() -> Term:
    """(3) [m/s]"""
    return Term("COM_VELOCITY", 3)


def momentum() -> Term:
    """(3) angular momentum about the centre of mass [kg m^2/s]."""
    return Term("ANGULAR_MOMENTUM", 3)


def point(where: Where) -> Term:
    """(3) a place, from the ground below the root [m]."""
    return Term("POINT", 3, (where,))


def velocity(where: Where) -> Term:
    """(3) of a place [m/s]."""
    return Term("VELOCITY", 3, (where,))


def between(start: Where, end: Where) -> Term:
    """(3) from one place to another [m]."""
    return Term("BETWEEN", 3, (start, end))


def from_com(where: Where) -> Term:
    """(3) from the centre of mass to a place [m]."""
    return Term("FROM_COM", 3, (where,))


def miss(joints: Sequence[str]) -> Term:
    """(2) mean angle [rad] and mean rate [rad/s] between joints and their goals."""
    return Term("MISS", 2, judged=tuple(joints))


def ballistic(ball: Where, radius: float, meet: float, restitution: float) -> Term:
    """(4) of a ball that flies freely: time until it touches the ground [s], where that is (x, y) [m], and
    time until its centre passes the height `meet` [m] on its way up, after a bounce where it is falling, or
    until its highest point where it does not come so far [s]."""
    return Term("BALLISTIC", 4, (ball,), (radius, meet, restitution))


def status() -> Term:
    """(1) the bits of `Simulation.status`, as a number."""
    return Term("STATUS", 1)
