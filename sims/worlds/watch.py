"""`Watch`: what happens inside a fragment, one number for each world.

    terms = {"touch": least(gap("r_palm", "ball", 0.12), H), "top": last(height_of("ball"), at_top)}
    watch = Watch(sim, terms, len(H))
    course.step(5, rows, watch)
    watch.read()                 # (world_count, 2)

Each is seen after every step and folded: the least or the most, a weighted sum, the last, or the step of the
first. weight: (rows,) by row of the course's table; 0 where it does not count, None where it always does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from .places import Place, find_place, on_links

if TYPE_CHECKING:
    from .simulation import Simulation

NOTHING = 1.0e6
"""The least of nothing; the most is the negative of it."""


@dataclass(frozen=True)
class Seen:
    """A number that each step gives."""

    kind: str
    places: tuple[str | Place, ...] = ()
    less: float = 0.0


def gap(a: str | Place, b: str | Place, less: float = 0.0) -> Seen:
    """Distance between two places, less the radii of what is around them [m]."""
    return Seen("GAP", (a, b), less)


def height_of(where: str | Place, less: float = 0.0) -> Seen:
    """[m] over the ground."""
    return Seen("HEIGHT", (where,), less)


def trouble() -> Seen:
    """Above 0 once the world has fallen, broken, or its ball has touched what it should not."""
    return Seen("BAD")


@dataclass(frozen=True)
class Folded:
    """What becomes of it."""

    fold: str
    seen: Seen
    weight: Any = None


def least(seen: Seen, weight: Any = None) -> Folded:
    """The least; NOTHING where nothing counted."""
    return Folded("LEAST", seen, weight)


def most(seen: Seen, weight: Any = None) -> Folded:
    """The most; -NOTHING where nothing counted."""
    return Folded("MOST", seen, weight)


def total(seen: Seen, weight: Any = None) -> Folded:
    """The sum of weight times number."""
    return Folded("SUM", seen, weight)


def last(seen: Seen, weight: Any = None) -> Folded:
    """The number after the last step that counted, as at a checkpoint; 0 where none did."""
    return Folded("LAST", seen, weight)


def first(seen: Seen, weight: Any = None) -> Folded:
    """The step, from 0, after which the number is first above 0; -1 where it never is."""
    return Folded("FIRST", seen, weight)


class Watch:
    """Numbers by name, `(world_count, n)`; for `Course.step`. rows: of the course's table."""

    def __init__(self, sim: Simulation, terms: Mapping[str, Folded], rows: int):
        self.sim, self.names, self.rows = sim, list(terms), rows
        model, program = sim.model, sim.program("watch")
        self.struct = struct = sim.program("step").Watch()
        nowhere = Place(model.body_names[0], (0.0, 0.0, 0.0))
        ends = [[*(find_place(model, p) for p in t.seen.places), nowhere, nowhere] for t in terms.values()]
        a, b = (on_links(model, [e[k] for e in ends]) for k in (0, 1))
        weight = [np.ones(rows) if t.weight is None else np.asarray(t.weight, float) for t in terms.values()]
        for name, values in zip(terms, weight):
            if values.shape != (rows,) or not np.isfinite(values).all() or (values < 0).any():
                raise ValueError(f"weights of '{name}' must be {rows} numbers from 0, one for each row")
        arrays = {
            "kind": (np.array([int(getattr(program, t.seen.kind)) for t in terms.values()], np.int32), int),
            "fold": (np.array([int(getattr(program, t.fold)) for t in terms.values()], np.int32), int),
            "link": (np.stack([a[0], b[0]], axis=1), int),
            "point": (np.stack([a[1], b[1]], axis=1), wp.vec3),
            "less": (np.array([t.seen.less for t in terms.values()], np.float32), float),
            "weight": (np.stack(weight, axis=1).astype(np.float32), float),
        }
        for name, (values, dtype) in arrays.items():
            setattr(struct, name, wp.array(values, dtype=dtype, device=sim.device))
        struct.out = sim.new_port(len(terms))

    def read(self) -> np.ndarray:
        """(world_count, n) of the steps since `Course.step` was last called."""
        return np.array(self.struct.out.numpy())

    def __getitem__(self, name: str) -> np.ndarray:
        """(world_count,)"""
        return self.read()[:, self.names.index(name)]
