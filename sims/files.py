"""Files that are whole at any moment, whatever stops the program."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

PART = ".part-"
"""How the names of folders with files that are being written begin."""


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A temporary name for `path` to write to, in a folder beside it: the file takes the place of `path` at
    the end, on the disk by then, and is removed when anything fails.

    Files that a writer leaves beside the temporary name are moved along, first.
    """
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=PART) as folder:
        part = Path(folder) / path.name
        yield part
        for file in [*sorted(set(Path(folder).iterdir()) - {part}), part]:
            with open(file, "rb+") as written:
                os.fsync(written.fileno())
            os.replace(file, path.parent / file.name)


def sweep(folder: Path) -> None:
    """Remove what killed writers have left in a folder that nobody else writes to."""
    for left in folder.glob(f"{PART}*"):
        shutil.rmtree(left) if left.is_dir() else left.unlink()


def check_folder(folder: Path) -> None:
    """Make a folder where there is none, and see that it takes files. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass
