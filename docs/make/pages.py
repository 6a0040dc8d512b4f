"""The pages of the documentation: the folders are the sections, first headings are the titles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).parents[1]
SECTIONS: Mapping[str, str] = {
    "tutorials": "Tutorials",
    "how-to": "How-to guides",
    "integrations": "Integrations",
    "reference": "Reference",
    "explanation": "Explanation",
    "results": "Results",
}
"""Folder -> title, in the order of the site."""
FIRST: Mapping[str, Sequence[str]] = {
    "tutorials": (
        "first-machine",
        "language-model",
        "experiment",
        "your-own-part",
        "train-a-model",
    ),
    "reference": ("command-line", "configuration", "python", "parts"),
}
"""Folder -> pages that come first, in this order; the others follow by title."""


@dataclass(frozen=True)
class Page:
    """One page."""

    path: Path
    """Relative to the folder of the documentation."""
    title: str


def pages_of(folder: str) -> list[Page]:
    """The pages of a section in their order."""
    first = FIRST.get(folder, ())
    pages = [read_page(path) for path in (DOCS / folder).glob("*.md")]

    def order(page: Page) -> tuple[int, str]:
        name = page.path.stem
        return first.index(name) if name in first else len(first), page.title

    return sorted(pages, key=order)


def read_page(path: Path) -> Page:
    """A page with the title of its first line."""
    line = path.read_text(encoding="utf-8").partition("\n")[0]
    if not line.startswith("# "):
        raise ValueError(f"{path.relative_to(DOCS)} must begin with its title, as in '# Tasks'")
    return Page(path.relative_to(DOCS), line.removeprefix("# "))
