"""Worlds that step: their memory, their state, what they show."""

from typing import TYPE_CHECKING

from ...lazy import lazily

if TYPE_CHECKING:
    from .simulation import BAD_CONTACT, FALL, NONFINITE, OVERSPEED, Contacts, Simulation

__all__ = ["BAD_CONTACT", "FALL", "NONFINITE", "OVERSPEED", "Contacts", "Simulation"]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".simulation": "Simulation Contacts NONFINITE FALL BAD_CONTACT OVERSPEED",
    },
)
