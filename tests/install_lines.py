"""Which lines of documents and recipes install agentflow."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from agentflow.extras import DISTRIBUTION

ROOT = Path(__file__).parent.parent
PLACES = ("README.md", "CONTRIBUTING.md", "docs/**/*.md", "examples/*.md", "recipes/**/*.*")
CLONE = (".", "examples/pushing")
"""Folders of a clone that lines install."""


def install_lines() -> dict[tuple[str, ...], str]:
    """What `pip install` is given -> the page that shows it.

    Without requirements of other projects, and without folders of wheels.
    """
    pages = (path for place in PLACES for path in sorted(ROOT.glob(place)))
    return {
        given: page.relative_to(ROOT).as_posix()
        for page in pages
        for line in re.findall(r"\bpip install ([^`\n]+)", page.read_text(encoding="utf-8"))
        if (given := _ours(shlex.split(line, comments=True)))
    }


def _ours(given: list[str]) -> tuple[str, ...]:
    """Our part of it; () if other projects only are installed."""
    ours = [word for word in given if word in CLONE or word.startswith(DISTRIBUTION)]
    options = [word for word in given if word.startswith("-") and word != "--find-links"]
    return (*options, *ours) if ours else ()
