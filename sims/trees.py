"""Trees as parents by number: those of bodies, joints and links, with parents before their children."""

from __future__ import annotations

from collections.abc import Iterable


def below(parents: Iterable[int], node: int) -> list[int]:
    """A node and all that hang from it, directly or not, in their order."""
    found = {node}
    for child, parent in enumerate(parents):
        if parent in found:
            found.add(child)
    return sorted(found)
