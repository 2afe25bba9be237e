"""A skill becomes what is simulated and learned: a reference on the model, closed where it is cyclic, with
its ball."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..clips import ClipError, data_folder
from ..clips.data import set_of
from ..sims.ball.ball import (
    Ball,
    ball_path,
    find_checkpoints,
    flights_of,
    inferred_ball,
    mirrored_ball,
    recorded_ball,
)
from ..sims.ball.hands import find_hands
from ..sims.ball.lead import led, led_once
from ..sims.errors import InputError
from ..sims.model import Model
from ..sims.reference.mirror import mirrored
from ..sims.reference.reference import Cycle, Reference, close_cycle, closing
from ..sims.retarget.accuracy import accuracy
from ..sims.retarget.mapping import MappingError, find_mapping, read_mapping
from ..sims.retarget.reach import lift_out
from ..sims.retarget.retarget import retargeted
from ..sims.signals import smoothstep
from .skill import HANDS, Skill, SkillError


@dataclass(frozen=True)
class StagedSkill:
    """A skill on a model."""

    skill: Skill
    reference: Reference
    """Closed where the skill is cyclic: the last row begins the next cycle."""
    cycle: Cycle | None
    ball: Ball | None
    """None where nothing shows a ball (walking, running)."""
    notes: tuple[str, ...] = ()


READING = ("frames", "units", "up", "repairs", "rate")
"""Keys that say how a clip is read, and hints of what is wrong with them."""


def find_clip(skill: Skill, data: str | Path | None = None) -> Path:
    """Path of a skill's recording. data: folder of recordings, None for the usual one. Raises SkillError."""
    return _found(skill, "clip", data)


def _found(skill: Skill, key: str, data: str | Path | None) -> Path:
    own = Path(getattr(skill, key))
    if skill.is_clip:
        return own
    folder = Path(data) if data else data_folder()
    places = [own] if own.is_absolute() else [folder / own, Path(skill.source).parent / own]
    for place in places:
        if place.exists():
            return place
    raise SkillError(skill.source, key, f"no file '{own}' in {folder}", set_of(own))


def stage_skill(model: Model, skill: Skill, data: str | Path | None = None) -> StagedSkill:
    """The skill on a model. Raises SkillError for a clip that is missing or cannot be used."""
    if model.roles.ball is None:
        skill = replace(skill, ball=False)
    hidden = None
    if skill.authored:
        reference, ball, notes = _authored(model, skill)
    else:
        reference, ball, notes, hidden = _recorded(model, skill, data)
    written = bool(skill.contact or skill.checkpoints)
    cycle = closed(model, reference) if skill.cyclic and not skill.authored else None
    if hidden is not None:
        if cycle is not None and skill.ball and not written:
            ball = cycle_ball(model, cycle, hidden)
        else:
            ball = inferred_ball(model, reference, hidden)
    notes = [*notes, *_ball_notes(skill, ball)]
    if not skill.ball:
        ball = None
    elif written:
        ball = _as_written(model, skill, reference, ball)
    if skill.mirror:
        reference = mirrored(model, reference)
        ball = mirrored_ball(ball) if ball is not None else None
    if skill.cyclic:
        if cycle is None:
            cycle = Cycle.of(model, reference)
        elif skill.mirror:
            cycle = closed(model, reference)
        if ball is not None and not skill.authored:
            ball = _closed_ball(model, ball, cycle)
            if not ball.recorded and (found := led(model, cycle, ball)) is not None:
                cycle, ball, note = found
                notes.append(note)
        reference = cycle.reference
        if cycle.gap:
            notes.append(f"its ends are {57.3 * cycle.gap:.1f} degrees per joint apart: blended")
    elif (
        ball is not None
        and not (ball.recorded or skill.authored)
        and (once := led_once(model, reference, ball)) is not None
    ):
        reference, ball, note = once
        notes.append(note)
    if ball is not None and not skill.authored:
        ball = replace(ball, heights=skill.heights or ball.heights)
        joint_q = reference.joint_q.copy()
        joint_q[:, model.q_slice(model.roles.one("ball_joint"))][:, :3] = ball.path
        reference = replace(reference, joint_q=joint_q)
        cycle = replace(cycle, reference=reference) if cycle is not None else None
    return StagedSkill(skill, reference, cycle, ball, tuple(notes))


def _ball_notes(skill: Skill, ball: Ball | None) -> list[str]:
    """Where the ball comes from: what was guessed, or left out, is said."""
    if not skill.ball:
        return ["ball left out"] if ball is not None else []
    if skill.contact or skill.checkpoints:
        return ["ball as the skill says"]
    if ball is None:
        return ["no ball shows"]
    if skill.authored:
        return []
    return ["ball recorded" if ball.recorded else "ball inferred from the hands' motion"]


def _authored(model: Model, skill: Skill) -> tuple[Reference, Ball | None, list[str]]:
    from ..sims.authored.catalogue import AUTHORED, authored_clip

    if skill.authored not in AUTHORED:
        known = ", ".join(AUTHORED)
        raise SkillError(skill.source, "authored", f"no clip '{skill.authored}'; there are {known}")
    clip = authored_clip(model, skill.authored)
    return clip.reference, clip.ball, [f"authored clip {skill.authored}"]


