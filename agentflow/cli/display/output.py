"""Terminal output in which control characters from models and files are escaped."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table

from agentflow.cli.display.text import escape_controls

LONG = 1000
"""Width in characters for tables of paths, so that no path is wrapped or cut."""


class SafeConsole(Console):
    """A console that escapes control characters in whatever it renders, except line breaks."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print; strings are escaped before rich, which drops some characters, sees them."""
        shown = (escape_controls(item, "\n") if isinstance(item, str) else item for item in objects)
        super().print(*shown, **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Render; only rich itself controls the terminal."""
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(escape_controls(segment.text, "\n"), segment.style)


class Output(SafeConsole):
    """A console that leaves broken pipes to cli.main."""

    def print_wide(self, table: Table) -> None:
        """Print a table with each row on one line, however long."""
        self.width = LONG
        self.width = self.measure(table).maximum
        self.print(table)

    def on_broken_pipe(self) -> None:
        """Raise, where rich would end the process with status 1."""
        raise BrokenPipeError


class Cells(Table):
    """A table whose strings have their control characters escaped."""

    def add_row(self, *cells: Any, **options: Any) -> None:
        """Add a row, with control characters in strings escaped."""
        super().add_row(
            *(escape_controls(c) if isinstance(c, str) else c for c in cells), **options
        )


def output() -> Output:
    """A console on standard output without markup or wrapping."""
    return Output(highlight=False, soft_wrap=True, markup=False)


def columns(*names: str) -> Cells:
    """An empty table with these columns."""
    table = Cells(box=None, pad_edge=False, header_style="bold")
    for name in names:
        table.add_column(name, overflow="fold")  # a truncated number would read as another number
    return table
