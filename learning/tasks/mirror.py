"""What a mirror does to what is felt and done: left and right change places across the plane y = 0.

A skill and its twin on the other hand need one policy (P1 7.2): who is in the mirror feels the mirrored state
and does the mirrored action.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...sims.model import Model
from ...sims.reference.mirror import FLIP, partner
from ...sims.worlds.terms import Term

VECTOR, AXIAL = (1.0, -1.0, 1.0), (-1.0, 1.0, -1.0)
SIGNS = {
    "LEAN": (1.0, -1.0),
    "HEIGHT": (1.0,),
    "SPIN": AXIAL,
    "ANGULAR_MOMENTUM": AXIAL,
    "BALLISTIC": (1.0, 1.0, -1.0, 1.0),
    **dict.fromkeys(("COM", "COM_VELOCITY", "POINT", "VELOCITY", "BETWEEN", "FROM_COM"), VECTOR),
}
"""Of each kind of observation: which of its numbers turn round."""


@dataclass(frozen=True)
class Mirror:
    """Numbers in the mirror: each is `sign` times the one at `source`. Twice is nothing."""

    source: np.ndarray
    """(n,)"""
    sign: np.ndarray
    """(n,)"""

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """(..., n) of x (..., n)."""
        return np.asarray(x[..., self.source] * self.sign)

    def __len__(self) -> int:
        return len(self.source)

    @staticmethod
    def joined(parts: Sequence[Mirror]) -> Mirror:
        """Of their numbers one after the other, none of which goes to another part."""
        first = np.cumsum([0, *map(len, parts)])
        source = [part.source + start for part, start in zip(parts, first)]
        return Mirror(np.concatenate(source), np.concatenate([part.sign for part in parts]))


def other_side(name: str) -> str:
    """A name with l_ and r_ exchanged."""
    return re.sub(r"\b[lr]_", lambda found: "r_" if found[0] == "l_" else "l_", name)


def observed(terms: Mapping[str, Term], names: Sequence[str]) -> Mirror:
    """Of named observations in a row. Raises ValueError where one lacks its other side."""
    first, at = {}, 0
    for name in names:
        first[name], at = at, at + terms[name].count
    source, sign = np.zeros(at, int), np.zeros(at)
    for name, start in first.items():
        if other_side(name) not in first:
            raise ValueError(f"'{name}' has no '{other_side(name)}' beside it")
        own = slice(start, start + terms[name].count)
        source[own] = first[other_side(name)] + np.arange(terms[name].count)
        sign[own] = SIGNS[terms[name].kind]
    return Mirror(source, sign)


def turned(model: Model, joints: Sequence[str]) -> Mirror:
    """Of the joints' rotation vectors, angles or speeds in a row. Raises ValueError where one lacks its
    partner."""
    parts = {name: model.dof_slice(name) for name in joints}
    first, at = {}, 0
    for name, part in parts.items():
        first[name], at = at, at + part.stop - part.start
    source, sign = np.zeros(at, int), np.zeros(at)
    for name, start in first.items():
        other, count = partner(model, name), parts[name].stop - parts[name].start
        if other not in first:
            raise ValueError(f"'{name}' has no '{other}' beside it")
        own, joint = slice(start, start + count), model.joints[model.joint(name)]
        source[own] = first[other] + np.arange(count)
        there = model.joints[model.joint(other)]
        sign[own] = FLIP if joint.kind == "ball" else np.sign(FLIP * there.axis @ joint.axis)
    return Mirror(source, sign)
