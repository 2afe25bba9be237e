"""The ball of a reference: when which hand has it, and its way in between."""

from typing import TYPE_CHECKING

from ...lazy import lazily

if TYPE_CHECKING:
    from .ball import Ball, inferred_ball, recorded_ball

__all__ = ["Ball", "inferred_ball", "recorded_ball"]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".ball": "Ball inferred_ball recorded_ball",
    },
)
