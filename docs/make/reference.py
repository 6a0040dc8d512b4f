"""Writes the generated pages and inserts: `python -m docs.make.reference`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from docs.make import command_line, configuration, parts, python
from docs.make.inserts import fill
from docs.make.pages import DOCS

PAGES: Mapping[str, Callable[[], str]] = {
    "reference/command-line.md": command_line.page,
    "reference/configuration.md": configuration.page,
    "reference/parts.md": parts.page,
    "reference/python.md": python.page,
}
"""Pages that are generated as a whole."""


def reference() -> dict[Path, str]:
    """Every page that is generated or holds inserts, as the code has it now."""
    filled = {path: fill(path.read_text(encoding="utf-8")) for path in sorted(DOCS.rglob("*.md"))}
    return filled | {DOCS / name: page() for name, page in PAGES.items()}


def outdated() -> dict[Path, str]:
    """The pages whose files differ from the code, as they should be."""
    return {
        path: text
        for path, text in reference().items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    }


def main() -> None:
    """Write the pages that differ, and print their names."""
    for path, text in outdated().items():
        path.write_text(text, encoding="utf-8")
        print(path.relative_to(DOCS.parent))


if __name__ == "__main__":
    main()
