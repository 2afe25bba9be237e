"""`warpdribble simulate`: a clip or a skill becomes a simulated take."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Literal

from .clip_input import ClipInput, refuse_for_skill
from .console import bar, compiling, find_device, say, warmed
from .output import Outputs, check_outputs, write_outputs

if TYPE_CHECKING:
    from ..learning.rollout import Controller
    from ..learning.starts import Starts
    from ..learning.tasks.follow import Follow
    from ..sims import Model, Reference
    from ..sims.trajectory import Trajectory
    from ..skills import Skill, StagedSkill

LONGEST = 600.0
"""[s] of one take."""
SHORT = 60.0
"""[s] up to which several starts of the ball are tried: all of them are kept in memory."""


@dataclass
class Simulate(ClipInput, Outputs):
    """Let a simulated player follow a recorded clip or a skill; write a USD take and a picture.

    In place of a clip: the name of a skill (warpdribble skill list) or a skill's .toml file.
    """

    repeat: int = 1
    """How many times in a row; the ends are made to meet."""
    mapping: str = ""
    """Names of the skeleton's joints: cmu, ballplay, mixamo, lafan, or your own .toml file; told from the
    clip when empty."""
    ball: bool = True
    """The ball, as it was recorded, or inferred from the hands where it was not; --no-ball leaves it out."""
    root: Literal["free", "tracked"] = "free"
    """free: only the joints are driven. tracked: virtual forces hold the pelvis to the clip too, and
    the joints' targets are learned by trying."""
    model: str = "player"
    """The player, or the path of an MJCF file with the same body names."""

    def run(self) -> int:
        from ..learning.evaluate import refine
        from ..learning.evaluate.attempts import TRIES, follow, starts
        from ..learning.tasks.follow import OpenLoop
        from ..sims import Model
        from ..skills import stage_skill

        _check(self)
        model = Model.load(self.model)
        one = stage_skill(model, self._skill())
        reference = one.reference
        say(f"{'clip' if one.skill.is_clip else 'skill':9} {_title(one)}, {reference.duration:.2f} s")
        for note in (*model.notes, *one.notes):
            say(f"          {note}")
        _check_length(reference.duration, self.repeat)
        if self.repeat > 1:
            if one.cycle is None:
                raise ValueError(f"--repeat {self.repeat}: the skill '{one.skill.name}' is not cyclic")
            reference = one.cycle.repeat(model, self.repeat)
        model, reference = self._without_ball(model, one, reference)
        tries = TRIES if one.ball is not None and reference.duration < SHORT else 1
        with compiling():
            task = warmed(follow(model, reference, tries, "free", self.device))
        if self.root == "tracked":
            with bar("finding targets", refine.TRIES) as progress:
                task = follow(model, reference, tries, "tracked", self.device, progress)
        begin = starts(model, reference, tries, one.ball is not None)
        seen = _record(task, OpenLoop(), begin).first(reference.frame_count)
        write_outputs(self, model, seen, _title(one), self.root)
        return 0

    def _skill(self) -> Skill:
        """The skill, or the clip as one that has no file yet."""
        from ..skills import clip_skill, is_skill, read_skill

        if is_skill(self.clip):
            refuse_for_skill(
                self, [*(f.name for f in fields(ClipInput) if f.name != "clip"), "mapping"], self.clip
            )
            one = read_skill(self.clip)
            return one if self.ball else replace(one, ball=False)
        reading = self.reading()
        return clip_skill(
            self.clip,
            reading["frames"],
            repairs=self.repair,
            units=reading["units"],
            up=reading["up"],
            asf=None if self.asf is None else str(self.asf),
            rate=reading["rate"],
            drop_positions=reading["drop_positions"],
            mapping=self.mapping,
            cyclic=self.repeat > 1,
            ball=self.ball,
        )

    def _without_ball(self, model: Model, one: StagedSkill, reference: Reference) -> tuple[Model, Reference]:
        """The model and the motion as they are, or without the ball, where nobody plays with it."""
        from ..sims import Model

        if one.ball is not None or model.roles.ball is None:
            return model, reference
        bare = Model.load(self.model, without=(model.roles.ball,))
        return bare, replace(reference, joint_q=bare.convert_q(model, reference.joint_q))


def _check(command: Simulate) -> None:
    """Raise ValueError or OSError for what cannot work, before anything is computed."""
    if command.repeat < 1:
        raise ValueError(f"--repeat {command.repeat}: give a number of 1 or more")
    find_device(command.device)
    check_outputs(command)


def _check_length(duration: float, repeat: int) -> None:
    """Raise ValueError where a take of cycles that last so long [s] would not fit into memory."""
    most = max(1, int(LONGEST / duration))
    if repeat > most:
        raise ValueError(f"--repeat {repeat}: at most {most} for this clip ({LONGEST:.0f} s)")


def _title(one: StagedSkill) -> str:
    return one.skill.description if one.skill.is_clip else f"{one.skill.name}: {one.skill.description}"


def _record(task: Follow, controller: Controller, begin: Starts) -> Trajectory:
    """Simulate all worlds of a task along its graph; the one whose ball is in play longest."""
    from ..learning.evaluate.attempts import longest_in_play
    from ..learning.evaluate.record import record

    count = task.graph.count
    with bar(f"simulating {count * task.graph.period:.1f} s", count) as progress:
        seen = record(
            task,
            controller,
            begin,
            count,
            worlds=range(task.worlds),
            progress=progress,
        )
    return longest_in_play(task.model, seen)
