"""Learners, one file a method, each readable beside its paper."""

from __future__ import annotations

from ..runs.stage import Stage
from . import samcon

STAGES: dict[str, Stage] = {
    "locomotion": samcon.STAGE,
}
"""What can be learned, in the order in which one stands on the other."""
