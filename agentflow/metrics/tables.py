"""Tables and their formats: text, Markdown, CSV, LaTeX, JSON; numbers as people read them.

Published rows are separate from measured ones and labelled in every format.
"""

import csv
import io
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, groupby
from types import MappingProxyType
from typing import Any

from agentflow.metrics.intervals import Interval, Rate

NOTHING = "-"
"""Shown where there is no value."""


def number(value: float | None, digits: int = 2) -> str:
    """A number with so many decimals, by default those of a score."""
    return NOTHING if value is None else f"{value:.{digits}f}"


def change(value: float | None, digits: int = 2) -> str:
    """A difference, with its sign."""
    return NOTHING if value is None else f"{value:+.{digits}f}"


def percent(share: float | None, digits: int = 1) -> str:
    """A share in percent."""
    return NOTHING if share is None else f"{share:.{digits}%}"


def money(value: float | None, unknown: str = NOTHING) -> str:
    """An amount of money, in the currency of the prices."""
    return unknown if value is None else f"{value:.4g}"


def extents(size: Sequence[float]) -> str:
    """The size of a box: "1 x 0.5 x 2"."""
    return " x ".join(f"{extent:g}" for extent in size)


def counted(count: int, noun: str) -> str:
    """A count with its noun: "1 run", "2 runs"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def duration(seconds: float) -> str:
    """A length of time that was estimated: `8 s`, `2.5 min`, `3.0 h`; at least one second."""
    if seconds < 60:
        return f"{max(seconds, 1):.0f} s"
    return f"{seconds / 60:.1f} min" if seconds < 3600 else f"{seconds / 3600:.1f} h"


def block_count(count: int, most: int | None) -> str:
    """The blocks of a machine, and the most that its task allows: "23 of 40 blocks"."""
    return f"{count} blocks" if most is None else f"{count} of {most} blocks"


def interval_text(
    ends: Sequence[float] | None, digits: int = 2, *, in_percent: bool = False
) -> str | None:
    """An interval, "1.20 - 3.40"; None without one."""
    show = percent if in_percent else number
    return None if ends is None else " - ".join(show(end, digits) for end in ends)


def cell_text(value: object, digits: int = 2, *, in_percent: bool = False) -> str:
    """A cell of a table: floats and intervals with a few decimals, a dash for no value."""
    if value is None or isinstance(value, float):
        return percent(value, digits) if in_percent else number(value, digits)
    if isinstance(value, tuple):
        return interval_text(value, digits, in_percent=in_percent) or NOTHING
    return str(value)


Value = float | int | str | Rate | Interval | None
PARTS: Mapping[type, tuple[str, str]] = MappingProxyType(
    {Rate: ("count", "of"), Interval: ("low", "high")}
)
"""Kind of value -> its numbers, each of which has a column of its own in CSV and JSON."""
PUBLISHED = "published (other models, in the game; not comparable in absolute terms)"
GAP = "  "
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Characters that start a formula in spreadsheets."""


@dataclass(frozen=True)
class Column:
    """One column of numbers.

    `group` is the heading above several columns, "" for none; `digits` are the decimals of its
    floats.
    """

    group: str
    name: str
    percent: bool = False
    digits: int = 2

    @property
    def full(self) -> str:
        """Group and name, for formats with a single heading line."""
        return f"{self.group} {self.name}".strip()


@dataclass(frozen=True)
class Row:
    """One line of a table.

    It has as many labels as the table has `heads`, and as many values as it has `columns`.
    """

    labels: tuple[str, ...]
    values: tuple[Value, ...]


@dataclass(frozen=True)
class Table:
    """Rows of numbers, with title and notes."""

    title: str
    heads: tuple[str, ...]
    """Headings of the label columns."""
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    published: tuple[Row, ...] = ()
    notes: tuple[str, ...] = ()


def text(table: Table) -> str:
    """Aligned columns for a terminal; lines are not wrapped."""
    heads = [*table.heads, *(column.name for column in table.columns)]
    measured = [_cells(table, row) for row in table.rows]
    published = [_cells(table, row) for row in table.published]
    widths = [max(map(len, column)) for column in zip(heads, *measured, *published, strict=True)]
    above = _group_line(table, widths)
    left = len(table.heads)

    def line(cells: Sequence[str]) -> str:
        pairs = zip(cells, widths, strict=True)
        parts = [c.ljust(w) if i < left else c.rjust(w) for i, (c, w) in enumerate(pairs)]
        return GAP.join(parts).rstrip()

    rule = "-" * (sum(widths) + len(GAP) * (len(widths) - 1))
    lines = [table.title, "", *above, line(heads), rule, *map(line, measured)]
    if published:
        lines += [rule, PUBLISHED, *map(line, published)]
    if table.notes:
        lines += ["", *table.notes]
    return "\n".join(lines) + "\n"


def markdown(table: Table) -> str:
    """GitHub Markdown: measured rows in one table, published ones in another."""

    def part(rows: Iterable[Row]) -> list[str]:
        heads = [*table.heads, *(column.full for column in table.columns)]
        marks = ["---"] * len(table.heads) + ["---:"] * len(table.columns)
        lines = (heads, marks, *(_cells(table, row) for row in rows))
        return [f"| {' | '.join(map(_escape_markdown, cells))} |" for cells in lines]

    lines = [f"**{_escape_markdown(table.title)}**", "", *part(table.rows)]
    if table.published:
        lines += ["", f"*{PUBLISHED}*", "", *part(table.published)]
    if table.notes:
        lines += ["", *(f"{_escape_markdown(note)}  " for note in table.notes)]
    return "\n".join(lines) + "\n"


