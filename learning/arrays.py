"""Arrays by name, as files have them: those of a part are "part.name"."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

Arrays = dict[str, np.ndarray]


def above(**parts: Mapping[str, np.ndarray]) -> Arrays:
    """The arrays of several parts as one."""
    return {f"{part}.{name}": value for part, arrays in parts.items() for name, value in arrays.items()}


def below(part: str, arrays: Mapping[str, np.ndarray]) -> Arrays:
    """Those of a part, as `above` got them; none where it is not there."""
    first = f"{part}."
    return {name.removeprefix(first): value for name, value in arrays.items() if name.startswith(first)}
