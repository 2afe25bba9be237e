"""A recording's motion put onto a model: calibrated, feet planted, hands where they were."""

from typing import TYPE_CHECKING

from ...lazy import lazily

if TYPE_CHECKING:
    from .cycles import find_cycles
    from .mapping import MappingError, find_mapping, read_mapping
    from .retarget import retargeted

__all__ = ["MappingError", "find_cycles", "find_mapping", "read_mapping", "retargeted"]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".cycles": "find_cycles",
        ".mapping": "MappingError find_mapping read_mapping",
        ".retarget": "retargeted",
    },
)
