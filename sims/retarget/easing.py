"""A path that keeps to what is known and is smooth in between."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import distance_transform_edt

from ..signals import smoothstep

FIXED = 1e12
"""Weight of a row that stays, beside a row that gives as it is smooth."""
THIRD = np.array([-1.0, 3.0, -3.0, 1.0])
"""Third differences: they are large where the acceleration changes."""


def eased(wanted: np.ndarray, like: np.ndarray, stays: np.ndarray, span: float) -> np.ndarray:
    """Values (n, k) equal to `wanted` (n, k) in the rows that stay (n,) bool, near it in the others, and of
    continuous acceleration; Whittaker's graduation (1923) of third differences.

    The sum of |x - wanted|^2 + span^6 |third differences of x - like|^2 is least: jerks are those of `like`
    (n, k), or none near rows that stay. span: rows over which a step is spread.
    """
    count, inner = len(wanted), len(wanted) - len(THIRD) + 1
    if inner < 1 or stays.all():
        return wanted.copy()
    away = distance_transform_edt(~stays) if stays.any() else np.full(count, np.inf)
    share = smoothstep(np.clip(away / span - 1.0, 0.0, 1.0))
    share = np.min([share[i : i + inner] for i in range(len(THIRD))], axis=0)
    jerk = share[:, None] * np.diff(like, 3, axis=0)
    # the normal equations, in the lower form of solveh_banded: the main diagonal, then those below
    weight = np.where(stays, FIXED, 1.0)
    right = weight[:, None] * wanted
    bands = np.zeros((len(THIRD), count))
    bands[0] = weight
    for i, a in enumerate(THIRD):
        right[i : i + inner] += span**6 * a * jerk
        for k, b in enumerate(THIRD[i:]):
            bands[k, i : i + inner] += span**6 * a * b
    return np.where(stays[:, None], wanted, solveh_banded(bands, right, lower=True))
