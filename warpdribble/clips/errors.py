"""What every reader of clips raises."""

from __future__ import annotations

from pathlib import Path

from ..sims.errors import InputError


class ClipError(InputError):
    """A clip that cannot be used; the message is one line with the file and the reason."""

    def __init__(self, path: str | Path, reason: str, hint: str = "") -> None:
        super().__init__(reason, path, hint)
        self.path = Path(path)
