"""Files that ship with warpdribble: the player (MJCF), skills, mappings, controllers, the replay."""

from importlib.resources import files
from pathlib import Path


def path(name: str) -> Path:
    """Path of a shipped file, e.g. ``path("player.xml")``."""
    return Path(str(files(__name__) / name))
