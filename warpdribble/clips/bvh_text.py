"""What a BVH file says: its joints with their channels, its rows of numbers, its frame time.

Nobody owns the format, so what its writers make of it is read: any channels in any order at any joint, names
with blanks, any white space and line ends, rows that go over several lines, decimal commas.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from .errors import ClipError

WORD = re.compile(r"\s*((?:HIERARCHY|ROOT|JOINT|END|OFFSET|CHANNELS|MOTION)\b|[{}])", re.IGNORECASE)
NAME = re.compile(r"[^\n{}]*")
VALUE = re.compile(r"\s*([^\s{}]+)")
CHANNEL = re.compile(r"([xyz])(position|rotation)", re.IGNORECASE)
HEADER = re.compile(r"\s*Frames\s*:?\s*(\d+)\s+(?:Frame\s*Time\s*:?[ \t]*(\S*))?", re.IGNORECASE)
DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")
DECIMAL_POINT = re.compile(r"\d\.\d")


@dataclass
class Joint:
    """A joint, or the end of a chain."""

    name: str
    """All that follows ROOT or JOINT; empty for an end."""
    parent: int
    """Number of the joint above it, -1 for the root."""
    offset: list[float] = field(default_factory=list)
    """(3) file units."""
    channels: list[tuple[str, int]] = field(default_factory=list)
    """("position" or "rotation", axis 0 to 2), in the order of the file's numbers."""
    first: int = 0
    """Column of its first channel."""

    def columns(self, kind: str) -> list[tuple[int, int]]:
        """(axis, column of the rows) of its channels of a kind, in their order."""
        return [(axis, self.first + i) for i, (what, axis) in enumerate(self.channels) if what == kind]


@dataclass(frozen=True)
class BvhText:
    """The words of a file as numbers."""

    joints: list[Joint]
    """Parents first."""
    rows: np.ndarray
    """(frames, channels), file units and degrees; the joints' channels one after another."""
    frame_time: str
    """[s] as it is written, which shows how far it was rounded; empty where there is none."""
    notes: list[str]


def read_bvh_text(path: Path) -> BvhText:
    """Read a file's words. Raises ClipError for what is missing, is not BVH, or is cut short."""
    text, notes = _text(path)
    if DECIMAL_COMMA.search(text) and not DECIMAL_POINT.search(text):
        text = DECIMAL_COMMA.sub(".", text)
        notes.append("numbers have decimal commas")
    words = _Words(path, text)
    joints = _hierarchy(words)
    header = HEADER.match(text, words.at)
    if header is None:
        raise words.broken("'Frames: N' and 'Frame Time: T' should follow MOTION")
    stated = int(header[1])
    rows = _rows(path, text[header.end() :], sum(len(joint.channels) for joint in joints), stated)
    if len(rows) != stated:
        notes.append(f"the header says {stated} frames, there are {len(rows)}: all of these are read")
    return BvhText(joints, rows, header[2] or "", notes)


class _Words:
    """A text that is read from its beginning on."""

    def __init__(self, path: Path, text: str) -> None:
        self.path, self.text, self.at = path, text, 0

    def broken(self, reason: str) -> ClipError:
        line = self.text.count("\n", 0, self.at) + 1
        return ClipError(self.path, f"broken BVH: line {line}: {reason}")

    def word(self) -> str:
        """The next word of the format, in capitals."""
        found = WORD.match(self.text, self.at)
        if found is None:
            raise self.broken(f"{self._next()} is not expected")
        self.at = found.end()
        return found[1].upper()

    def name(self) -> str:
        """The rest of the line, up to a brace."""
        found = NAME.match(self.text, self.at)
        self.at = found.end() if found else self.at
        return found[0].strip() if found else ""

    def value(self) -> str:
        found = VALUE.match(self.text, self.at)
        if found is None:
            raise self.broken(f"{self._next()} in place of a value")
        self.at = found.end()
        return found[1]

    def number(self) -> float:
        word = self.value()
        try:
            return float(word)
        except ValueError:
            raise self.broken(f"'{word[:40]}' is no number") from None

    def _next(self) -> str:
        left = self.text[self.at : self.at + 200].split()
        return f"'{left[0][:40]}'" if left else "the file's end"


