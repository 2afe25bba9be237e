"""Reference motion of a model: rows of joint coordinates, closed to cycles, mirrored, paid in advance."""

from typing import TYPE_CHECKING

from ...lazy import lazily

if TYPE_CHECKING:
    from .feedforward import leading_targets
    from .mirror import mirrored
    from .reference import Cycle, Reference, close_cycle

__all__ = ["Cycle", "Reference", "close_cycle", "leading_targets", "mirrored"]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".feedforward": "leading_targets",
        ".mirror": "mirrored",
        ".reference": "Cycle Reference close_cycle",
    },
)
