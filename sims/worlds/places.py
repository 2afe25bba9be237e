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


def tip(model: Model, body: str) -> Place:
    """The end of a body's capsule that is farther from its joint, as a finger's tip. Raises ValueError where
    it has no capsule."""
    shape = next((s for s in model.shapes if s.body == model.body(body) and s.kind == "capsule"), None)
    if shape is None:
        raise ValueError(f"body '{body}' has no capsule, so no tip")
    along = Rotation.from_quat(shape.quat).apply([0.0, 0.0, shape.size[1]])
    ends = shape.pos + along, shape.pos - along
    return Place(body, _triple(max(ends, key=lambda end: float(np.linalg.norm(end)))))


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
