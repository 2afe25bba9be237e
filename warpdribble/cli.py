"""The command line: `warpdribble simulate`, `warpdribble demo`, `warpdribble bench`, ...

Whatever is wrong with the input ends in one line on stderr that says what to do, and exit status 2. Where
nobody reads on, as behind `| head`, a command ends without a word, as others do.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from functools import reduce
from operator import or_
from typing import Annotated, Any

import tyro
from tyro.conf import OmitSubcommandPrefixes, subcommand

from .commands import COMMANDS, Command
from .commands.console import hang_up
from .commands.hints import HINTS, one_line

ABOUT = "Recorded motion becomes a simulated basketball player. Also: warpdribble bench."
CHOICES: Any = reduce(or_, (Annotated[command, subcommand(name)] for name, command in COMMANDS.items()))


UNHEARD = 128 + 13
"""Exit status, as a shell says it, of a program that SIGPIPE ends: whoever read its output has gone."""


def main(arguments: list[str] | None = None) -> int:
    """Run a command; the exit status."""
    try:
        status = _run(sys.argv[1:] if arguments is None else list(arguments))
        sys.stdout.flush()
    except BrokenPipeError as error:
        return UNHEARD if hang_up() else _complain(one_line(error))
    return status


def _run(arguments: list[str]) -> int:
    try:
        return _bench(arguments[1:]) if arguments[:1] == ["bench"] else _parse(arguments).run()
    except SystemExit as stop:
        if stop.code == 1 and hang_up():  # rich makes this of a broken pipe
            return UNHEARD
        return stop.code if isinstance(stop.code, int) else 2
    except BrokenPipeError:
        raise
    except (ValueError, OSError) as error:
        return _complain(one_line(error))
    except FloatingPointError as error:
        _complain(f"{one_line(error)}; {HINTS['root']}")
        return 1
    except KeyboardInterrupt:
        _complain("stopped")
        return 130


def _parse(arguments: list[str]) -> Command:
    """The command asked for; a mistake becomes one line. Raises SystemExit."""
    if {"-h", "--help"} & set(arguments):
        return _command(arguments)
    box, width = io.StringIO(), os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = "400"
    try:
        with contextlib.redirect_stderr(box):
            return _command(arguments)
    except SystemExit:
        _complain(_first_sentence(box.getvalue()) + " (see warpdribble --help)")
        raise
    finally:
        del os.environ["COLUMNS"]
        if width is not None:
            os.environ["COLUMNS"] = width


def _command(arguments: list[str]) -> Command:
    short = (OmitSubcommandPrefixes,)
    return tyro.cli(CHOICES, args=arguments, prog="warpdribble", description=ABOUT, config=short)


def _first_sentence(box: str) -> str:
    """What a framed message of tyro says before its first rule, as one line."""
    said = []
    for line in box.splitlines()[1:]:
        text = line.strip("│ ╭╮╰╯")
        if not text or set(text) == {"─"}:
            break
        said.append(text)
    return " ".join(" ".join(said).split()).rstrip(".") or "the command could not be understood"


def _complain(message: str) -> int:
    print(f"warpdribble: {message}", file=sys.stderr)
    return 2


def _bench(arguments: list[str]) -> int:
    from importlib import import_module

    try:
        bench = import_module(".benchmarks.command", __package__)
    except ModuleNotFoundError:
        return _complain("the benchmarks are not installed")
    return bench.main(arguments) or 0
