"""Skills: a part of a clip, which hand has the ball when, and what becomes of it on a model."""

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .graph import skill_fields, skill_graph, skill_text
    from .skill import Skill, SkillError, clip_skill, is_skill, parse_skill, read_skill, skill_names
    from .staged import StagedSkill, stage_skill

__all__ = [
    "Skill",
    "SkillError",
    "StagedSkill",
    "clip_skill",
    "is_skill",
    "parse_skill",
    "read_skill",
    "skill_fields",
    "skill_graph",
    "skill_names",
    "skill_text",
    "stage_skill",
]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".graph": "skill_fields skill_graph skill_text",
        ".skill": "Skill SkillError clip_skill is_skill parse_skill read_skill skill_names",
        ".staged": "StagedSkill stage_skill",
    },
)