def comma_separated(table: Table) -> str:
    """CSV with full precision and a `source` column: measured or published; see `in_parts`."""
    table = in_parts(table)
    out = io.StringIO()
    write = csv.writer(out, lineterminator="\n").writerow
    write(["source", *table.heads, *(_escape_formula(column.full) for column in table.columns)])
    for source, rows in (("measured", table.rows), ("published", table.published)):
        for row in rows:
            values = ("" if value is None else str(value) for value in row.values)
            write([source, *map(_escape_formula, row.labels), *values])
    return out.getvalue()


def latex(table: Table) -> str:
    """LaTeX tabular; needs the booktabs package."""
    width = len(table.heads) + len(table.columns)
    form = "l" * len(table.heads) + "r" * len(table.columns)
    lines = [f"% {' '.join(table.title.split())}", f"\\begin{{tabular}}{{{form}}}", "\\toprule"]
    if _has_groups(table):
        spans = [(g, len(list(cs))) for g, cs in groupby(table.columns, lambda c: c.group)]
        spanned = [f"\\multicolumn{{{n}}}{{c}}{{{_escape_latex(group)}}}" for group, n in spans]
        lines.append(" & ".join([""] * len(table.heads) + spanned).strip() + " \\\\")
    heads = [*table.heads, *(column.name for column in table.columns)]
    lines += [_ampersands(heads), "\\midrule"]
    lines += [_ampersands(_cells(table, row)) for row in table.rows]
    if table.published:
        lines += ["\\midrule", f"\\multicolumn{{{width}}}{{l}}{{{_escape_latex(PUBLISHED)}}} \\\\"]
        lines += [_ampersands(_cells(table, row)) for row in table.published]
    notes = (f"% {' '.join(note.split())}" for note in table.notes)
    lines += ["\\bottomrule", "\\end{tabular}", *notes]
    return "\n".join(lines) + "\n"


def as_json(table: Table) -> str:
    """One JSON object; see `in_parts`."""
    table = in_parts(table)

    def plain(rows: Sequence[Row]) -> list[dict[str, Any]]:
        return [
            {**dict(zip(table.heads, row.labels, strict=True)), "values": row.values}
            for row in rows
        ]

    content = {
        "title": table.title,
        "columns": [{"group": c.group, "name": c.name} for c in table.columns],
        "measured": plain(table.rows),
        "published": plain(table.published),
        "notes": list(table.notes),
    }
    return json.dumps(content) + "\n"


def in_parts(table: Table) -> Table:
    """The table with a column for each number: `count` and `of` of shares, `low` and `high` of
    intervals, which are named after the column that holds both."""
    kinds = [_parts(table, place) for place in range(len(table.columns))]
    columns = tuple(
        replace(column, name=f"{column.name} {part}".strip())
        for column, parts in zip(table.columns, kinds, strict=True)
        for part in parts
    )

    def split(rows: Sequence[Row]) -> tuple[Row, ...]:
        values = (map(_numbers, row.values, map(len, kinds)) for row in rows)
        return tuple(
            Row(row.labels, tuple(chain.from_iterable(numbers)))
            for row, numbers in zip(rows, values, strict=True)
        )

    return replace(table, columns=columns, rows=split(table.rows), published=split(table.published))


def _parts(table: Table, place: int) -> tuple[str, ...]:
    """What a column is split into; one unnamed part if it holds single numbers."""
    kinds = (PARTS.get(type(row.values[place])) for row in table.rows)
    return next(filter(None, kinds), ("",))


def _numbers(value: Value, parts: int) -> Sequence[float | int | str | None]:
    """The numbers of a value; a published one is text, and may be an interval or a count."""
    if isinstance(value, Rate):
        return value.count, value.of
    if isinstance(value, Interval):
        return value
    if parts == 1:
        return (value,)
    first, *rest = re.split(" - |/|, ", value) if isinstance(value, str) else [value]
    return first, rest[0] if rest else None


FORMATS: Mapping[str, Callable[[Table], str]] = MappingProxyType(
    {"text": text, "md": markdown, "csv": comma_separated, "latex": latex, "json": as_json}
)


def _has_groups(table: Table) -> bool:
    return any(column.group for column in table.columns)


def _group_line(table: Table, widths: list[int]) -> list[str]:
    """Group names, each above its columns; a group's last column is widened if needed."""
    if not _has_groups(table):
        return []
    at = len(table.heads)
    parts = [" " * width for width in widths[:at]]
    for group, columns in groupby(table.columns, lambda column: column.group):
        count = len(list(columns))
        span = sum(widths[at : at + count]) + len(GAP) * (count - 1)
        widths[at + count - 1] += max(0, len(group) - span)
        parts.append(group.rjust(max(span, len(group))))
        at += count
    return [GAP.join(parts).rstrip()]


def _cells(table: Table, row: Row) -> list[str]:
    pairs = zip(row.values, table.columns, strict=True)
    return [*row.labels, *(cell_text(value, c.digits, in_percent=c.percent) for value, c in pairs)]


def _escape_markdown(text: str) -> str:
    """Escape text for a line of Markdown."""
    for character in "\\|*_`<":
        text = text.replace(character, "\\" + character)
    return " ".join(text.split())


def _escape_formula(name: str) -> str:
    """Keep a spreadsheet from reading a name as a formula (OWASP, "CSV injection")."""
    return f"'{name}" if name.startswith(FORMULA) else name


def _ampersands(cells: Iterable[str]) -> str:
    return " & ".join(_escape_latex(cell) for cell in cells) + " \\\\"


def _escape_latex(text: str) -> str:
    special = {c: f"\\{c}" for c in "&%$#_{}"}
    named = {"\\": "\\textbackslash{}", "~": "\\textasciitilde{}", "^": "\\textasciicircum{}"}
    return "".join((special | named).get(c, c) for c in " ".join(text.split()))
