"""The data of a sweep's page: tables and score distributions, as JSON data."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
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
    **STAGE_WORDS,
    "of": "part",
    "rollouts": "simulations",
    "rollouts/s": "simulations/s",
    "score against expansions": "best score after N new machines",
    "all machines (invalid scored 0)": "all, invalid = 0",
}
"""Names in tables -> what the page calls them."""


@dataclass(frozen=True)
class Spread:
    """The scores of one variant at a task."""

    scores: Scores
    runs: Sequence[str] = ()
    """The run of each score, the lowest score first."""
    unit: str = ""
    best: Mapping[str, Any] | None = None
    """The best machine: run, score, and content hash or picture (URL)."""
    goal: Mapping[str, Any] = field(default_factory=dict)
    """Mean calls of a run, and what its score is worth, if that is known: level, from which score
    on machines are good, and the record with the share of it that the best machine reaches."""

    def to_json(self, task: str, name: str) -> dict[str, Any]:
        """What the page draws, with at most `MOST_DOTS` scores."""
        interval = self.scores.mean_all_interval()
        ordered = sorted(self.scores.all)
        step = max(1, -(-len(ordered) // MOST_DOTS))
        return {
            "task": task,
            "name": name.replace("_", " "),
            "count": len(ordered),
            "invalid": self.scores.invalid,
            "values": ordered[::step],
            "runs": self.runs[::step],
            "mean": self.scores.mean_all,
            "low": interval and interval.low,
            "high": interval and interval.high,
            "unit": self.unit,
            "best": self.best,
            **self.goal,
        }


def sweep_data(
    title: str,
    about: str,
    spreads: Mapping[tuple[str, str], Spread],
    tables: Sequence[Table],
    runs: Sequence[Mapping[str, Any]] = (),
) -> dict[str, Any]:
    """Everything that the page shows; `spreads` are by task and variant."""
    shared = [note for note in tables[0].notes if all(note in t.notes for t in tables)]
    shown = [
        table_data(replace(table, title=table.title.removeprefix(f"{title}: ")), shared)
        for table in tables
        if table.columns and any(value is not None for row in table.rows for value in row.values)
    ]
    return {
        "kind": "sweep",
        "title": title,
        "about": about,
        "notes": shared,
        "spreads": [spread.to_json(*key) for key, spread in spreads.items()],
        "tables": shown,
        "runs": [dict(run) for run in runs],
    }


def table_data(
    table: Table,
    known: Collection[str] = (),
    words: Mapping[str, str] = PLAIN,
    *,
    zeros: bool = False,
) -> dict[str, Any]:
    """A table as a page shows it, without the notes that are `known`; columns without any value
    but 0 are left out unless `zeros` keeps them."""
    every = (*table.rows, *table.published)
    kept = [n for n in range(len(table.columns)) if zeros or any(row.values[n] for row in every)]
    columns = [table.columns[place] for place in kept]
    gone = {column.name for column in table.columns} - {column.name for column in columns}
    notes = [_reword(note, gone, columns, words) for note in table.notes if note not in known]
    return {
        "title": words.get(table.title, table.title),
        "heads": [words.get(head, head) for head in table.heads],
        "columns": [[_word(part, words) for part in (each.group, each.name)] for each in columns],
        "rows": [_cells(table, row, kept) for row in table.rows],
        "published": [_cells(table, row, kept) for row in table.published],
        "publishedTitle": PUBLISHED,
        "scored": OURS[-1] not in table.heads,
        "notes": [note for note in notes if note],
    }


def _cells(table: Table, row: Row, kept: Sequence[int]) -> list[str]:
    named = zip(table.heads, row.labels, strict=True)
    labels = [_word(label, STAGE_WORDS) if head in OURS else label for head, label in named]
    return labels + [_cell(row.values[place], table.columns[place]) for place in kept]


def _cell(value: Value, column: Column) -> str:
    """A value as on pages: with an en dash for a range or nothing, and groups of digits."""
    if isinstance(value, int):
        return f"{value:,}"
    text = cell_text(value, 1 if column.percent else column.digits, in_percent=column.percent)
    if isinstance(value, float | Interval):
        text = text.replace(" - ", f" {DASH} ").replace("%", "\N{NO-BREAK SPACE}%")
    return DASH if text == NOTHING else text


def _word(name: str, words: Mapping[str, str]) -> str:
    return words.get(name, name.replace("_", " "))


def _reword(note: str, gone: set[str], columns: Sequence[Column], words: Mapping[str, str]) -> str:
    """A note without its sentences on columns that are left out, with headings of the others."""
    told = re.split(r"(?<=\.) ", note)
    note = " ".join(line for line in told if re.split(": | is ", line)[0] not in gone)
    for column in columns:
        note = note.replace(column.name, _word(column.name, words))
        if column.group in words:
            note = re.sub(rf"\b{column.group}(?=[:.])", words[column.group], note)
    return note
