"""Learners, one file a method, each readable beside its paper."""

from __future__ import annotations

from ..runs.stage import Stage
from . import linear, samcon
from .ball import STAGE as BALL

STAGES: dict[str, Stage] = {
    "locomotion": samcon.STAGE,
    "ball": BALL,
    "linear": linear.STAGE,
}
"""What can be learned, in the order in which one stands on the other."""
