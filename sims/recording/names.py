"""Joints' names without their namespace: mixamorig1:Hips, Character1_Hips and Bip01 Pelvis have one."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

SPACE = re.compile(r".*[:|]")
EDGE = re.compile(r"(?<=[:|_ .-])(?=.)|(?<=[a-z0-9])(?=[A-Z])")
SIDES = {"l", "r", "left", "right"}
"""Words that are no namespace, however many names begin with them."""
SHARE = 0.6
"""of the joints have a namespace at least; props and a root may go without."""


def bare(names: Sequence[str]) -> tuple[str, ...]:
    """The names with their namespace taken off, where they stay different by that: what stands before the
    last `:` or `|`, and what most of them begin with, up to a separator or a capital letter."""
    short = _taken_off(names, [SPACE.sub("", name) for name in names])
    begin = Counter(name[: edge.start()] for name in short for edge in EDGE.finditer(name))
    shared = [start for start, count in begin.items() if count > SHARE * len(short) and not _sided(start)]
    space = max(shared, key=len, default="")
    return _taken_off(short, [name.removeprefix(space) for name in short])


def _taken_off(names: Sequence[str], short: Sequence[str]) -> tuple[str, ...]:
    return tuple(short if all(short) and len(set(short)) == len(set(names)) else names)


def _sided(start: str) -> bool:
    return bool(SIDES & {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", start)})
