"""The player, the ball and the court: models, worlds that step, recordings, references.

Public names stand here; what is deeper may move.
"""

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .authored import AUTHORED, authored_clip
    from .ball import Ball, inferred_ball, recorded_ball
    from .model import Model, ModelError
    from .recording import Motion
    from .reference import Cycle, Reference, close_cycle, mirrored
    from .retarget import MappingError, find_mapping, read_mapping, retargeted
    from .worlds import (
        BAD_CONTACT,
        FALL,
        FAR,
        NONFINITE,
        OVERSPEED,
        Contacts,
        Course,
        Probe,
        Simulation,
        State,
        Watch,
        terms,
        watch,
    )

__all__ = [
    "AUTHORED",
    "BAD_CONTACT",
    "FALL",
    "FAR",
    "NONFINITE",
    "OVERSPEED",
    "Ball",
    "Contacts",
    "Course",
    "Cycle",
    "MappingError",
    "Model",
    "ModelError",
    "Motion",
    "Probe",
    "Reference",
    "Simulation",
    "State",
    "Watch",
    "authored_clip",
    "close_cycle",
    "find_mapping",
    "inferred_ball",
    "mirrored",
    "read_mapping",
    "recorded_ball",
    "retargeted",
    "terms",
    "watch",
]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".authored": "AUTHORED authored_clip",
        ".ball": "Ball inferred_ball recorded_ball",
        ".model": "Model ModelError",
        ".recording": "Motion",
        ".reference": "Cycle Reference close_cycle mirrored",
        ".retarget": "MappingError find_mapping read_mapping retargeted",
        ".worlds": "Simulation Contacts State Course Probe Watch "
        "terms watch NONFINITE FALL BAD_CONTACT OVERSPEED FAR",
    },
)
