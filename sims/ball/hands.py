"""Both hands of a model over time: where a ball would be that lies on the palm, and how it would move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from ..model import pose

SIDES = ("l", "r")
"""Hand 0 is the left one, hand 1 the right one."""
SMOOTH = 0.02
"""[s]"""


@dataclass(frozen=True)
class Hands:
    """Both hands over time, left then right."""

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


def find_hands(model, reference) -> Hands:
    """The hands of a model in a reference; its palms are the sites `l_palm` and `r_palm`."""
    body_q = pose.forward(model, reference.joint_q)
    radius = model.ball_radius
    centres, normals, shoulders = [], [], []
    for side in SIDES:
        body, place, turn = model.sites[f"{side}_palm"]
        hand = Rotation.from_quat(body_q[:, body, 3:])
        normals.append((hand * Rotation.from_quat(turn)).apply([0.0, 0.0, 1.0]))
        centres.append(body_q[:, body, :3] + hand.apply(place) + radius * normals[-1])
        shoulders.append(body_q[:, model.body(f"{side}_upper_arm"), 2])
    centre = np.stack(centres, axis=1)
    smooth = gaussian_filter1d(centre, SMOOTH / reference.timestep, axis=0, mode="nearest")
    velocity = np.gradient(smooth, reference.timestep, axis=0) if len(smooth) > 1 else 0.0 * smooth
    shoulder, normal = np.stack(shoulders, axis=1), np.stack(normals, axis=1)
    return Hands(centre, velocity, normal, shoulder, radius, reference.timestep)
