"""How deep soles are pressed into the ground by who stands on them.

A sole is a spring, and a reference whose sole just touches the ground does not load it: who follows it
exactly has no weight on the feet, and no friction. Its weight is on them where it is as much lower as they
give.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model, pose
from ..model.slots import touch_points
from ..signals import low_pass
from .feedforward import down, pushes
from .reference import Reference

SMOOTH = 10.0
"""[Hz] No root sinks faster."""


def pressed(model: Model, reference: Reference) -> Reference:
    """The same with the root as much lower as the feet give under it. A model without feet or ground stays
    as it is."""
    joint_q = reference.joint_q.copy()
    joint_q[:, model.q_slice(model.root)][:, 2] -= depth(model, reference)
    return replace(reference, joint_q=joint_q)


def depth(model: Model, reference: Reference) -> np.ndarray:
    """(frames,) [m] by which the feet give under what carries and accelerates the reference."""
    body_q = pose.forward(model, reference.joint_q)
    gaps, springs = _soles(model, body_q)
    if not springs.size:
        return np.zeros(reference.frame_count)
    low = gaps.min(axis=1)
    force = pushes(model, body_q, reference.timestep)[1].sum(axis=1)[:, 2]
    sunk = sink(gaps - low[:, None], springs, np.maximum(force, 0.0) * down(low))
    return low_pass(sunk, 1.0 / reference.timestep, SMOOTH)


def sink(gaps: np.ndarray, springs: np.ndarray, force: np.ndarray) -> np.ndarray:
    """(frames,) [m] by which points over the ground, at gaps (frames, points) [m] and of stiffnesses
    (points,) [N/m], come down under forces (frames,) [N].

    The force  sum of k max(d - gap, 0)  is that of the lowest m points, if these are the ones pushed down,
    and no less than that of the lowest m, however many are: so d is the least of those found for every m.
    """
    order = np.argsort(gaps, axis=1)
    stiffness = np.cumsum(springs[order], axis=1)
    rest = np.cumsum(springs[order] * np.take_along_axis(gaps, order, axis=1), axis=1)
    return np.asarray(((force[:, None] + rest) / stiffness).min(axis=1))


def _soles(model: Model, body_q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights (frames, points) [m] over the ground of the points of the feet that may touch it, and how stiff
    each contact is (points,) [N/m]: erp / (h cfm), as a load sinks in by cfm / erp of its impulse."""
    heights, springs = [], []
    ground = [s for s in model.shapes if s.kind == "plane"]
    feet = {b for foot in model.roles.feet for b in model.descendants(model.body(foot))}
    for shape in (s for s in model.shapes if s.body in feet and ground):
        erp, cfm = shape.erp + ground[0].erp, shape.cfm + ground[0].cfm  # a contact has the mean of both
        turn = Rotation.from_quat(body_q[:, shape.body, 3:])
        for point, radius in touch_points(shape):
            heights.append(body_q[:, shape.body, 2] + turn.apply(point)[:, 2] - radius)
            springs.append(erp / (model.timestep * cfm))
    return np.array(heights).T, np.array(springs)
