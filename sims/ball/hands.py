"""Both hands of a player over time: where a ball would be that lies on the palm, and how it would move.

Lengths are those of the person who moved: a model is as much larger than a recorded person as its legs are
longer, but the ball and gravity were the recorded ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from ..model import Model, pose
from ..reference import Reference
from .flight import GRAVITY

SMOOTH = 0.02
"""[s]"""
BODY = 0.1
"""[s] over which the whole player's velocity is smoothed."""


@dataclass(frozen=True)
class Hands:
    """Both hands over time: hand 0 is the left one, hand 1 the right one."""

    centre: np.ndarray
    """(frames, 2, 3) [m], where a ball's centre is that lies on the palm."""
    velocity: np.ndarray
    """(frames, 2, 3) [m/s] of that point."""
    normal: np.ndarray
    """(frames, 2, 3), out of the palm."""
    shoulder: np.ndarray
    """(frames, 2) [m], height of the shoulders."""
    body: np.ndarray
    """(frames, 3) [m/s] at which the player goes over the ground."""
    radius: float
    """[m] of the ball."""
    timestep: float
    """[s]"""

    @property
    def push(self) -> np.ndarray:
        """(frames, 2) [m/s] at which each palm goes the way it looks, seen from the player."""
        return np.einsum("fhk,fhk->fh", self.velocity - self.body[:, None], self.normal)

    @property
    def grip(self) -> np.ndarray:
        """(frames, 2) share of its weight with which a ball that goes with the hand lies on the palm; below
        zero it would have to stick to it."""
        force = _rate(self.velocity, SMOOTH, self.timestep) + [0.0, 0.0, GRAVITY]
        return np.einsum("fhk,fhk->fh", force, self.normal) / GRAVITY

    @property
    def palms(self) -> np.ndarray:
        """(frames, 2, 3) [m]."""
        return self.centre - self.radius * self.normal


def find_hands(model: Model, reference: Reference, scale: float = 1.0) -> Hands:
    """The hands of a model in a reference. scale: of the model to the person, whose metres are given back.
    Raises ModelError for a model without palms, shoulders or a ball."""
    palms = [model.sites[palm] for palm in model.roles.both("palms")]
    uppers = [model.joint_body(shoulder) for shoulder in model.roles.both("shoulders")]
    root = model.joint_body(model.root)
    body_q = pose.forward(model, reference.joint_q, [root, *uppers, *(body for body, _, _ in palms)])
    radius, step = model.ball_radius, reference.timestep
    centres, normals = [], []
    for body, place, turn in palms:
        hand = Rotation.from_quat(body_q[:, body, 3:])
        normals.append((hand * Rotation.from_quat(turn)).apply([0.0, 0.0, 1.0]))
        centres.append((body_q[:, body, :3] + hand.apply(place)) / scale + radius * normals[-1])
    centre = np.stack(centres, axis=1)
    going = _rate(body_q[:, root, :3] / scale, BODY, step) * [1.0, 1.0, 0.0]
    velocity, normal = _rate(centre, SMOOTH, step), np.stack(normals, axis=1)
    return Hands(centre, velocity, normal, body_q[:, uppers, 2] / scale, going, radius, step)


def _rate(places: np.ndarray, smooth: float, step: float) -> np.ndarray:
    """Velocity (frames, ...) [m/s] of places [m], smoothed over a time [s]."""
    smoothed = gaussian_filter1d(places, smooth / step, axis=0, mode="nearest")
    return np.gradient(smoothed, step, axis=0) if len(smoothed) > 1 else 0.0 * smoothed
