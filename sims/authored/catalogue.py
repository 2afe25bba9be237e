"""The authored clips by name. They are made when asked for, in well under a second, so none is stored."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..ball.ball import Ball, find_checkpoints
from ..ball.hands import find_hands
from ..model import Model
from ..reference.reference import Reference
from .between_legs import between_legs
from .carry import carry
from .dribble import dribble_right
from .run_dribble import run_dribble
from .switch import switch
from .waist import waist


@dataclass(frozen=True)
class Authored:
    """A cyclic reference, its last row the first one again, farther on where it runs, and its ball, which is
    in its coordinates too."""

    reference: Reference
    ball: Ball


def _dribble(model: Model) -> tuple[Reference, np.ndarray, np.ndarray]:
    clip = dribble_right(model)
    times = clip.reference.timestep * np.arange(clip.reference.frame_count)
    touch = np.zeros((len(times), 2), bool)
    touch[:, 1] = (times >= clip.contact[0]) | (times == 0.0)
    place = model.q_slice(model.roles.one("ball_joint")).start
    return clip.reference, clip.reference.joint_q[:, place : place + 3], touch


AUTHORED: dict[str, Callable[[Model], tuple[Reference, np.ndarray, np.ndarray]]] = {
    "carry": carry,
    "dribble_right": _dribble,
    "waist": waist,
    "switch_hands": switch,
    "run_dribble": run_dribble,
    "between_legs": between_legs,
}
"""Name -> its author: reference, way of the ball (rows, 3) [m], which hand has it (rows, 2) bool."""


def authored_clip(model: Model, name: str) -> Authored:
    """An authored clip on the player. Raises KeyError for a name that is none."""
    reference, path, touch = AUTHORED[name](model)
    joint_q = reference.joint_q.copy()
    place = model.q_slice(model.roles.one("ball_joint")).start
    joint_q[:, place : place + 3] = path
    reference = replace(reference, joint_q=joint_q)
    centre = find_hands(model, reference).centre
    rows = _tops(path[:, 2], touch)
    heights = tuple(float(centre[row, touch[row], 2].mean()) for row in rows)
    return Authored(reference, Ball(path, touch, rows, heights))


def _tops(height: np.ndarray, touch: np.ndarray) -> tuple[int, ...]:
    """Checkpoints of a cycle: contacts may run over its seam, and a ball that is never let go has its highest
    point as its only one."""
    count = len(height) - 1
    if touch.any(axis=1).all():
        return (int(np.argmax(height[:-1])),)
    twice = np.concatenate([height[:-1], height[:-1], height[:1]])
    both = np.concatenate([touch[:-1], touch[:-1], touch[:1]])
    return tuple(sorted({row % count for row in find_checkpoints(twice, both)}))
