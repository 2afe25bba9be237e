"""Trees as parents by number: those of bodies, joints and links, with parents before their children."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np


def below(parents: Iterable[int], node: int) -> list[int]:
    """A node and all that hang from it, directly or not, in their order."""
    found = {node}
    for child, parent in enumerate(parents):
        if parent in found:
            found.add(child)
    return sorted(found)


def path(parents: Sequence[int] | np.ndarray, top: int, end: int) -> list[int]:
    """The nodes from `top` down to `end`, both included; empty where `end` does not hang from `top`."""
    nodes = [end]
    while nodes[-1] != top:
        above = int(parents[nodes[-1]])
        if above < 0:
            return []
        nodes.append(above)
    return nodes[::-1]
