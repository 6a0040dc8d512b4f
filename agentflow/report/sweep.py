"""Owns what the page of a sweep says: its tables, and how scores are spread, as JSON data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from agentflow.metrics.scores import Scores
from agentflow.metrics.tables import PUBLISHED, Row, Table, shown

MOST_DOTS = 400
"""Scores of one variant that are drawn, evenly taken from all in order of size."""


def sweep_data(
    title: str, about: str, spreads: Mapping[str, Scores], tables: Sequence[Table]
) -> dict[str, Any]:
    """Everything that the page shows.

    Args:
        title: Of the sweep.
        about: What it asks.
        spreads: The scores of each variant.
        tables: In the order in which they are shown.

    Raises:
        UsageError: scipy, which makes the intervals, is missing.
    """
    rows = [_spread(name, scores) for name, scores in spreads.items()]
    return {
        "kind": "sweep",
        "title": title,
        "about": about,
        "spreads": rows,
        "tables": [_table(table) for table in tables if table.columns],
    }


def _spread(name: str, scores: Scores) -> dict[str, Any]:
    interval = scores.mean_all_interval()
    ordered = sorted(scores.all)
    step = max(1, -(-len(ordered) // MOST_DOTS))
    return {
        "name": name,
        "values": ordered[::step],
        "mean": scores.mean_all,
        "low": interval and interval.low,
        "high": interval and interval.high,
    }


def _table(table: Table) -> dict[str, Any]:
    return {
        "title": table.title,
        "head": [*table.heads, *(column.full for column in table.columns)],
        "labels": len(table.heads),
        "rows": [_cells(table, row) for row in table.rows],
        "published": [_cells(table, row) for row in table.published],
        "publishedTitle": PUBLISHED,
        "notes": list(table.notes),
    }


def _cells(table: Table, row: Row) -> list[str]:
    pairs = zip(row.values, table.columns, strict=True)
    return [*row.labels, *(shown(value, column.percent) for value, column in pairs)]
