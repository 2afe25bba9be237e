"""What a player is: bodies, joints and shapes from an MJCF file, and where they are in a pose."""

from typing import TYPE_CHECKING

from ...lazy import lazily

if TYPE_CHECKING:
    from .joints import Joint
    from .mjcf import ModelError, Shape
    from .model import Model
    from .roles import Roles

__all__ = ["Joint", "Model", "ModelError", "Roles", "Shape"]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".joints": "Joint",
        ".mjcf": "ModelError Shape",
        ".model": "Model",
        ".roles": "Roles",
    },
)
