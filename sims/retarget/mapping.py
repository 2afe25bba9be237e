"""Which joint of a recording is which body of the player: mapping files (TOML), shipped and a user's own."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal

from ...assets import path as asset
from ..model import Model
from ..recording.motion import Motion
from ..recording.names import bare

RESTS = ("told", "recorded", "directions")
SHIPPED = ("cmu", "ballplay", "mixamo", "lafan")


class MappingError(ValueError):
    """A mapping that cannot be used; the message is one line with the file, the key and the reason."""


@dataclass(frozen=True)
class Mapping:
    """One kind of skeleton. Names on the left are the model's, on the right the recording's."""

    name: str
    """Shipped name, or the file's path."""
    bodies: dict[str, str]
    """Body -> joint whose rotation it follows."""
    arms: dict[str, tuple[str, str, str]]
    """Elbow hinge -> joints at the shoulder, the elbow and the wrist."""
    legs: dict[str, tuple[str, str, str]]
    """Knee hinge -> joints at the hip, the knee and the ankle; their lengths set the scale."""
    points: dict[str, str] = field(default_factory=dict)
    """Further bodies whose origin lies where that joint is; limbs are known from `arms` and `legs`."""
    palms: dict[str, tuple[str, str, str, str]] = field(default_factory=dict)
    """Hand -> wrist, index, middle and little knuckle, whose places are trusted more than rotations."""
    supinated: dict[str, float] = field(default_factory=dict)
    """Hand of `palms` -> [deg] by which its palm turns further to the thumb's side, about where the fingers
    point, for recordings that are known to pronate hands too much."""
    smoothed: dict[str, float] = field(default_factory=dict)
    """Body -> cut-off [Hz] of a low-pass filter, for joints the recording shows with noise."""
    rest: Literal["told", "recorded", "directions"] = "told"
    """The T-pose: told from where the bones point, as the motion has it, or built from their directions."""
    description: str = ""

    @property
    def limbs(self) -> dict[str, tuple[str, str, str]]:
        return self.legs | self.arms

    def joints(self) -> dict[str, str]:
        """Joint of the recording -> the key of the file that names it."""
        named = {joint: f"bodies.{body}" for body, joint in self.bodies.items()}
        for table in ("points", "arms", "legs", "palms"):
            for key, joints in getattr(self, table).items():
                for joint in (joints,) if isinstance(joints, str) else joints:
                    named.setdefault(joint, f"{table}.{key}")
        return named

    def plain(self, motion: Motion) -> Motion:
        """The motion with the names of this mapping. Raises MappingError for joints that are not in it."""
        if missing := self.missing(motion):
            key, others = self.joints()[missing[0]], f", nor {_some(missing[1:])}" if missing[1:] else ""
            raise MappingError(
                f"{self.name}: {key}: no joint '{missing[0]}' in this motion{others}; "
                f"it has {', '.join(motion.joint_names)}"
            )
        return replace(motion, joint_names=self._named(motion))

    def missing(self, motion: Motion) -> list[str]:
        """Joints that are named here and are not in the motion, whatever namespace it has."""
        names = self._named(motion)
        return [joint for joint in self.joints() if joint not in names]

    def _named(self, motion: Motion) -> tuple[str, ...]:
        """The motion's names, those that are ours but for a namespace as they are named here."""
        own = tuple(self.joints())
        if set(own) <= set(motion.joint_names):
            return motion.joint_names
        ours = dict(zip(bare(own), own))
        return tuple(
            ours.get(short, name) for short, name in zip(bare(motion.joint_names), motion.joint_names)
        )

    def check_model(self, model: Model) -> None:
        """Raise MappingError for a body or hinge that the model does not have, or a hand without knuckles."""
        for table, there in (
            ("bodies", model.body_names),
            ("points", model.body_names),
            ("palms", model.body_names),
            ("supinated", self.palms),
            ("smoothed", model.body_names),
            ("arms", model.joint_names),
            ("legs", model.joint_names),
        ):
            for key in getattr(self, table):
                if key not in there:
                    what = "joint" if table in ("arms", "legs") else "body"
                    who = "palms has" if table == "supinated" else "the model has"
                    has = ", ".join(there) or "none"
                    raise MappingError(f"{self.name}: {table}.{key}: {who} no {what} '{key}'; it has {has}")
        for hand in self.palms:
            if (hand, 3) not in [(h, len(k)) for h, k in zip(model.roles.hands, model.roles.knuckles)]:
                reason = f"{model.path} does not say which bodies are its knuckles, or that it is a hand"
                raise MappingError(f"{self.name}: palms.{hand}: {reason}")


