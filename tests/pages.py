"""The pages that state facts about the code, and how tests read them."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for place in (
        "*.md",
        "docs/**/*.md",
        "examples/*.md",
        "configs/**/*.yaml",
        "tests/messages.txt",
    )
    for path in sorted(ROOT.glob(place))
}
"""Text by path from the root of the repository; the messages are all help and all errors."""


def page(name: str) -> str:
    """The text of the page with a name, in whichever folder it is."""
    (text,) = (text for path, text in PAGES.items() if path.endswith(f"/{name}"))
    return text


def rows(text: str) -> list[list[str]]:
    """The cells of each row of its tables."""
    lines = (line for line in text.splitlines() if line.startswith("| "))
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]


def named(text: str) -> set[str]:
    """Words in backticks."""
    return set(re.findall(r"`([\w./-]+)`", text))
