"""The mirrored twin of a reference: left and right change places across the plane y = 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..ball.ball import Ball
from ..ball.possession import Flight
from ..model import pose
from .reference import Reference

FLIP = np.array([-1.0, 1.0, -1.0])
"""What the mirror does to a rotation vector: rotations about Y stay, about X and Z they turn round."""


def mirrored(model, reference: Reference) -> Reference:
    """The reference in the mirror. Its mirror image is the reference again.

    Joints are paired by their names, `l_` with `r_`; joints without a side stay. Raises ValueError when a
    joint's partner is missing or bends about another axis.
    """
    out = np.array(reference.joint_q, dtype=float)
    zero = pose.zero_q(model)
    for name in model.joint_names:
        other = partner(model, name)
        q, theirs = reference.joint_q[:, model.q_slice(other)], model.q_slice(name)
        if model.joint_type(name) == "hinge":
            sign = float(FLIP * model.joint_axis(other) @ model.joint_axis(name))
            if abs(abs(sign) - 1.0) > 1e-3:
                raise ValueError(f"the joints '{name}' and '{other}' are no mirror images")
            out[:, theirs] = zero[theirs] + np.sign(sign) * (q - zero[model.q_slice(other)])
        else:
            turn = slice(theirs.stop - 4, theirs.stop)
            out[:, turn] = q[:, -4:] * [*FLIP, 1.0]
        if model.joint_type(name) == "free":
            out[:, theirs.start : theirs.start + 3] = q[:, :3] * [1.0, -1.0, 1.0]
    return replace(reference, joint_q=out)


def mirrored_ball(ball: Ball) -> Ball:
    """A ball in the mirror, with its contacts on the other hand."""
    flights = tuple(Flight(f.release, f.catch, 1 - f.hand, 1 - f.next_hand) for f in ball.flights)
    return replace(ball, path=ball.path * [1.0, -1.0, 1.0], touch=ball.touch[:, ::-1].copy(), flights=flights)


def partner(model, joint: str) -> str:
    """The joint on the other side, or itself. Raises ValueError when there is none."""
    for side, other in (("l_", "r_"), ("r_", "l_")):
        if joint.startswith(side):
            name = other + joint.removeprefix(side)
            if name not in model.joint_names:
                raise ValueError(f"the joint '{joint}' has no partner '{name}'")
            return name
    return joint
