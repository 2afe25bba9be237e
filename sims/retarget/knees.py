"""Legs that reach their feet without jerks of the knees: the root gives way, and swinging feet a little.

A nearly straight leg turns a millimetre into degrees of its knee, so that a foot which is merely put where
it stands shakes the knee above it. Root and knees are therefore found together, over all rows, by
Gauss-Newton: accelerations of the knees like those of the copied rotations, standing feet in place, all else
near to what it was.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import solveh_banded

from ..model import Model, pose

ROUNDS, DONE = 6, 2e-3
"""Most steps, and the largest change [m, rad] of the last; a leg's length is nearly quadratic in its bend."""
STRAIGHT = 0.1
"""[rad] A knee bends at least this much ..."""
FIRM = 1e4
"""[1/s^2] ... or is pushed to by this."""
ACCELERATION = 3.0
"""[rad/m] How much accelerations of the root, and of feet along their legs, count beside those of knees."""
KNEE, ROOT, FOOT, STANDING = 400.0, 3e3, 1e4, 1e6
"""How much departures count beside accelerations of a knee: of knees [1/s^2], of the root, of feet that swing
and of feet that stand [rad/m/s^2]."""


@dataclass(frozen=True)
class Leg:
    """What one leg has to reach."""

    hinge: str
    ankle: np.ndarray
    """(frames, 3) [m]"""
    stands: np.ndarray
    """(frames,) bool: the ankle has to be exactly there."""


def ease_knees(model: Model, joint_q: np.ndarray, legs: list[Leg]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Move the root of joint_q (frames, nq) in place, whose knees are those to be like.

    Returns the root's way (frames, 3) [m], and for each leg where its ankle is to go (frames, 3) [m], which
    is moved along the leg where it swings.
    """
    count = len(joint_q)
    uppers = [pose.limb_bodies(model, leg.hinge)[0] for leg in legs]
    body_q = pose.forward(model, joint_q, uppers)
    hips = [body_q[:, upper, :3] for upper in uppers]
    limbs = [pose.limb(model, leg.hinge) for leg in legs]
    copied = [_bent(joint_q[:, model.q_slice(leg.hinge)][:, 0]) for leg in legs]
    # a row's unknowns stand together: the root's way, then a knee angle per leg
    x = np.concatenate([np.zeros((count, 3)), np.stack(copied, axis=1)], axis=1)
    pick = [_pick(x.shape, k) for k in range(x.shape[1])]
    stencil = np.array([1.0, -2.0, 1.0]) / model.timestep**2
    second = sparse.diags(stencil, [0, 1, 2], shape=(max(count - 2, 0), count), format="csr")

    for _ in range(ROUNDS):
        terms = []
        for k in range(3):
            terms += [(ACCELERATION * second, pick[k], x[:, k]), (ROOT, pick[k], x[:, k])]
        for i, leg in enumerate(legs):
            knee, bend = pick[3 + i], x[:, 3 + i]
            reach, slope = limbs[i].length(bend)
            apart = hips[i] + x[:, :3] - leg.ankle
            far = np.linalg.norm(apart, axis=1)
            change = _rows(slope) @ knee
            for k in range(3):
                change = change - _rows(apart[:, k] / far) @ pick[k]
            held = np.where(leg.stands, STANDING, FOOT)
            terms += [(second, knee, bend - copied[i]), (KNEE, knee, bend - copied[i])]
            terms += [(_rows(FIRM * (bend < STRAIGHT)), knee, bend - STRAIGHT)]
            terms += [(_rows(held), change, reach - far), (ACCELERATION * second, change, reach - far)]
        step = _least_squares(terms, 3 * x.shape[1]).reshape(x.shape)
        x = x + step
        if np.abs(step).max() < DONE:
            break

    joint_q[:, model.q_slice(model.root)][:, :3] += x[:, :3]
    ankles = []
    for i, leg in enumerate(legs):
        apart = leg.ankle - hips[i] - x[:, :3]
        far = np.linalg.norm(apart, axis=1)
        beyond = np.where(leg.stands, 0.0, limbs[i].length(x[:, 3 + i])[0] - far)
        ankles.append(leg.ankle + (beyond / far)[:, None] * apart)
    return x[:, :3], ankles


def _bent(angle: np.ndarray) -> np.ndarray:
    """Knee angles [rad] brought above STRAIGHT without a corner."""
    over = angle - STRAIGHT
    return STRAIGHT + 0.5 * (over + np.hypot(over, STRAIGHT))


def _least_squares(terms: list[tuple[Any, Any, Any]], bands: int) -> np.ndarray:
    """The step s for which the sum of |weight (change s + now)|^2 over terms (weight, change, now) is least;
    unknowns that are `bands` or more apart never meet."""
    normal: Any = 0.0
    right: Any = 0.0
    for weight, change, now in terms:
        part, rest = weight * change, weight * now
        if sparse.issparse(weight):
            part, rest = weight @ change, weight @ now
        normal, right = normal + part.T @ part, right - part.T @ rest
    size = len(right)
    lower = np.zeros((bands, size))
    for k in range(min(bands, size)):
        lower[k, : size - k] = normal.diagonal(-k)
    return solveh_banded(lower, right, lower=True)


def _pick(shape: tuple[int, ...], k: int) -> sparse.csr_matrix:
    """Takes the k-th unknown of every row from all of them."""
    rows = np.arange(shape[0])
    return sparse.csr_matrix(
        (np.ones(shape[0]), (rows, rows * shape[1] + k)), (shape[0], shape[0] * shape[1])
    )


def _rows(values: np.ndarray) -> sparse.dia_matrix:
    return sparse.diags(np.asarray(values, float))
