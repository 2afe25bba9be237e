"""From a skill to what is learned: a control graph of the player and the ball."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..assets import path as asset
from ..learning.evaluate.attempts import tracked_graph
from ..learning.graph import ControlGraph, cyclic_graph
from ..learning.tasks.fingers import with_ready_hands
from ..sims.errors import InputError
from ..sims.model import Model
from .skill import Skill
from .staged import stage_skill


def skill_fields(skill: Skill) -> dict[str, Any]:
    """What a run keeps of a skill, by key; where its file lies is not part of it."""
    return {key: value for key, value in asdict(skill).items() if key != "source"}


def skill_text(skill: Skill) -> str:
    """The file of a skill; what it would say, where it has none yet."""
    if not skill.is_clip:
        source = Path(skill.source)
        return (source if source.exists() else asset(str(source))).read_text(encoding="utf-8")
    paths = {key: str(Path(getattr(skill, key)).absolute()) for key in ("clip", "asf") if getattr(skill, key)}
    usual, said = asdict(Skill("", "")), skill_fields(skill) | paths
    contact = said.pop("contact") | {key: said.pop(key) for key in ("checkpoints", "heights") if said[key]}
    lines = [f"{key} = {json.dumps(value)}" for key, value in said.items() if value != usual[key]]
    lines += (
        ["[contact]", *(f"{key} = {json.dumps(value)}" for key, value in contact.items())] if contact else []
    )
    return "\n".join(lines) + "\n"


def skill_graph(skill: Skill, data: str | Path | None = None) -> tuple[ControlGraph, tuple[str, ...]]:
    """The graph of a cyclic skill, or of one that happens once, whose root is then held to it; and notes on
    it. data: folder of recordings, None for the usual one. Raises InputError."""
    player = Model.load("player")
    one = stage_skill(player, skill, data)
    reference = one.reference
    if one.ball is not None:
        plays = np.asarray(one.ball.touch.any(axis=0))
        reference = replace(reference, joint_q=with_ready_hands(player, reference.joint_q, plays))
    if one.cycle is not None:
        cycle = replace(one.cycle, reference=reference)
        return cyclic_graph(player, cycle, player.roles.both("feet"), skill.name, one.ball), one.notes
    if one.ball is None:
        reason = f"the skill '{skill.name}' is not cyclic, and no ball shows: locomotion is learned on cycles"
        raise InputError(reason, hint="closed" if skill.is_clip else "cyclic")
    notes = (*one.notes, "not cyclic: virtual forces hold the root, arms and ball are simulated")
    return tracked_graph(player, reference, ball=one.ball), notes
