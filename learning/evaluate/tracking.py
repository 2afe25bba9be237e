"""How a trajectory went beside its reference, judged from the bodies' places alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...sims.model import Model, gaps, pose
from ...sims.planar import planar, points_from, relative
from ...sims.reference.reference import difference
from ...sims.trajectory import Trajectory

FALLEN = 0.6
"""A player has fallen when its root is lower than this share of the reference's height."""
LIGHT = 0.1
"""[kg] Bodies below this (fingers) do not count in the tracking error."""
STILL = 0.05
"""[m/s] Of a standing foot's slowest point."""
TOUCH = 0.006
"""[m] A gap below this counts as contact."""


class Limb(NamedTuple):
    """How far a foot or hand is from its reference."""

    name: str
    """its body"""
    far: float
    """[m] 95th percentile of the distance"""
    worst: float
    """[m]"""
    frame: int
    """where it is worst"""
    sliding: float
    """[m/s] 95th percentile of its slowest point that touches the ground, where the reference stands too; NaN
    for hands and what never does"""


@dataclass(frozen=True)
class Tracking:
    """One trajectory in numbers, a row per time step."""

    angle_error: np.ndarray
    """(frames,) [rad], mean over the joints of bodies that are not light."""
    position_error: np.ndarray
    """(frames,) [m], mean over the same bodies, each seen from its player's facing frame: drift does not
    count."""
    drift: np.ndarray
    """(frames, 3) [m, m, rad] facing frame of the player, seen from that of the reference: how far ahead, how
    far to the left, how far turned."""
    fallen: np.ndarray
    """(frames,) bool."""
    contacts: dict[str, np.ndarray]
    """(frames,) bool by name."""
    root: np.ndarray
    """(frames, 3) [m] where the root was."""
    wanted: np.ndarray
    """(frames, nbody, 7) [m, -] where the reference has all bodies."""
    wanted_root: np.ndarray
    """(frames, 3) [m] of them the root."""
    limbs: tuple[Limb, ...]
    """feet and hands, the worst first"""

    @property
    def falls(self) -> int:
        """How often the player went down."""
        return int(np.sum(self.fallen[1:] & ~self.fallen[:-1]))


def track(model: Model, seen: Trajectory) -> Tracking:
    """Measure a trajectory of a model."""
    body_q, wanted = seen.body_q.astype(float), pose.forward(model, seen.reference_q)
    root = model.body(model.roles.one("root_body"))
    counted = [b for b in model.descendants(root) if model.body_mass[b] > LIGHT]
    frames, goals = planar(body_q[:, root]), planar(wanted[:, root])
    off = points_from(frames, body_q[:, counted, :3]) - points_from(goals, wanted[:, counted, :3])
    apart = difference(model, seen.reference_q, seen.joint_q.astype(float))
    joints = [
        n for n in model.joint_names if model.joint_body(n) in counted and model.joint_type(n) != "free"
    ]
    angles = [np.linalg.norm(apart[:, model.dof_slice(n)], axis=-1) for n in joints]
    return Tracking(
        angle_error=np.mean(angles, axis=0) if angles else np.zeros(len(body_q)),
        position_error=np.linalg.norm(off, axis=-1).mean(axis=1),
        drift=relative(goals, frames),
        fallen=body_q[:, root, 2] < FALLEN * wanted[:, root, 2],
        contacts=find_contacts(model, body_q),
        root=body_q[:, root, :3],
        wanted=wanted,
        wanted_root=wanted[:, root, :3],
        limbs=limbs(model, body_q, wanted, seen.timestep),
    )


def limbs(model: Model, body_q: np.ndarray, wanted: np.ndarray, timestep: float) -> tuple[Limb, ...]:
    """Feet and hands of body_q beside those wanted, both (frames, nbody, 7), the worst first."""
    found = []
    for name in (*model.roles.feet, *model.roles.hands):
        body = model.body(name)
        off = np.linalg.norm(body_q[:, body, :3] - wanted[:, body, :3], axis=1)
        sliding = np.nan
        if name in model.roles.feet:
            own = model.descendants(body)
            slow = gaps.sliding(model, wanted, own, timestep, TOUCH) < STILL
            slides = gaps.sliding(model, body_q, own, timestep, TOUCH)[slow]
            sliding = float(np.nanquantile(slides, 0.95)) if np.isfinite(slides).any() else np.nan
        found.append(Limb(name, float(np.quantile(off, 0.95)), float(off.max()), int(off.argmax()), sliding))
    return tuple(sorted(found, key=lambda limb: -limb.worst))


def find_contacts(model: Model, body_q: np.ndarray) -> dict[str, np.ndarray]:
    """What touches what in body_q (frames, nbody, 7), by name."""
    contacts, roles = {}, model.roles
    sides = ("right", "left")
    if roles.ball is not None:
        centre, radius = body_q[:, model.body(roles.ball), :3], model.ball_radius
        contacts["ball on ground"] = touches(centre[:, 2] - radius)
        for side, hand in zip(sides, roles.hands[::-1]):
            own = model.descendants(model.body(hand))
            contacts[f"ball on {side} hand"] = touches(
                gaps.gap_to_bodies(model, body_q, own, centre) - radius
            )
    for side, foot in zip(sides, roles.feet[::-1]):
        own = model.descendants(model.body(foot))
        contacts[f"{side} foot down"] = gaps.lowest_point(model, body_q, own) < TOUCH
    return contacts


def touches(gap: np.ndarray) -> np.ndarray:
    """Where a gap (frames,) [m] is closed, also between two frames."""
    turns = np.zeros(len(gap), bool)
    turns[1:-1] = (gap[1:-1] <= gap[:-2]) & (gap[1:-1] <= gap[2:])
    reach = np.maximum(np.abs(np.diff(gap, prepend=gap[:1])), np.abs(np.diff(gap, append=gap[-1:])))
    return np.asarray((gap < TOUCH) | (turns & (gap < TOUCH + reach)))
