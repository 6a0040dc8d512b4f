"""Pieces of Markdown that all generated pages share."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

COMMAND = "scripts/docs reference"
"""The command that writes the generated pages again."""


def generated(title: str, *paragraphs: str) -> str:
    """The head of a generated page."""
    note = f"This page is made from the code by `{COMMAND}`. Do not edit it by hand."
    return blocks(f"# {title}", *paragraphs, note)


def blocks(*parts: str) -> str:
    """Parts with an empty line in between; empty parts are left out."""
    return "\n\n".join(part.strip("\n") for part in parts if part)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of cells that are Markdown already; "" without rows."""
    lines = [_row(row) for row in rows]
    return "\n".join([_row(head), "|" + "---|" * len(head), *lines]) if lines else ""


def code(text: str) -> str:
    """Text in a code span; "" stays empty."""
    return f"`{text}`" if text else ""


def fence(language: str, text: str) -> str:
    """A fenced block."""
    return f"```{language}\n{text}\n```"


def anchor(heading: str) -> str:
    """The identifier that GitHub and the site give to a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


def sentence(text: str) -> str:
    """A text as a sentence: with a capital and a full stop, on one line."""
    line = " ".join(text.split())
    first = line.partition(" ")[0]
    if first.islower() and first.rstrip(",;").isalpha():
        line = line[0].upper() + line[1:]
    return line if line.endswith((".", "!", "?", "...")) or not line else line + "."


def _row(cells: Sequence[str]) -> str:
    if any("|" in cell for cell in cells):
        raise ValueError(f"renderers differ on | in a table: write {cells} without it")
    return f"| {' | '.join(cells)} |"
