"""What the site shows beside the pages of this folder: the API, the commands, the changelog.

MkDocs calls these functions (`hooks` in mkdocs.yml). The pages themselves stay as GitHub shows them: info
strings of the tests and links out of this folder are put right here.
"""

import contextlib
import io
import os
import re
import typing
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
API = ["sims", "sims.terms", "sims.watch", "learning", "kernels", "clips", "skills", "takes", "web", "gym"]
"""Below warpdribble, what has a page below reference/ with its public names."""
WHERE = {"sims.terms": "sims.worlds.terms", "sims.watch": "sims.worlds.watch"}
"""Modules that are public names of a package elsewhere -> where they are."""
OUTWARD = re.compile(r"\]\(\.\./([^)#\s]+)")


def on_files(files: Files, config: Any) -> Files:
    """Adds the pages that are made, and the files out of this folder that pages link to."""
    made = {
        f"reference/{name}.md": f"# warpdribble.{name}\n\n::: warpdribble.{WHERE.get(name, name)}\n"
        for name in API
    }
    made["reference/commands.md"] = commands_page()
    made["changelog.md"] = (ROOT / "CHANGELOG.md").read_text().replace("](docs/", "](")
    for path, text in made.items():
        files.append(File.generated(config, path, content=text))
    linked = {path for file in files.documentation_pages() for path in OUTWARD.findall(file.content_string)}
    for path in sorted(linked - {"CHANGELOG.md"}):
        files.append(File.generated(config, f"tree/{path}", abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """A page as MkDocs reads it."""
    markdown = re.sub(r"^```python \w.*$", "```python", markdown, flags=re.M)
    return OUTWARD.sub(r"](tree/\1", markdown.replace("](../CHANGELOG.md", "](changelog.md"))


def commands_page() -> str:
    """The command line's own help, a heading and a table a command."""
    from warpdribble.benchmarks.command import COMMANDS as BENCHES
    from warpdribble.commands import COMMANDS

    parts = ["# Commands", "What `warpdribble COMMAND --help` says."]
    for name, command in [*COMMANDS.items(), *((f"bench {name}", bench) for name, bench in BENCHES.items())]:
        for words in below(name, command):
            parts += [f"## warpdribble {words}", help_of(words)]
    return "\n\n".join(parts) + "\n"


def below(words: str, command: Any) -> Iterator[str]:
    """A command's words, or those of the commands that it is a group of."""
    hints = typing.get_type_hints(command, include_extras=True)
    choices = [hints[field.name] for field in fields(command)]
    groups = [typing.get_args(one) for kind in choices for one in typing.get_args(kind)]
    found = [(kind[0], kind[1].name) for kind in groups if kind and is_dataclass(kind[0])]
    if not found:
        yield words
    for kind, name in found:
        yield from below(f"{words} {name}", kind)


def help_of(words: str) -> str:
    """What a command's --help prints, as a sentence and a table of what may be given."""
    usage, about, *blocks = said(words).split("\n\n")
    rows: list[list[str]] = []
    for line in "\n".join(blocks).splitlines():
        if found := re.fullmatch(r"  (-{0,2}[A-Za-z{[].*?)(?:  +(.*))?", line):
            rows.append([found[1], found[2] or ""])
        elif rows and line.startswith(" " * 6):
            rows[-1][1] += " " + line.strip()
    table = [
        f"| `{option_of(option)}` | {text_of(text)} |"
        for option, text in rows
        if option.startswith("--") or option in usage.split(" ")
    ]
    return "\n".join([about, "", "| | |", "|---|---|", *table] if table else [about])


def option_of(said: str) -> str:
    """An option without what tyro says of None."""
    return re.sub(r"\{None\}\|", "", said.replace("{None,", "{")).replace("|", "\\|")


def text_of(said: str) -> str:
    """A sentence for a table; that nothing is given where nothing is given need not be said."""
    said = said.replace("(default: None)", "").replace("|", "\\|").replace("<", "&lt;")
    return re.sub(r"([*_])", r"\\\1", said).strip()


def said(words: str) -> str:
    """The help itself, every paragraph on one line."""
    from warpdribble.cli import main

    text, before = io.StringIO(), dict(os.environ)
    os.environ |= {"COLUMNS": "1000", "NO_COLOR": "1", "TERM": "dumb"}
    try:
        with contextlib.redirect_stdout(text):
            main([*words.split(), "--help"])
    finally:
        os.environ.clear()
        os.environ |= before
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines())
