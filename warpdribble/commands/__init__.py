"""The commands, one module each: a dataclass is the command line, its `run` does the work.

A new command is a dataclass with a `run() -> int` (the exit status) and a line in `COMMANDS`. Whatever is
wrong with the input is raised as ValueError or OSError, its message one line that says what to do.
"""

from typing import Protocol

from .demo import Demo
from .evaluate import Evaluate
from .export import Export
from .fetch import Fetch
from .info import Info
from .learn import Learn
from .motion import MotionGroup
from .simulate import Simulate
from .skill import SkillGroup


class Command(Protocol):
    """What a command line is parsed into."""

    def run(self) -> int:
        """Do it; the exit status. Raises ValueError, OSError, FloatingPointError."""


COMMANDS: dict[str, type[Command]] = {
    "simulate": Simulate,
    "demo": Demo,
    "motion": MotionGroup,
    "fetch": Fetch,
    "skill": SkillGroup,
    "learn": Learn,
    "evaluate": Evaluate,
    "export": Export,
    "info": Info,
}

__all__ = ["COMMANDS", "Command"]