def _text(path: Path) -> tuple[str, list[str]]:
    """The file's text with plain line ends, and notes."""
    if not path.exists():
        raise ClipError(path, "no such file")
    if path.is_dir():
        raise ClipError(path, "is a folder, not a BVH file")
    if path.suffix.lower() != ".bvh":
        raise ClipError(path, f"only .bvh clips can be read, not '{path.suffix or path.name}'")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ClipError(path, error.strerror or "cannot be read") from None
    notes = []
    try:
        text = data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
        notes.append("the text is not UTF-8: names may have other letters than were meant")
    if "\0" in text:
        raise ClipError(path, "not a BVH file (binary data)")
    return text.replace("\r\n", "\n").replace("\r", "\n"), notes


def _hierarchy(words: _Words) -> list[Joint]:
    """The joints, up to the word MOTION."""
    first = WORD.match(words.text)
    if first is None or first[1].upper() != "HIERARCHY":
        raise ClipError(words.path, "no BVH file: it does not begin with HIERARCHY")
    words.at = first.end()
    joints: list[Joint] = []
    inside: list[int] = []  # those whose braces are open
    named = False  # a joint was named, and its brace is to come
    while (word := words.word()) != "MOTION" or inside or named:
        if named != (word == "{") or (word == "MOTION" and inside):
            raise words.broken("the braces of the hierarchy do not match")
        if word == "{":
            inside.append(len(joints) - 1)
            named = False
        elif word == "ROOT" and joints:
            raise words.broken("a second ROOT; a clip holds one skeleton")
        elif word != "ROOT" and not inside:
            raise words.broken(f"{word} outside of the root's braces")
        elif word in ("ROOT", "JOINT", "END"):
            name = words.name()
            if word != "END" and not name:
                raise words.broken(f"{word} without a name")
            joints.append(Joint("" if word == "END" else name, inside[-1] if inside else -1))
            named = True
        elif word == "}":
            if not joints[inside.pop()].offset:
                raise words.broken("the joint has no OFFSET")
        elif word == "OFFSET":
            joints[inside[-1]].offset = [words.number() for _ in range(3)]
        elif word == "CHANNELS" and not joints[inside[-1]].channels:
            joints[inside[-1]].channels = _channels(words)
        else:
            raise words.broken(f"{word} is not expected")
    if not joints:
        raise words.broken("the hierarchy has no joints")
    first_column = 0
    for joint in joints:
        joint.first = first_column
        first_column += len(joint.channels)
    return joints


def _channels(words: _Words) -> list[tuple[str, int]]:
    count = words.value()
    if not (count.isdecimal() and len(count) < 3):
        raise words.broken(f"'{count[:40]}' channels")
    channels: list[tuple[str, int]] = []
    for _ in range(int(count)):
        word = words.value()
        found = CHANNEL.fullmatch(word)
        if found is None:
            raise words.broken(f"'{word[:40]}' is no channel: Xposition, Zrotation and so on are")
        channels.append((found[2].lower(), "xyz".index(found[1].lower())))
    places = [axis for kind, axis in channels if kind == "position"]
    turns = [axis for kind, axis in channels if kind == "rotation"]
    if len(set(places)) < len(places) or len(turns) > 3 or any(a == b for a, b in pairwise(turns)):
        raise words.broken("a channel stands there twice")
    return channels


def _rows(path: Path, text: str, width: int, stated: int) -> np.ndarray:
    """The numbers behind the header (frames, width): a line each, or, where lines were wrapped, as many as
    there are channels."""
    lines = [words for line in text.split("\n") if (words := line.split())]
    odd = next((i for i, words in enumerate(lines) if len(words) != width), None)
    count = sum(map(len, lines))
    if odd is not None and count != stated * width:
        has = f"row {odd + 1} of {stated} has {len(lines[odd])} numbers, the joints have {width} channels"
        raise ClipError(path, f"broken BVH, or cut short: {has}")
    if not count:
        raise ClipError(path, "broken BVH: it has no frames")
    if count < stated * width and not text.endswith("\n"):
        raise ClipError(path, f"broken BVH: cut short, it ends in row {len(lines)} of {stated}")
    try:
        return np.array([float(word) for words in lines for word in words]).reshape(-1, width)
    except ValueError as error:
        raise ClipError(path, f"broken BVH: {str(error)[:80]} in the rows") from None