def read_mapping(name: str | Path) -> Mapping:
    """A shipped mapping by name, or a file by path. Raises MappingError."""
    if str(name) in SHIPPED:
        return parse_mapping(asset(f"mappings/{name}.toml").read_text(encoding="utf-8"), str(name))
    path = Path(name)
    if path.suffix.lower() != ".toml":
        raise MappingError(f"{name}: a mapping is {', '.join(SHIPPED)}, or the path of a .toml file")
    try:
        return parse_mapping(path.read_text(encoding="utf-8"), str(name))
    except FileNotFoundError:
        raise MappingError(f"{name}: no such file") from None
    except UnicodeDecodeError:
        raise MappingError(f"{name}: not a TOML file (binary data)") from None
    except OSError as error:
        raise MappingError(f"{name}: {error.strerror or error}") from None


def parse_mapping(text: str, name: str) -> Mapping:
    """A mapping from the text of its file. Raises MappingError naming the file, the key and the reason."""
    try:
        data = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise MappingError(f"{name}: not TOML: {' '.join(str(error).split())}") from None
    known = {f.name for f in fields(Mapping)} - {"name"}
    for key in data:
        if key not in known:
            raise MappingError(f"{name}: {key}: unknown key; there are {', '.join(sorted(known))}")
    out: dict[str, Any] = {"name": name}
    for key in ("bodies", "arms", "legs"):
        if not data.get(key):
            raise MappingError(f"{name}: {key}: missing")
    for key, value in data.items():
        if key in ("description", "rest"):
            _expect(isinstance(value, str), name, key, "should be a text")
            out[key] = value
        else:
            _expect(isinstance(value, dict), name, key, "should be a table")
            out[key] = {k: _entry(name, key, k, v) for k, v in value.items()}
    _expect(out.get("rest", "told") in RESTS, name, "rest", ", ".join(RESTS))
    return Mapping(**out)


def find_mapping(motion: Motion) -> Mapping:
    """The shipped mapping that names joints of this motion only. Raises MappingError when none does."""
    missing: dict[str, list[str]] = {}
    for name in SHIPPED:
        mapping = read_mapping(name)
        missing[name] = mapping.missing(motion)
        if not missing[name]:
            return mapping
    near = min(SHIPPED, key=lambda name: len(missing[name]))
    raise MappingError(
        f"unknown joints: of the shipped mappings {near} comes nearest, and lacks {_some(missing[near])}; "
        f"write one and give it. The motion has {_some(motion.joint_names)}"
    )


def _some(names: Sequence[str], most: int = 12) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def _entry(name: str, table: str, key: str, value: Any) -> Any:
    place = f"{table}.{key}"
    if table == "smoothed":
        number = isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < 1e4
        _expect(number, name, place, "should be a frequency in Hz")
        return float(value)
    if table == "supinated":
        number = isinstance(value, int | float) and not isinstance(value, bool) and -180.0 <= value <= 180.0
        _expect(number, name, place, "should be an angle from -180 to 180 degrees")
        return float(value)
    if table in ("bodies", "points"):
        _expect(isinstance(value, str), name, place, "should be the name of a joint")
        return value
    count = 4 if table == "palms" else 3
    named = isinstance(value, list) and len(value) == count and all(isinstance(v, str) for v in value)
    _expect(named, name, place, f"should be a list of {count} names of joints")
    return tuple(value)


def _expect(true: bool, name: str, key: str, reason: str) -> None:
    if not true:
        raise MappingError(f"{name}: {key}: {reason}")
