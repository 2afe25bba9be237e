"""What a stage of learning is: a name, parameters, a learner, and what its result is good for.

A new stage is one file with a `Stage` in it and a line in `methods.STAGES`; `train`, the run's folder and the
commands know the rest from here.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

from ...sims.errors import InputError
from ..arrays import Arrays
from ..graph import ControlGraph
from ..rollout import Controller
from ..tasks.locomotion import Locomotion


@dataclass
class Report:
    """One iteration in numbers; a learner's has more of them. All but `fresh` are logged."""

    iteration: int
    fresh: bool
    """The result was tried, and is worth writing."""


class Learner(Protocol):
    """Learns in iterations, which `state` makes a file of and `restore` goes on from, to the bit."""

    iteration: int

    @property
    def done(self) -> bool: ...

    def iterate(self) -> Report:
        """Go one iteration further."""
        ...

    @property
    def result(self) -> Arrays | None:
        """The best so far, by name, with states to start from as states.k, states.joint_q, states.joint_qd;
        None where there is none yet."""
        ...

    @property
    def state(self) -> Arrays:
        """All that the future depends on; arrays that are never changed in place."""
        ...

    def restore(self, state: Arrays) -> None:
        """Go on from a `state`. Raises ValueError for one of another kind."""
        ...


@dataclass(frozen=True)
class Context:
    """What a learner is made from."""

    graph: ControlGraph
    config: Any
    """of the stage's kind"""
    seed: int = 0
    device: str = "cpu"
    workers: int = 1
    """how many may simulate at once; it does not change what is learned"""
    folder: Path | None = None
    """the stage's, for what is too large for a checkpoint, as a replay buffer (`files.mapped`)"""
    needs: Mapping[str, Arrays] = field(default_factory=dict)
    """results of the stages that it needs, by name"""


def known(config: Any, **names: Collection[str]) -> None:
    """Raises InputError where a parameter is not one of the names that there are."""
    for what, there in names.items():
        if (name := getattr(config, what)) not in there:
            raise InputError(f"there is no {what} '{name}'; there are {', '.join(there)}")


@dataclass(frozen=True)
class Stage:
    """A way to learn something for a skill."""

    name: str
    about: str
    """a line for a person"""
    config: Callable[..., Any]
    """a dataclass of parameters, each with a default; `iterations` is one"""
    make: Callable[[Context], Learner]
    controller: Callable[[Context, Arrays], Controller]
    """what a result does"""
    task: Callable[[Context, int], Locomotion]
    """worlds in which it is tried"""
    needs: tuple[str, ...] = ()
    """stages whose results it starts from"""
    uses: tuple[str, ...] | None = None
    """those of them without which its own result does nothing; None for all"""
    ball: bool = False
    """only for a skill in which somebody plays with one"""
    packages: tuple[str, ...] = ()
    """that learning needs, beyond what is always there; they come with the extra `learn`"""
    check: Callable[[Any], str] | None = None
    """a line for a person: what policies are tried in, from the parameters, where a `score` of 1 is the best
    that there is; None for others"""
    save_iterations: int = 1
    save_seconds: float = 30.0
    """A checkpoint is written after so many iterations, or so much time, whichever comes first."""

    @property
    def missing(self) -> list[str]:
        """Packages that learning needs and that are not there."""
        return [name for name in self.packages if find_spec(name) is None]
