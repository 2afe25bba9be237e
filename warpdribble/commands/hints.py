"""What the command line says for the hints that errors carry."""

from __future__ import annotations

from ..sims.errors import InputError

HINTS = {
    "out": "give another --out",
    "frames": "give other --frames",
    "cmu": "warpdribble fetch cmu brings it",
    "ballplay": "warpdribble fetch ballplay brings it",
    "learn": "warpdribble learn SKILL --out RUN learns one",
    "go on": "let it go on with the same warpdribble learn",
    "needs": "learn that one first, with --stage",
    "stage": "give another --stage",
    "run": "give a folder that warpdribble learn wrote",
    "closed": "with --cyclic its ends are made to meet, warpdribble skill draft CLIP finds where they do",
    "cyclic": "take one of those that warpdribble skill list says are",
    "root": "try --root tracked, or another clip",
    "mirror": "give another --mirror",
    "files": "with the files at hand give --mirror FOLDER",
    "units": "say which with --units",
    "up": "say which with --up",
    "rate": "say which with --rate",
    "repairs": "give others with --repair",
    "mapping": "give another --mapping",
    "contact": "say who has it when under [contact] in the skill's file",
    "method": "give another --method",
    "seed": "try another --seed",
    "set": "give another --set; the stage's config.json has the names",
}
"""Hint -> what it means here, for `sims.errors.InputError`."""


def one_line(error: Exception) -> str:
    """An error's message, in the words of the command line."""
    said = " ".join(str(error).split())
    hint = HINTS.get(error.hint) if isinstance(error, InputError) else None
    return f"{said}; {hint}" if hint else said
