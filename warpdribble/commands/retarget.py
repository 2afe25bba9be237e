"""`warpdribble motion retarget` and `warpdribble motion cycles`: a clip on the player, and its cycles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .clip_input import ClipInput
from .console import say

if TYPE_CHECKING:
    from ..sims import Ball
    from ..sims.retarget.accuracy import Accuracy


@dataclass
class Retarget(ClipInput):
    """Put a clip on the player and say how well it fits: joints, feet, ground, the ball its hands play."""

    mapping: str = ""
    """Names of the skeleton's joints: cmu, ballplay, mixamo, lafan, or your own .toml file; told from the
    clip when empty."""
    ik: bool = True
    """Keep feet where they stood and bring hands where they were; without, rotations are copied only."""
    model: str = "player"
    """The player, or the path of an MJCF file with the same body names."""

    def run(self) -> int:
        from ..clips.read import read_part
        from ..sims import Model
        from ..sims.ball.ball import inferred_ball, recorded_ball
        from ..sims.retarget.accuracy import accuracy
        from ..sims.retarget.mapping import find_mapping, read_mapping
        from ..sims.retarget.retarget import retargeted

        model = Model.load(self.model)
        motion, notes = read_part(**self.reading())
        mapping = read_mapping(self.mapping) if self.mapping else find_mapping(motion)
        result = retargeted(model, motion, mapping, self.ik)
        say(f"clip        {self.clip}, {motion.frame_count} frames, {motion.duration:.2f} s")
        for note in (*notes, *result.notes):
            say(f"            {note}")
        say(f"onto        {model.name} with the mapping {mapping.name}, lengths times {result.scale:.3f}")
        say(f"toes        {_toes(result.toes)}")
        for line in _table(accuracy(model, result)):
            say(line)
        if "ball" in model.body_names:
            inferred = inferred_ball(model, result.reference, result.scale)
            if inferred is None:
                say("ball        inferred: none, nothing that the hands do shows one")
            for name, ball in (("inferred", inferred), ("recorded", recorded_ball(model, result, motion))):
                if ball is not None:
                    for line in _ball(name, ball, model.timestep):
                        say(line)
        return 0


@dataclass
class Cycles(ClipInput):
    """Propose cyclic parts of a clip: ranges of frames that end as they begin, best first."""

    mapping: str = ""
    """Names of the skeleton's joints, as for motion retarget."""
    shortest: float = 0.4
    """[s] of a cycle."""
    longest: float = 2.5
    """[s] of a cycle."""
    most: int = 12
    """How many to list."""

    def run(self) -> int:
        from ..clips.read import read_part
        from ..sims.retarget.cycles import find_cycles
        from ..sims.retarget.mapping import read_mapping

        if not 0.05 <= self.shortest < self.longest <= 60.0:
            raise ValueError("--shortest and --longest: give rising times of 0.05 to 60 s")
        if self.most < 1:
            raise ValueError(f"--most {self.most}: give a number of 1 or more")
        reading = self.reading()
        motion, _ = read_part(**reading)
        mapping = read_mapping(self.mapping) if self.mapping else None
        found = find_cycles(motion, mapping, self.shortest, self.longest, self.most)
        start = reading["frames"][0]
        if not found:
            say(f"no part of {self.shortest} to {self.longest} s ends as it begins")
        else:
            say("     frames        s   gap cm   gap m/s   moves cm   travel m   turn deg")
        for one in found:
            frames = f"{start + one.first}-{start + one.last}"
            say(
                f"{frames:>11}  {one.duration:7.3f}  {100 * one.pose_gap:7.1f}  {one.speed_gap:8.2f}  "
                f"{100 * one.excursion:9.1f}  {one.travel:9.2f}  {math.degrees(one.turn):9.0f}"
            )
        return 0


def _table(fit: Accuracy) -> list[str]:
    lines = [f"joints      {fit.summary}; mean and 95 % by limb:"]
    for limb, (mean, most) in fit.limbs.items():
        lines.append(f"  {limb:10}{100 * mean:5.1f} {100 * most:5.1f} cm")
    lines.append(
        f"feet        on the ground {100 * fit.standing:.0f} % of the time, "
        f"sliding {1e3 * fit.sliding:.1f} mm/s (99 %: {1e3 * fit.sliding_worst:.0f}); "
        f"skimming it {100 * fit.skimming:.0f} % of the time"
    )
    deepest = max(fit.penetration, fit.body_penetration)
    lines.append(f"ground      deepest point {1e3 * deepest:.1f} mm under it")
    return lines


def _toes(found: dict[str, str | None]) -> str:
    """Whose angles the toes have."""
    lines = [f"{foot} follow {joint}" if joint else f"{foot} straight between steps: no toe was recorded"
             for foot, joint in found.items()]  # fmt: skip
    return ", ".join(line.replace("foot", "toes", 1) for line in lines)


def _ball(name: str, ball: Ball, timestep: float) -> list[str]:
    lines = []
    for hand, parts in ball.contact(timestep).items():
        spans = ", ".join(f"{a:.2f}-{b:.2f}" for a, b in parts[:12])
        lines.append(f"ball        {name}: {hand} hand at {spans}{', ...' if len(parts) > 12 else ''} s")
    tops = ", ".join(
        f"{r * timestep:.2f} s ({h:.2f} m)" for r, h in list(zip(ball.checkpoints, ball.heights))[:12]
    )
    if not lines:
        lines.append(f"ball        {name}: nobody touches it")
    if tops:
        lines.append(f"            {name}: highest at {tops}")
    return lines
