"""What tumbles or swings on its own, so that the kernels keep its energy: `kernels.tumble`, `kernels.mean`.

Trees whose joints are all driven are left out where they are fixed to the world, since nothing of them moves
undamped, and where they have feet: a character's drives take more energy than explicit velocity-product
forces give, and its steps are not gone through again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..trees import below
from .flights import even, symmetric
from .joints import BALL, DOF_SIZE, FREE

if TYPE_CHECKING:
    from .model import Model


def loose_tables(model: Model) -> dict[str, np.ndarray]:
    """Arrays `link_loose`, `link_tumbler` and `tumbler_*`."""
    t = model.tables
    parent, joint = t["link_parent"], t["link_joint"]
    feet = {int(t["body_link"][model.body(name)]) for name in model.listed("feet")}
    inertia = about_centre(t)
    uneven = ~even(inertia) | (np.abs(t["link_com"]).max(axis=1) > 1e-9)
    loose, tumblers = np.zeros(len(parent), int), []
    for root in (np.flatnonzero(parent[1:] == 0) + 1).tolist():
        tree = below(parent, root)
        if len(tree) > 1:
            bound = joint[root] != FREE or feet & set(tree)
            loose[tree] = not (bound and all(driven(t, i) for i in tree if joint[i] != FREE))
        elif joint[root] == FREE and uneven[root]:
            tumblers.append(root)
        elif joint[root] == BALL:
            loose[root] = not driven(t, root)
    number = np.full(len(parent), -1)
    number[tumblers] = np.arange(len(tumblers))
    size = np.trace(inertia[tumblers], axis1=1, axis2=2)
    return {
        "link_loose": loose,
        "link_tumbler": number,
        "tumbler_link": np.array(tumblers, int),
        "tumbler_inertia": inertia[tumblers] / size[:, None, None],
    }


def about_centre(t: dict[str, np.ndarray]) -> np.ndarray:
    """(links, 3, 3) moments of inertia about each link's centre of mass [kg m^2]."""
    com = t["link_com"]
    squares = np.einsum("ni,ni->n", com, com)[:, None, None] * np.eye(3)
    away = t["link_mass"][:, None, None] * (squares - com[:, :, None] * com[:, None, :])
    return symmetric(t["link_moments"], t["link_products"]) - away


def driven(t: dict[str, np.ndarray], link: int) -> bool:
    """Whether all dofs of a link's joint have drives."""
    dof = t["link_dof"][link]
    return bool((t["dof_kp"][dof : dof + DOF_SIZE[t["link_joint"][link]]] > 0).all())
