"""How many frames a second a clip has: given, or as its file says, of which a few digits may be rounded."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from pathlib import Path

from ..sims.errors import InputError
from .errors import ClipError

LEAST, MOST = 1.0, 2000.0
"""[Hz] of a motion."""
CUSTOMARY = (
    *(24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 72.0, 75.0, 90.0, 100.0, 120.0, 144.0, 150.0, 180.0, 200.0, 240.0),
    *(250.0, 300.0, 360.0, 400.0, 480.0, 500.0, 960.0, 1000.0),
)
"""[Hz] that cameras and programs have."""
SAID = 1e-3
"""Share of a rate from which on it is said that another was taken."""


def given_rate(rate: float) -> tuple[float, str]:
    """A rate that somebody says, and a note. Raises InputError for what is none."""
    if not LEAST <= rate <= MOST:
        raise InputError(f"{rate:g} Hz is not the rate of a motion: {LEAST:g} to {MOST:g}", "", "rate")
    return float(rate), f"rate given: {rate:g} Hz"


def rate_of(path: Path, frame_time: str) -> tuple[float, str]:
    """[Hz] of a frame time [s] as it is written, and a note or "". A few digits stand for many rates: where
    a customary one is among them, and the number itself is none, it is taken and said. Raises ClipError."""
    if not frame_time:
        raise ClipError(path, "has no Frame Time, so no rate is known", "rate")
    try:
        written = Decimal(frame_time)
        rate = 1.0 / float(written)
    except (InvalidOperation, ZeroDivisionError, ValueError, OverflowError):
        rate = 0.0
    if not LEAST <= rate <= MOST:
        raise ClipError(path, f"a Frame Time of {frame_time[:20]} s is not that of a motion", "rate")
    digit = 10.0 ** int(written.as_tuple().exponent)
    # rounded to the last digit, or cut off behind it
    slow, fast = 1.0 / (float(written) + digit), 1.0 / (float(written) - 0.5 * digit)
    meant = min(CUSTOMARY, key=lambda one: abs(one - rate))
    if abs(rate - round(rate)) < 1e-6 * rate or not slow < meant < fast:
        return rate, ""
    if abs(meant - rate) < SAID * rate:
        return meant, ""
    return meant, f"Frame Time {frame_time} is a rounded number: taken as {meant:g} Hz, not {rate:.4g}"


def header_rate(path: Path, word: str) -> tuple[float, str]:
    """[Hz] that a header says, and a note. Raises ClipError."""
    try:
        rate = float(word)
    except ValueError:
        rate = 0.0
    if not LEAST <= rate <= MOST:
        raise ClipError(path, f"its header says '{word[:20]}' frames a second", "rate")
    return rate, f"rate {rate:g} Hz, as its header says"
