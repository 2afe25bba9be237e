"""From a skill to what is learned: a control graph of the player without a ball."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

from ..assets import path as asset
from ..learning.graph import ControlGraph, cyclic_graph
from ..learning.tasks.locomotion import locomotion_model
from ..sims import Model
from .skill import Skill
from .staged import stage_skill


def skill_fields(skill: Skill) -> dict:
    """What a run keeps of a skill, by key; where its file lies is not part of it."""
    return {key: value for key, value in asdict(skill).items() if key != "source"}


def skill_text(name: str | Path) -> str:
    """The file of a skill, by name or path as `skills.skill` takes it."""
    if Path(name).suffix.lower() == ".toml":
        return Path(name).read_text(encoding="utf-8")
    return asset(f"skills/{name}.toml").read_text(encoding="utf-8")


def check_cyclic(skill: Skill) -> None:
    """Raise ValueError for a skill that is done once."""
    if not skill.cyclic:
        raise ValueError(
            f"the skill '{skill.name}' is not cyclic: locomotion is learned on cycles, "
            "those that warpdribble skill list says are"
        )


def skill_graph(skill: Skill, data: str | Path | None = None) -> tuple[ControlGraph, tuple[str, ...]]:
    """The graph of a cyclic skill, and notes on it. data: folder of recordings, None for the usual one.
    Raises ValueError."""
    check_cyclic(skill)
    player, model = Model.load("player"), locomotion_model()
    one = stage_skill(player, skill, data)
    joint_q = model.convert_q(player, one.cycle.reference.joint_q)
    cycle = replace(one.cycle, reference=replace(one.cycle.reference, joint_q=joint_q))
    return cyclic_graph(model, cycle), one.notes
