"""Both hands of a model over time: where a ball would be that lies on the palm, and how it would move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from ..model import Model, pose
from ..reference import Reference

SMOOTH = 0.02
"""[s]"""


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
    radius: float
    """[m] of the ball."""
    timestep: float
    """[s]"""


def find_hands(model: Model, reference: Reference) -> Hands:
    """The hands of a model in a reference. Raises ModelError for a model without palms, shoulders or a
    ball."""
    palms = [model.sites[palm] for palm in model.roles.both("palms")]
    uppers = [model.joint_body(shoulder) for shoulder in model.roles.both("shoulders")]
    body_q = pose.forward(model, reference.joint_q, [*uppers, *(body for body, _, _ in palms)])
    radius = model.ball_radius
    centres, normals = [], []
    for body, place, turn in palms:
        hand = Rotation.from_quat(body_q[:, body, 3:])
        normals.append((hand * Rotation.from_quat(turn)).apply([0.0, 0.0, 1.0]))
        centres.append(body_q[:, body, :3] + hand.apply(place) + radius * normals[-1])
    centre = np.stack(centres, axis=1)
    smooth = gaussian_filter1d(centre, SMOOTH / reference.timestep, axis=0, mode="nearest")
    velocity = np.gradient(smooth, reference.timestep, axis=0) if len(smooth) > 1 else 0.0 * smooth
    normal = np.stack(normals, axis=1)
    return Hands(centre, velocity, normal, body_q[:, uppers, 2], radius, reference.timestep)
