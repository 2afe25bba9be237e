"""Worlds that step: their memory, their state, what they show."""

from typing import TYPE_CHECKING

from ...lazy import lazily

if TYPE_CHECKING:
    from .course import Course, Signal
    from .places import Place
    from .probe import Group, Probe
    from .simulation import BAD_CONTACT, FALL, FAR, NONFINITE, OVERSPEED, Contacts, Simulation
    from .state import State
    from .watch import Watch

__all__ = [
    "BAD_CONTACT",
    "FALL",
    "FAR",
    "NONFINITE",
    "OVERSPEED",
    "Contacts",
    "Course",
    "Group",
    "Place",
    "Probe",
    "Signal",
    "Simulation",
    "State",
    "Watch",
]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".course": "Course Signal",
        ".places": "Place",
        ".probe": "Probe Group",
        ".simulation": "Simulation Contacts NONFINITE FALL BAD_CONTACT OVERSPEED FAR",
        ".state": "State",
        ".watch": "Watch",
    },
)
