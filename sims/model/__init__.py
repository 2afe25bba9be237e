"""What a player is: bodies, joints and shapes from an MJCF file, and where they are in a pose."""

from typing import TYPE_CHECKING

from ...lazy import lazily

if TYPE_CHECKING:
    from .mjcf import ModelError, Shape
    from .model import Model
    from .roles import Roles

__all__ = ["Model", "ModelError", "Roles", "Shape"]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".mjcf": "ModelError Shape",
        ".model": "Model",
        ".roles": "Roles",
    },
)
