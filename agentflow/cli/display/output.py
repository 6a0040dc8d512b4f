"""Owns standard output for a person: text by others is shown, and never obeyed by the terminal."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

from agentflow.cli.display.text import harmless


class Output(Console):
    """Standard output; a reader who has had enough is left to cli.main."""

    def print(self, *objects: Any, **options: Any) -> None:
        """As ever, but strings without what a terminal would obey."""
        shown = (harmless(item, "\n") if isinstance(item, str) else item for item in objects)
        super().print(*shown, **options)

    def on_broken_pipe(self) -> None:
        """Instead of ending the process with status 1."""
        raise BrokenPipeError


class Cells(Table):
    """A table of plain strings; see `Output.print`."""

    def add_row(self, *cells: Any, **options: Any) -> None:
        """As ever, with harmless strings."""
        super().add_row(*(harmless(c) if isinstance(c, str) else c for c in cells), **options)


def output() -> Output:
    """Standard output, without markup and without wrapping."""
    return Output(highlight=False, soft_wrap=True, markup=False)


def columns(*names: str) -> Cells:
    """An empty table."""
    table = Cells(box=None, pad_edge=False, header_style="bold")
    for name in names:
        table.add_column(name, overflow="fold")  # a number that is cut reads as another one
    return table
