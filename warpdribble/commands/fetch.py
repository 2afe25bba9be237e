"""`warpdribble fetch`: public recordings to work with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tyro.conf import Positional

from .console import bar, say


@dataclass
class Fetch:
    """Bring a public set of recordings, compared with known checksums; says its licence and citation."""

    name: Positional[Literal["cmu", "ballplay"]]
    """cmu: dribbling, walking and running, no ball (BVH). ballplay: basketball with a recorded ball."""
    to: Path | None = None
    """Folder to put it into; else $WARPDRIBBLE_DATA, else a folder in your cache."""
    mirror: str | None = None
    """Folder or URL that has the files already, instead of their public home."""

    def run(self) -> int:
        from ..clips.data import SETS, data_folder, entries, fetch

        folder = self.to or data_folder()
        about = SETS[self.name]
        for label, text in (
            ("data", about.title),
            ("home", about.home),
            ("licence", about.licence),
            ("cite", about.citation),
        ):
            say(f"{label:9} {text}")
        with bar(f"fetching {self.name}", len(entries(self.name))) as progress:
            files, unknown = fetch(self.name, folder, self.mirror, progress)
        say(f"{'files':9} {len(files)} in {folder}, checksums compared")
        if unknown:
            say(f"{'left out':9} {len(unknown)} without a known public address: {', '.join(unknown)}")
        return 0