def _recorded(
    model: Model, skill: Skill, data: str | Path | None
) -> tuple[Reference, Ball | None, list[str], float | None]:
    """Reference, recorded ball, notes; where none was recorded, the scale with which one is inferred."""
    from ..clips import read_part

    path = find_clip(skill, data)
    asf = _found(skill, "asf", data) if skill.asf else None

    def fail(key: str, reason: str, error: ValueError) -> ValueError:
        if skill.is_clip:
            return error if isinstance(error, InputError) else ClipError(path, reason, key)
        return SkillError(skill.source, key, reason)

    try:
        motion, notes = read_part(
            path,
            skill.frames,
            skill.repairs,
            units=skill.units or None,
            up=skill.up or None,
            asf=asf,
            rate=skill.rate or None,
            drop_positions=skill.drop_positions,
        )
    except InputError as error:
        key = error.hint if error.hint in READING else "clip"
        raise fail(key, f"{path.name}: {error.reason}", error) from None
    if motion.duration < 2 * model.timestep:
        reason = f"its frames last only {motion.duration:.3f} s"
        raise fail("frames", reason, ClipError(path, reason, "frames"))
    try:
        mapping = read_mapping(skill.mapping) if skill.mapping else find_mapping(motion)
        result = retargeted(model, motion, mapping)
    except MappingError as error:
        raise fail("mapping", str(error), error) from None
    ball, hidden = None, None
    if model.roles.ball is not None:
        ball = recorded_ball(model, result, motion)
        if ball is None:
            hidden = result.scale
        elif not ball.touch.any():
            ball, notes = None, [*notes, "nobody touches the recorded ball: left out"]
    notes = [*notes, *result.notes, f"joints {accuracy(model, result).summary}"]
    return result.reference, ball, notes, hidden


TURNS = 5
"""Cycles in a row in which a ball is looked for: what the middle one shows has come from one like it."""


def cycle_ball(model: Model, cycle: Cycle, scale: float = 1.0) -> Ball | None:
    """The ball that the hands of a closed cycle play with again and again, as `inferred_ball` tells it."""
    ball = inferred_ball(model, cycle.repeat(model, TURNS), scale)
    ball = None if ball is None else _middle(model, cycle, ball)
    return ball if ball is not None and ball.touch.any() else None


def _middle(model: Model, cycle: Cycle, ball: Ball) -> Ball:
    """The middle one of TURNS cycles of a ball, where the first one is."""
    count = cycle.reference.frame_count - 1
    first = TURNS // 2 * count
    rows = slice(first, first + count + 1)
    path = ball.path[rows]
    for _ in range(TURNS // 2):
        path = cycle.behind(model, path)
    marks = [i for i, row in enumerate(ball.checkpoints) if first <= row < first + count]
    flights = tuple(
        replace(f, release=f.release - first, catch=f.catch - first)
        for f in ball.flights
        if first <= f.release < first + count
    )
    checkpoints = tuple(ball.checkpoints[i] - first for i in marks)
    heights = tuple(ball.heights[i] for i in marks)
    return replace(
        ball, path=path, touch=ball.touch[rows], checkpoints=checkpoints, heights=heights, flights=flights
    )


def closed(model: Model, reference: Reference) -> Cycle:
    """The cycle of a recording, with feet that closing has bent into the ground lifted out of it."""
    cycle = close_cycle(model, reference)
    joint_q = cycle.reference.joint_q.copy()
    for knee, foot in zip(model.roles.knees, model.roles.feet):
        lift_out(model, joint_q, knee, None, model.descendants(model.body(foot)))
    return replace(cycle, reference=replace(cycle.reference, joint_q=joint_q))


def _closed_ball(model: Model, ball: Ball, cycle: Cycle) -> Ball:
    """The ball of a closed cycle: with the closed hands, and on its way to those of the next cycle, where it
    was inferred; bent to where it begins where it was recorded."""
    reference = cycle.reference
    if not ball.recorded:
        touch = np.concatenate([*[ball.touch[:-1]] * TURNS, ball.touch[-1:]])
        hands, flights = find_hands(model, cycle.repeat(model, TURNS)), flights_of(touch)
        again = replace(ball, path=ball_path(hands, touch, flights), touch=touch, flights=flights)
        return replace(_middle(model, cycle, again), checkpoints=ball.checkpoints, heights=ball.heights)
    share, _ = closing(reference)
    path = ball.path + smoothstep(share) * (cycle.ahead(model, ball.path[:1]) - ball.path[-1])
    path[:, 2] = np.maximum(path[:, 2], ball.path[:, 2].min())
    return replace(ball, path=path)


def _as_written(model: Model, skill: Skill, reference: Reference, ball: Ball | None) -> Ball:
    """The ball with the contacts, checkpoints and heights that the file gives."""
    times = reference.timestep * np.arange(reference.frame_count)
    touch = np.zeros((len(times), 2), bool)
    for hand, name in enumerate(HANDS):
        for i, (start, end) in enumerate(skill.contact.get(name, ())):
            if start > reference.duration:
                reason = f"begins at {start} s, the clip lasts {reference.duration:.3f} s"
                raise SkillError(skill.source, f"contact.{name}[{i}]", reason)
            touch[:, hand] |= (times >= start - 1e-9) & (times <= end + 1e-9)
    if not skill.contact and ball is not None:
        touch = ball.touch
    late = [t for t in skill.checkpoints if t > reference.duration + reference.timestep]
    if late:
        reason = f"{late[0]} s is beyond the clip, which lasts {reference.duration:.3f} s"
        raise SkillError(skill.source, "contact.checkpoints", reason)
    hands = find_hands(model, reference)
    if ball is not None and ball.recorded:
        recorded, flights, path = True, ball.flights, ball.path
    else:
        recorded, flights = False, flights_of(touch)
        path = ball_path(hands, touch, flights)
    if skill.checkpoints:
        rows = tuple(min(round(t / reference.timestep), len(times) - 1) for t in skill.checkpoints)
    else:
        rows = find_checkpoints(path[:, 2], touch)
    heights = skill.heights or tuple(
        float(hands.centre[row, touch[row] if touch[row].any() else [True, True], 2].mean()) for row in rows
    )
    return Ball(path, touch, rows, heights, flights, recorded)
