"""Learners, one file a method, each readable beside its paper."""

from __future__ import annotations

from ..runs.stage import Stage
from . import ddpg, linear, ppo, samcon
from .ball import STAGE as BALL

STAGES: dict[str, Stage] = {
    "locomotion": samcon.STAGE,
    "ball": BALL,
    "linear": linear.STAGE,
    "ddpg": ddpg.STAGE,
    "policy": ppo.STAGE,
}
"""What can be learned, in the order in which one stands on the other."""


def needed(name: str) -> list[Stage]:
    """A stage and those that it starts from, in the order in which they are learned."""
    wanted = {name}
    for stage in reversed(STAGES.values()):
        if stage.name in wanted:
            wanted |= set(stage.needs)
    return [stage for stage in STAGES.values() if stage.name in wanted]
