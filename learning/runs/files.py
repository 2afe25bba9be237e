"""Files that are whole at any moment, whatever stops the program."""

from __future__ import annotations

import contextlib
import os
import zipfile
import zlib
from pathlib import Path

import numpy as np

PART = ".part-"
"""Before the name of a file that is being written."""


@contextlib.contextmanager
def whole(path: Path):
    """A name beside `path` to write to, which takes its place at the end."""
    part = path.with_name(PART + path.name)
    yield part
    with open(part, "rb+") as file:
        os.fsync(file.fileno())
    os.replace(part, path)


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write an .npz file."""
    with whole(path) as part, open(part, "wb") as file:
        np.savez(file, **arrays)


@contextlib.contextmanager
def said_if_damaged(path: Path, remedy: str):
    """Turn whatever reading a damaged file raises into a ValueError of one line with the remedy."""
    try:
        yield
    except (FileNotFoundError, PermissionError):
        raise
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        OSError,
        KeyError,
        IndexError,
        TypeError,
        ValueError,
    ) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"{path} is damaged ({reason}): {remedy}") from None


def read_arrays(path: Path, remedy: str) -> dict[str, np.ndarray]:
    """All arrays of an .npz file. Raises ValueError, with the remedy, for a damaged one."""
    with said_if_damaged(path, remedy), np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}
