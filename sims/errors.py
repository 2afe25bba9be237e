"""What is wrong with somebody's input, said so that every door can say it in its own words."""

from __future__ import annotations


class InputError(ValueError):
    """Input that cannot be used; the message is one line: where, and what is wrong.

    hint: key of what would put it right, as "out" for a folder or "frames" for a range, which the command
    line turns into an option and Python callers read as the argument's name."""

    def __init__(self, reason: str, where: object = "", hint: str = ""):
        self.where, self.reason, self.hint = str(where), " ".join(str(reason).split()), hint
        super().__init__(f"{self.where}: {self.reason}" if self.where else self.reason)
