"""Links that leave the documentation: what they name becomes part of the site.

In the repository, pages link to files and folders beside `docs`. A site that opens from disk
anywhere has to bring these along: Markdown as pages, other texts as pages that show them, and
folders as pages that list them.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

from docs.make.pages import DOCS

ROOT = DOCS.parent
REPOSITORY = Path("repository")
"""Folder of the site for what is beside `docs`."""
LANGUAGES = {".py": "python", ".js": "js"}
"""Ending of a file -> language of its fence; others are named as their ending."""
FIRST_PAGES = ("index.md", "README.md")
"""Pages that stand for their folder, in the repository and on the site."""
HIDDEN = ("__pycache__", "bundle")
_FENCE = re.compile(r"(?ms)(^(?P<fence>`{3,}|~~~+)[^\n]*\n.*?^(?P=fence)[ ]*$)")
_LINK = re.compile(r"(?<=\]\()(?P<path>[^)\s#:]+)(?=[#)])")


def site_path(target: Path) -> Path:
    """Where the site has a file or folder of the repository, relative to its pages."""
    inside = target.is_relative_to(DOCS)
    path = target.relative_to(DOCS) if inside else REPOSITORY / target.relative_to(ROOT)
    if target.is_dir():
        return path / "index.md"
    if inside or target.suffix == ".md":
        return path
    return path.with_name(f"{path.name}.md")


def rewrite(source: Path, text: str, found: Callable[[Path], None]) -> str:
    """A page with its relative links as the site needs them.

    Args:
        source: The page's file in the repository.
        text: Its content.
        found: Receives each file or folder that is linked.
    """
    here = site_path(source).parent

    def replace(match: re.Match[str]) -> str:
        target = (source.parent / match["path"]).resolve()
        target = next(filter(Path.exists, (target / name for name in FIRST_PAGES)), target)
        if not target.exists():
            return match["path"]
        found(target)
        return Path(os.path.relpath(site_path(target), here)).as_posix()

    pieces = _FENCE.split(text)  # text, fence, its marks, text, ...
    return "".join(
        _LINK.sub(replace, piece) if number % 3 == 0 else piece
        for number, piece in enumerate(pieces)
        if number % 3 != 2
    )


def show(target: Path) -> str:
    """The page of a file or folder that is not Markdown."""
    title = f"# {target.relative_to(ROOT).as_posix()}\n\n"
    if target.is_dir():
        names = sorted(_name(item) for item in target.iterdir() if not _is_hidden(item))
        return title + "\n".join(f"* `{name}`" for name in names) + "\n"
    text = target.read_text(encoding="utf-8")
    language = LANGUAGES.get(target.suffix, target.suffix.removeprefix("."))
    return f"{title}```{language}\n{text.rstrip()}\n```\n"


def _name(item: Path) -> str:
    return f"{item.name}/" if item.is_dir() else item.name


def _is_hidden(item: Path) -> bool:
    return item.name in HIDDEN or item.name.startswith(".")
