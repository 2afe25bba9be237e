"""Takes out: USD with physics, pictures, films and plots."""

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .film import Camera, write_film
    from .plots import write_plots
    from .sheet import write_sheet
    from .take import Take, TakeError, validate, write_take

__all__ = [
    "Camera",
    "Take",
    "TakeError",
    "validate",
    "write_film",
    "write_plots",
    "write_sheet",
    "write_take",
]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".film": "Camera write_film",
        ".plots": "write_plots",
        ".sheet": "write_sheet",
        ".take": "Take TakeError validate write_take",
    },
)
