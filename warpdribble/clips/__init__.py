"""Clips in: readers of BVH, ASF/AMC and BallPlay-M, and public recordings to fetch."""

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .data import FetchError, data_folder, fetch
    from .errors import ClipError
    from .read import SUFFIXES, read_clip, read_part

__all__ = ["SUFFIXES", "ClipError", "FetchError", "data_folder", "fetch", "read_clip", "read_part"]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".data": "FetchError data_folder fetch",
        ".errors": "ClipError",
        ".read": "SUFFIXES read_clip read_part",
    },
)
