"""A recording as data: a skeleton over time, what is wrong with it, and repairs."""

from typing import TYPE_CHECKING

from ...lazy import lazily

if TYPE_CHECKING:
    from .motion import Motion
    from .quality import examine
    from .repair import REPAIRS

__all__ = ["REPAIRS", "Motion", "examine"]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".motion": "Motion",
        ".quality": "examine",
        ".repair": "REPAIRS",
    },
)
