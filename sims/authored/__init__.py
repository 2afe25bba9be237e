"""Clips written by our own code instead of recorded: what a fresh machine has without any download.

They are written for the shipped player, limb by limb: its joints stand here by their names, not by
`Model.roles`, as the numbers beside them fit no other body.
"""

from typing import TYPE_CHECKING

from ...lazy import lazily

if TYPE_CHECKING:
    from .catalogue import AUTHORED, authored_clip

__all__ = ["AUTHORED", "authored_clip"]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".catalogue": "AUTHORED authored_clip",
    },
)
