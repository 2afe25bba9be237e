"""`warpdribble skill list`, `show` and `draft`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, subcommand

from .clip_input import ClipFile
from .console import check_new, say

if TYPE_CHECKING:
    from ..sims import Cycle


@dataclass
class List:
    """The skills that ship, and whether their clips are here."""

    def run(self) -> int:
        from ..clips.data import set_of
        from ..skills.skill import SkillError, read_skill, skill_names
        from ..skills.staged import find_clip

        for name in skill_names():
            one = read_skill(name)
            where = f"authored {one.authored}"
            if one.clip:
                where = f"{one.clip} {one.frames[0]}-{one.frames[1]}"
                try:
                    find_clip(one)
                except SkillError:
                    where += f" (not here: warpdribble fetch {set_of(one.clip)})"
            say(f"{name:22} {'cycle ' if one.cyclic else 'once  '} {one.description}")
            say(f"{'':22}        {where}")
        return 0


@dataclass
class Show:
    """What a skill is on the player: length, contacts, checkpoints, or what is wrong with its file."""

    skill: Positional[str]
    """Name of a shipped skill, or a .toml file."""

    def run(self) -> int:
        from ..sims import Model
        from ..skills.skill import read_skill
        from ..skills.staged import stage_skill

        model = Model.load("player")
        one = stage_skill(model, read_skill(self.skill))
        say(f"{one.skill.name}: {one.skill.description}")
        for note in one.notes:
            say(f"  {note}")
        step = one.reference.timestep
        say(f"  {one.reference.duration:.2f} s, {one.reference.frame_count} rows")
        if one.cycle is not None:
            say(f"  per cycle: {_way(one.cycle)}")
        if one.ball is not None:
            for hand, spans in one.ball.contact(step).items():
                say(f"  {hand} hand: {', '.join(f'{a:.2f}-{b:.2f}' for a, b in spans)} s")
            tops = zip(one.ball.checkpoints, one.ball.heights)
            say(f"  checkpoints: {', '.join(f'{r * step:.2f} s at {h:.2f} m' for r, h in tops) or 'none'}")
        return 0


@dataclass
class Draft(ClipFile):
    """Write a first version of a skill from a clip: its best cycle, contacts, checkpoints, heights."""

    out: Path = Path("skill.toml")
    """The file to write."""
    frames: tuple[int, int] | None = None
    """First and last frame to use, a cycle where their ends are alike; by default the best one is found."""
    whole: bool = False
    """Use the whole clip, not its best cycle."""
    name: str = ""
    """Of the skill; the clip's when empty."""
    mapping: str = ""
    """Names of the skeleton's joints, as for motion retarget."""
    overwrite: bool = False
    """Replace a file that is there; it is left alone otherwise."""

    def run(self) -> int:
        from ..sims import Model
        from ..skills.draft import draft, write_draft
        from ..skills.skill import parse_skill

        check_new([self.out], self.overwrite)
        reading = self.reading()
        clip = reading.pop("path")
        model = Model.load("player")
        text = draft(model, clip, self.frames, self.name, self.mapping, self.whole, **reading)
        one = parse_skill(text, str(self.out))
        write_draft(self.out, text)
        say(text.rstrip())
        say(f"written   {self.out}: look at it")
        say(f"next      warpdribble simulate {self.out}{' --repeat 5' if one.cyclic else ''}")
        if one.cyclic or one.contact:
            say(f"          warpdribble learn {self.out} --out {Path('runs', self.out.stem)}")
        return 0


@dataclass
class SkillGroup:
    """Skills: skill list, skill show NAME, skill draft CLIP --out FILE."""

    do: (
        Annotated[List, subcommand("list")]
        | Annotated[Show, subcommand("show")]
        | Annotated[Draft, subcommand("draft")]
    )

    def run(self) -> int:
        return self.do.run()


def _way(cycle: Cycle) -> str:
    """Where a cycle leads, as the player faces: "1.78 m ahead, turning 11 degrees left"."""
    ahead, left = cycle.way
    steps = ((ahead, "ahead", "back"), (left, "to the left", "to the right"))
    parts = [f"{abs(way):.2f} m {to if way > 0.0 else fro}" for way, to, fro in steps if abs(way) >= 0.005]
    turn = round(math.degrees(cycle.turn))
    parts += [f"turning {abs(turn)} degrees {'left' if turn > 0 else 'right'}"] if turn else []
    return ", ".join(parts) or "stays in place"
