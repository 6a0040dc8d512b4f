"""The data of a sweep's page: tables and score distributions, as JSON data."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from agentflow.metrics.cells import Scores
from agentflow.metrics.intervals import Interval
from agentflow.metrics.tables import NOTHING, PUBLISHED, Column, Row, Table, Value, cell_text
from agentflow.runs.locations import STAGE_WORDS

MOST_DOTS = 400
"""Maximum number of scores drawn per variant, taken evenly from the sorted scores."""
DASH = "\N{EN DASH}"
"""Of ranges, and where there is no value."""
OURS = ("variant", "of")
"""Label columns with names from agentflow; their underscores are shown as spaces."""
PLAIN = {
    "of": "part",
    "rollouts": "simulations",
    "rollouts/s": "simulations/s",
    "first": "one reply, no feedback",
    "refined": "refined with feedback",
    "score against expansions": "best score after N new machines",
}
"""Names in tables -> what the page calls them."""


def sweep_data(
    title: str,
    about: str,
    spreads: Mapping[tuple[str, str], Scores],
    tables: Sequence[Table],
    runs: Sequence[Mapping[str, Any]] = (),
    units: Mapping[str, str] | None = None,
    best: Mapping[tuple[str, str], Mapping[str, Any]] | None = None,
    origins: Mapping[tuple[str, str], Sequence[str]] | None = None,
    *,
    zeros: bool = False,
) -> dict[str, Any]:
    """Everything that the page shows; `spreads` are scores by task and variant, `units` those of
    tasks, `best` the best machines: run, score, and machine (content hash) or picture (URL),
    `origins` the run of each score, the lowest score first.

    Columns of tables without any value but 0 are left out unless `zeros` keeps them.
    """
    shared = [note for note in tables[0].notes if all(note in t.notes for t in tables)]
    return {
        "kind": "sweep",
        "title": title,
        "about": about,
        "notes": shared,
        "spreads": [
            {
                **_spread(task, name, scores, (origins or {}).get((task, name), ())),
                "unit": (units or {}).get(task, ""),
                "best": (best or {}).get((task, name)),
            }
            for (task, name), scores in spreads.items()
        ],
        "tables": [_table(table, title, shared, zeros) for table in tables if table.columns],
        "runs": [dict(run) for run in runs],
    }


def _spread(task: str, name: str, scores: Scores, runs: Sequence[str]) -> dict[str, Any]:
    interval = scores.mean_all_interval()
    ordered = sorted(scores.all)
    step = max(1, -(-len(ordered) // MOST_DOTS))
    return {
        "task": task,
        "name": name.replace("_", " "),
        "count": len(ordered),
        "invalid": scores.invalid,
        "values": ordered[::step],
        "runs": runs[::step],
        "mean": scores.mean_all,
        "low": interval and interval.low,
        "high": interval and interval.high,
    }


def _table(table: Table, title: str, shared: Sequence[str], zeros: bool) -> dict[str, Any]:
    kept = [place for place in range(len(table.columns)) if zeros or _has_values(table, place)]
    columns = [table.columns[place] for place in kept]
    return {
        "title": PLAIN.get(name := table.title.removeprefix(f"{title}: "), name),
        "heads": [PLAIN.get(head, head) for head in table.heads],
        "columns": [[_words(column.group), _words(column.name)] for column in columns],
        "rows": [_cells(table, row, kept) for row in table.rows],
        "published": [_cells(table, row, kept) for row in table.published],
        "publishedTitle": PUBLISHED,
        "scored": OURS[-1] not in table.heads,
        "notes": [_reword(note, table.columns) for note in table.notes if note not in shared],
    }


def _has_values(table: Table, place: int) -> bool:
    """Whether a column has any value other than 0."""
    return any(row.values[place] not in (None, 0) for row in (*table.rows, *table.published))


def _cells(table: Table, row: Row, kept: Sequence[int]) -> list[str]:
    labels = [_label(head, label) for head, label in zip(table.heads, row.labels, strict=True)]
    return labels + [_cell(row.values[place], table.columns[place]) for place in kept]


def _cell(value: Value, column: Column) -> str:
    """A value as on pages: with an en dash for a range or nothing, and groups of digits."""
    if isinstance(value, int):
        return f"{value:,}"
    digits = 1 if column.percent else column.digits
    text = cell_text(value, digits, in_percent=column.percent)
    if isinstance(value, float | Interval):
        text = text.replace(" - ", f" {DASH} ").replace("%", "\N{NO-BREAK SPACE}%")
    return DASH if text == NOTHING else text


def _label(head: str, label: str) -> str:
    if head not in OURS:
        return label
    return STAGE_WORDS.get(label, _words(label))


def _words(name: str) -> str:
    return PLAIN.get(name, name.replace("_", " "))


def _reword(note: str, columns: Sequence[Column]) -> str:
    """Replace column names in a note by their headings."""
    for column in columns:
        note = note.replace(column.name, _words(column.name))
        if column.group in PLAIN:
            note = re.sub(rf"\b{column.group}(?=[:.])", PLAIN[column.group], note)
    return note
