"""Measured parts of pages in docs/, between two markers."""

from __future__ import annotations

from pathlib import Path

BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"


def check_page(page: Path) -> None:
    """Raise SystemExit for a page without the markers, before anything is measured."""
    text = page.read_text(encoding="utf-8")
    if BEGIN not in text or END not in text:
        raise SystemExit(f"{page}: no markers '{BEGIN}' and '{END}'")


def write_measured(page: Path, measured: str) -> None:
    """Put text between the markers of a page."""
    head, rest = page.read_text(encoding="utf-8").split(BEGIN)
    page.write_text(f"{head}{BEGIN}\n\n{measured}\n\n{END}{rest.split(END)[1]}", encoding="utf-8")
