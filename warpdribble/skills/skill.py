"""Skills: small TOML files that say which part of which clip is learned, and which hand has the ball when.

`read_skill` reads one by name or path, `stage_skill` makes it a reference with its ball. Every mistake in a
file is one line: file, key, reason.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, fields
from itertools import pairwise
from pathlib import Path
from typing import Any

from ..assets import path as asset
from ..sims.errors import InputError

HANDS = ("left", "right")
CONTACT_KEYS = (*HANDS, "checkpoints", "heights")


class SkillError(InputError):
    """A skill that cannot be used; the message is one line with the file, the key and the reason."""

    def __init__(self, source: str | Path, key: str, reason: str, hint: str = "") -> None:
        super().__init__(f"{key}: {reason}" if key else reason, source, hint)
        self.source, self.key = str(source), key


@dataclass(frozen=True)
class Skill:
    """One skill, as its file says. Times are seconds from the first frame."""

    name: str
    source: str
    """The file it was read from."""
    description: str = ""
    clip: str = ""
    """Path of a recording, relative to the data folder or absolute; or empty, and then:"""
    authored: str = ""
    """Name of an authored clip."""
    frames: tuple[int, int] = (0, -1)
    """First and last of the clip, both included; -1 is the clip's last."""
    ball: bool = True
    """false: a skill without a ball, whatever the hands look like."""
    cyclic: bool = False
    mirror: bool = False
    mapping: str = ""
    """Of the clip's joints: shipped name or file; empty for the shipped one that fits."""
    repairs: str = ""
    """Of the clip, joined by commas."""
    units: str = ""
    """Of the clip's lengths, and"""
    up: str = ""
    """which of its axes points up, and"""
    asf: str = ""
    """the skeleton of an .amc clip, and"""
    rate: float = 0.0
    """[Hz] in place of the file's: as `clips.read_clip` takes them, or empty, or 0."""
    drop_positions: bool = False
    """Of .bvh joints other than the root."""
    contact: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    """"left" and "right" -> (from, to) [s] in which that hand has the ball; empty: inferred."""
    checkpoints: tuple[float, ...] = ()
    """[s], where the ball is highest; empty: inferred."""
    heights: tuple[float, ...] = ()
    """[m], the ball's at each checkpoint (h_ref of P1 Eq. 8); empty: from the hand."""

    @property
    def is_clip(self) -> bool:
        """Whether it has no file: a part of a clip, on its way to become a skill."""
        return bool(self.clip) and self.source == self.clip


def clip_skill(clip: str | Path, frames: tuple[int, int] = (0, -1), **rest: Any) -> Skill:
    """A part of a clip as a skill that has no file yet. rest: fields of `Skill`; None: its default."""
    path = str(clip)
    rest = {key: value for key, value in rest.items() if value is not None}
    first, last = frames
    part = f"frames {first} to {'the last' if last < 0 else last}"
    return Skill(Path(clip).stem, path, f"{Path(clip).name}, {part}", path, frames=frames, **rest)


def skill_names() -> list[str]:
    """The skills that ship."""
    return sorted(p.name.removesuffix(".toml") for p in asset("skills").iterdir() if p.suffix == ".toml")


def is_skill(name: str | Path) -> bool:
    """Whether this names a skill and no clip: a .toml file, or a name that is no file."""
    path = Path(name)
    return path.suffix.lower() == ".toml" or str(name) in skill_names() or not (path.suffix or path.exists())


def read_skill(name: str | Path) -> Skill:
    """A shipped skill by name, or one by the path of its file. Raises SkillError."""
    if Path(name).suffix.lower() != ".toml":
        names = skill_names()
        if str(name) not in names:
            raise SkillError(name, "", f"no such skill; there are {', '.join(names)}, or give a .toml file")
        return parse_skill(asset(f"skills/{name}.toml").read_text(encoding="utf-8"), f"skills/{name}.toml")
    try:
        return parse_skill(Path(name).read_text(encoding="utf-8"), str(name))
    except FileNotFoundError:
        raise SkillError(name, "", "no such file") from None
    except UnicodeDecodeError:
        raise SkillError(name, "", "not a TOML file (binary data)") from None
    except OSError as error:
        raise SkillError(name, "", error.strerror or str(error)) from None


def parse_skill(text: str, source: str) -> Skill:
    """A skill from the text of its file. Raises SkillError."""
    try:
        data = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise SkillError(source, "", f"not TOML: {' '.join(str(error).split())}") from None
    known = {f.name for f in fields(Skill)} - {"source", "checkpoints", "heights"}
    for key in data:
        if key not in known:
            raise SkillError(source, key, f"unknown key; there are {', '.join(sorted(known))}")
    out: dict[str, Any] = {"source": source}
    for key, value in data.items():
        if key == "frames":
            good = isinstance(value, list) and len(value) == 2 and all(type(v) is int for v in value)
            _expect(good, source, key, "should be the first and the last frame, two whole numbers")
            first, last = value
            reason = f"{first} to {last} is no range: two rising numbers from 0, or -1 for the last"
            _expect(first >= 0 and (last == -1 or first < last), source, key, reason)
            out[key] = tuple(value)
        elif key in ("ball", "cyclic", "mirror", "drop_positions"):
            _expect(isinstance(value, bool), source, key, "should be true or false")
            out[key] = value
        elif key == "rate":
            out[key] = _number(source, key, value)
        elif key == "contact":
            out |= _contact(source, value)
        else:
            _expect(isinstance(value, str), source, key, "should be a text")
            out[key] = value
    _expect(bool(out.get("name")), source, "name", "missing")
    if bool(out.get("clip")) == bool(out.get("authored")):
        raise SkillError(source, "clip", "give either clip or authored, one of the two")
    return Skill(**out)


def _contact(source: str, table: Any) -> dict[str, Any]:
    _expect(isinstance(table, dict), source, "contact", "should be a table")
    out: dict[str, Any] = {"contact": {}}
    for key, value in table.items():
        place = f"contact.{key}"
        _expect(key in CONTACT_KEYS, source, place, f"unknown key; there are {', '.join(CONTACT_KEYS)}")
        _expect(isinstance(value, list), source, place, "should be a list")
        if key in HANDS:
            spans = [_span(source, f"{place}[{i}]", span) for i, span in enumerate(value)]
            for (_, end), (start, _) in pairwise(spans):
                _expect(end <= start, source, place, f"{start} s begins before the span before it ends")
            out["contact"][key] = spans
        else:
            numbers = [_number(source, f"{place}[{i}]", v) for i, v in enumerate(value)]
            out[key] = tuple(numbers)
    if "heights" in out and len(out["heights"]) != len(out.get("checkpoints", ())):
        raise SkillError(source, "contact.heights", "should have one number for each checkpoint")
    return out


def _span(source: str, place: str, span: Any) -> tuple[float, float]:
    _expect(isinstance(span, list) and len(span) == 2, source, place, "should be [from, to] in seconds")
    start, end = (_number(source, place, v) for v in span)
    _expect(start < end, source, place, f"{start} to {end} s is no range")
    return start, end


def _number(source: str, place: str, value: Any) -> float:
    number = isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value < 1e4
    _expect(number, source, place, "should be a number from 0")
    return float(value)


def _expect(true: bool, source: str, key: str, reason: str) -> None:
    if not true:
        raise SkillError(source, key, reason)
