"""The mirrored twin of a reference: left and right change places across the plane y = 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model import Model
from .reference import Reference

FLIP = np.array([-1.0, 1.0, -1.0])
"""What the mirror does to a rotation vector: rotations about Y stay, about X and Z they turn round."""
MIRROR = {"ball": np.array([*FLIP, 1.0]), "free": np.array([1.0, -1.0, 1.0, *FLIP, 1.0])}
"""And to the coordinates of joints that turn."""


def mirrored(model: Model, reference: Reference) -> Reference:
    """The reference in the mirror. Its mirror image is the reference again.

    Joints are paired by their names, `l_` with `r_`; joints without a side stay. Raises ValueError when a
    joint's partner is missing or bends about another axis.
    """
    out = np.array(reference.joint_q, dtype=float)
    for joint in model.joints:
        other = model.joints[model.joint(partner(model, joint.name))]
        q = reference.joint_q[:, other.q]
        if joint.kind == "hinge":
            sign = float(FLIP * other.axis @ joint.axis)
            if abs(abs(sign) - 1.0) > 1e-3:
                raise ValueError(f"the joints '{joint.name}' and '{other.name}' are no mirror images")
            out[:, joint.q] = joint.zero + np.sign(sign) * (q - other.zero)
        else:
            out[:, joint.q] = q * MIRROR[joint.kind]
    return replace(reference, joint_q=out)


def partner(model: Model, joint: str) -> str:
    """The joint on the other side, or itself. Raises ValueError when there is none."""
    for side, other in (("l_", "r_"), ("r_", "l_")):
        if joint.startswith(side):
            name = other + joint.removeprefix(side)
            if name not in model.joint_names:
                raise ValueError(f"the joint '{joint}' has no partner '{name}'")
            return name
    return joint
