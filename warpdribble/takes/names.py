"""Names of bodies and joints as names of prims."""

from __future__ import annotations

import re


def prim_name(name: str) -> str:
    """A name as a legal USD prim name."""
    return re.sub(r"^(?=\d)|[^A-Za-z0-9_]", "_", name) or "_"


def prim_names(names: list[str]) -> dict[str, str]:
    """Legal prim names, no two alike, by name."""
    taken, given = {"Joints", "Skin"}, {}
    for name in dict.fromkeys(names):
        legal, number = prim_name(name), 1
        while legal in taken:
            number += 1
            legal = f"{prim_name(name)}_{number}"
        taken.add(legal)
        given[name] = legal
    return given
