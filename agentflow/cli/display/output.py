"""Output for people: results declared by their fields, and control characters escaped."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table

from agentflow.cli.display.text import escape_controls
from agentflow.metrics.tables import NOTHING

Data = Mapping[str, Any]
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


def tell(*things: RenderableType, wide: bool = False) -> None:
    """Print on standard output; if `wide`, with each row of a table on one line, however long."""
    console = output()
    if wide:
        console.width = LONG
        console.width = max(console.measure(table).maximum for table in things)
    console.print(*things)


def columns(*names: str) -> Cells:
    """An empty table with these columns."""
    table = Cells(box=None, pad_edge=False, header_style="bold")
    for name in names:
        table.add_column(name, overflow="fold")  # a truncated number would read as another number
    return table


@dataclass(frozen=True)
class Field:
    """One fact of a result.

    `label` is the heading of its column, or the beginning of its line. `show` gives its text, or
    None where the result lacks it: then a table has a dash, and a list no line.
    """

    label: str
    show: Callable[[Data], str | None]


def field(label: str, key: str = "", show: Callable[[Any], str | None] = str) -> Field:
    """A field that shows the value of a key, by default of the key with the name of the label."""

    def text(item: Data) -> str | None:
        value = item.get(key or label)
        return None if value is None else show(value)

    return Field(label, text)


def answer(label: str, key: str, unknown: str) -> Field:
    """A field that is true, false or None, which is shown as `unknown`."""
    return Field(label, lambda item: {True: "yes", False: "no", None: unknown}[item[key]])


def table(fields: Sequence[Field], rows: Iterable[Data | None]) -> Cells:
    """A table with a column for each field; None among the rows is an empty line."""
    found = columns(*(each.label for each in fields))
    for row in rows:
        shown = () if row is None else [each.show(row) for each in fields]
        found.add_row(*(NOTHING if text is None else text for text in shown))
    return found


def print_lines(fields: Iterable[Field], item: Data) -> None:
    """Print a line for each field that the result has."""
    for each in fields:
        if (text := each.show(item)) is not None:
            tell(f"{each.label}: {text}")


def print_problems(problems: Iterable[Data] | None) -> None:
    """Print why a machine is not valid, a line for each problem."""
    for problem in problems or ():
        tell(f"{problem['code']}: {problem['message']}")
