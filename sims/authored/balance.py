"""A pelvis put to where the centre of mass then is where it should be."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..model import Model, pose

TRIES, GAIN = 6, 1.1
"""A pelvis that is moved takes most of the player's mass along: after so many times the centre of mass is a
micrometre off."""


def balance(model: Model, joint_q: np.ndarray, goal: np.ndarray, limbs: Callable[[np.ndarray], None]) -> None:
    """Move the root of joint_q (frames, nq), in place, until the centre of mass is at `goal` (frames, 3) [m],
    or over (frames, 2); limbs: puts arms and legs to where they have to be for where the root is."""
    root, axes = model.q_slice(model.root).start, goal.shape[1]
    for _ in range(TRIES):
        limbs(joint_q)
        own, centres = pose.centres_of_mass(model, pose.forward(model, joint_q))
        share = model.body_mass[own] / model.body_mass[own].sum()
        off = goal - np.einsum("b,fbk->fk", share, centres)[:, :axes]
        joint_q[:, root : root + axes] += GAIN * off
    limbs(joint_q)
