"""Balls that bounce exactly: which they are, and what the kernels know of them (see `kernels.bounce`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from .joints import FREE
from .mjcf import Shape, Tables

if TYPE_CHECKING:
    from .slots import Pair

Place = tuple[int, np.ndarray, Rotation]
"""A body's link, and its origin [m] and frame in it."""

EVEN = 1.0e-6
"""Moments of inertia that differ by no more than this part of them are the same."""


def lone_balls(shapes: list[Shape], place: list[Place], tables: Tables, com: np.ndarray) -> list[int]:
    """The spheres that fly as points do: each on a free body without children, whose origin and centre of
    mass are the sphere's centre. One for each body."""
    balls: dict[int, int] = {}
    for k, shape in enumerate(shapes):
        link, offset, turn = place[k]
        lone = link != 0 and tables.link_joint[link] == FREE and link not in tables.link_parent
        centre = offset + turn.apply(shape.pos)
        if shape.kind == "sphere" and lone and np.allclose([centre, com[link]], 0.0, atol=1e-9):
            balls.setdefault(int(link), k)
    return list(balls.values())


def told(shapes: list[Shape], pairs: list[Pair], flyers: list[int]) -> list[str]:
    """A note on spheres that bounce off planes, but not exactly."""
    flat = {
        shapes[b].name: None
        for a, b in (pair["shapes"] for pair in pairs if pair["restitution"] > 0)
        if shapes[a].kind == "plane" and shapes[b].kind == "sphere" and b not in flyers
    }
    if not flat:
        return []
    return [
        f"bounces of {', '.join(flat)} are not exact, but solved as any contact: exact are those of a sphere "
        "about the origin and centre of mass of a free body without children"
    ]


def flyer_tables(slots: dict[int, list[int]], inertia: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Arrays `flyer_*` and `flight_slot`. slots: by link, where its ball may touch planes; inertia: the
    arrays `link_*` of `read_inertia`."""
    links = list(slots)
    moments = symmetric(inertia["link_moments"][links], inertia["link_products"][links])
    return {
        "flyer_link": np.array(links, int),
        "flyer_flight": np.cumsum([0, *map(len, slots.values())]),
        "flyer_even": even(moments).astype(int),
        "flyer_ease": np.linalg.inv(moments),
        "flight_slot": np.array([slot for of in slots.values() for slot in of], int),
    }


def symmetric(moments: np.ndarray, products: np.ndarray) -> np.ndarray:
    """(n, 3, 3) of xx, yy, zz (n, 3) and xy, xz, yz (n, 3)."""
    out = np.zeros((len(moments), 3, 3))
    out[:, [0, 1, 2], [0, 1, 2]] = moments
    out[:, [0, 0, 1], [1, 2, 2]] = out[:, [1, 2, 2], [0, 0, 1]] = products
    return out


def even(inertia: np.ndarray) -> np.ndarray:
    """(n,) whether inertias (n, 3, 3) are the same about every axis."""
    size = inertia[:, 0, 0]
    return np.abs(inertia - size[:, None, None] * np.eye(3)).max(axis=(1, 2)) <= EVEN * size
