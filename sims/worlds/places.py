"""Places on a model, named: where a probe or a watch looks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

if TYPE_CHECKING:
    from ..model import Model


@dataclass(frozen=True)
class Place:
    """A point fixed to a body."""

    body: str
    at: tuple[float, float, float]
    """[m] in the body's frame"""


def find_place(model: Model, where: str | Place) -> Place:
    """A place by name: a site, or a body, of which the middle of its first shape is meant. Raises ValueError
    where there is none."""
    if isinstance(where, Place):
        return where
    if where in model.sites:
        body, at, _ = model.sites[where]
        return Place(model.body_names[body], _triple(at))
    if where not in model.body_names:
        raise ValueError(f"the model has no body and no site named '{where}'")
    return Place(where, _triple(model.first_shape(model.body(where)).pos))


def middle(model: Model, body: str) -> Place:
    """The centre of mass of a body."""
    return Place(body, _triple(model.body_com[model.body(body)]))


def tip(model: Model, body: str) -> Place:
    """The end of a body's capsules that is farthest from its joint, as a finger's tip. Raises ValueError
    where it has no capsule."""
    return rounded_tip(model, body)[0]


def rounded_tip(model: Model, body: str) -> tuple[Place, float]:
    """The same, and the radius [m] of the capsule."""
    ends = []
    for s in model.shapes:
        if s.body == model.body(body) and s.kind == "capsule":
            along = Rotation.from_quat(s.quat).apply([0.0, 0.0, s.size[1]])
            ends += [(s.pos + along, float(s.size[0])), (s.pos - along, float(s.size[0]))]
    if not ends:
        raise ValueError(f"body '{body}' has no capsule, so no tip")
    end, radius = max(ends, key=lambda end: float(np.linalg.norm(end[0])))
    return Place(body, _triple(end)), radius


def _triple(v: np.ndarray) -> tuple[float, float, float]:
    x, y, z = map(float, v)
    return x, y, z


def on_links(model: Model, places: list[Place]) -> tuple[np.ndarray, np.ndarray]:
    """The links (n,) that places are fixed to, and where on them (n, 3) [m]."""
    t = model.tables
    links, points = np.zeros(len(places), np.int32), np.zeros((len(places), 3), np.float32)
    for k, place in enumerate(places):
        b = model.body(place.body)
        links[k] = t["body_link"][b]
        points[k] = t["body_offset"][b] + Rotation.from_quat(t["body_turn"][b]).apply(place.at)
    return links, points
