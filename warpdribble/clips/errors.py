"""What every reader of clips raises."""

from __future__ import annotations

from pathlib import Path


class ClipError(ValueError):
    """A clip that cannot be used; the message is one line with the file and the reason."""

    def __init__(self, path: str | Path, reason: str) -> None:
        reason = " ".join(str(reason).split())
        super().__init__(f"{path}: {reason}")
        self.path, self.reason = Path(path), reason
