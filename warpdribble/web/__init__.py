"""Pages for a browser."""

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .page import write_replay

__all__ = ["write_replay"]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".page": "write_replay",
    },
)
