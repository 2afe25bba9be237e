"""Arrays in files, what to do about damaged ones, and who holds a folder."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import time
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from ...sims.errors import InputError
from ...sims.files import whole

LOCK = "lock"
FAR_BEHIND = 1 << 30
"""Byte of the lock's file that Windows locks: behind all text, as what is locked there nobody else reads."""


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write an .npz file."""
    with whole(path) as part, open(part, "wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


def write_json(path: Path, value: Any) -> None:
    """Write a .json file."""
    with whole(path) as part:
        part.write_text(json.dumps(value, indent=2) + "\n", encoding="utf-8")


@contextlib.contextmanager
def said_if_damaged(path: Path, remedy: str, hint: str = "") -> Iterator[None]:
    """Turn whatever reading a damaged file raises into an InputError of one line with the remedy."""
    try:
        yield
    except (FileNotFoundError, PermissionError, InputError):
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
        raise InputError(f"is damaged ({reason}): {remedy}", path, hint) from None


def read_arrays(path: Path, remedy: str, hint: str = "") -> dict[str, np.ndarray]:
    """All arrays of an .npz file. Raises InputError, with the remedy, for a damaged one."""
    with said_if_damaged(path, remedy, hint), np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def mapped(path: Path, shape: tuple[int, ...], dtype: Any = np.float32) -> np.ndarray:
    """A file as an array, made where there is none: for what would be too large to write with every
    checkpoint. A checkpoint says how much of it counts; what was written later is written again."""
    if path.exists():
        with said_if_damaged(path, "learn again", "out"):
            array = np.lib.format.open_memmap(path, mode="r+")
        if array.shape != shape or array.dtype != dtype:
            raise InputError(f"has {array.shape} {array.dtype}, not {shape} {np.dtype(dtype)}", path, "out")
        return array
    return np.lib.format.open_memmap(path, mode="w+", dtype=dtype, shape=shape)


@contextlib.contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold a folder, so that no other process writes to it. Raises InputError that names who holds it."""
    path = folder / LOCK
    with open(path, "a+", encoding="utf-8") as file:
        if not _lock(file) or not _there(path, file):
            file.seek(0)
            holder = " ".join(file.read().split()) or "another process"
            raise InputError(f"is being written by {holder}: wait until it is done", folder, "out")
        file.seek(0)
        file.truncate()
        since = time.strftime("%Y-%m-%d %H:%M:%S")
        file.write(f"process {os.getpid()} on {socket.gethostname()} since {since}\n")
        file.flush()
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                path.unlink()


def _there(path: Path, file: IO[str]) -> bool:
    """Whether an open file is still the one of that name: who held it last may just have removed it."""
    with contextlib.suppress(FileNotFoundError):
        return os.path.samestat(os.stat(path), os.fstat(file.fileno()))
    return False


def _lock(file: IO[str]) -> bool:
    """Lock an open file until it is closed, whatever ends the process; whether that was possible."""
    try:
        import fcntl
    except ModuleNotFoundError:  # Windows
        import msvcrt

        os.lseek(file.fileno(), FAR_BEHIND, os.SEEK_SET)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        except OSError:
            return False
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
