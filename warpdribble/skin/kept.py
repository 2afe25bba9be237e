"""Skins that were built once, in the user's cache: the next process reads them."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Collection
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
import pooch

from ..sims.files import whole
from ..sims.model import Model

Arrays = dict[str, np.ndarray]


def folder() -> Path:
    """Where they are kept."""
    return Path(pooch.os_cache("warpdribble")) / "skins"


def kept(model: Model, bind_q: np.ndarray, names: Collection[str], build: Callable[[], Arrays]) -> Arrays:
    """What `build` returns, arrays of these names, built once for each model that looks so, and for each
    version of the code that builds. bind_q: (nbody, 7) the model's bind pose. A cache that cannot be read or
    written is none."""
    path = folder() / f"{_named(model, bind_q)}.npz"
    unreadable = contextlib.suppress(OSError, ValueError, KeyError, EOFError, BadZipFile)
    with unreadable, np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in names}
    arrays = build()
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as part, part.open("wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]
    return arrays


def _named(model: Model, bind_q: np.ndarray) -> str:
    """A name for what a skin depends on."""
    digest = hashlib.sha256(np.ascontiguousarray(bind_q).tobytes())
    digest.update("\n".join(model.body_names).encode())
    for shape in model.shapes:
        digest.update(f"{shape.name} {shape.body} {shape.kind}".encode())
        for part in (shape.size, shape.pos, shape.quat, shape.rgba):
            digest.update(np.asarray(part, float).tobytes())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:32]
