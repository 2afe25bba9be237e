"""Learning to move and to dribble.

Public names stand here; what is deeper may move.
"""

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .graph import ControlGraph, cyclic_graph

__all__ = ["ControlGraph", "cyclic_graph"]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".graph": "ControlGraph cyclic_graph",
    },
)
