"""What the views share: a panel for each task, the look of each condition, one legend."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from agentflow.notebook.figures.rows import Datum
from agentflow.notebook.figures.style import Look, looks, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LABELS: Mapping[str, str] = {"calls": "model calls", "seconds": "seconds of work"}
"""Measure -> its name on an axis, where that is another."""
Key = TypeVar("Key")


def grouped(rows: Iterable[Datum], key: Callable[[Datum], Key]) -> dict[Key, list[Datum]]:
    """The rows with each key, in order of appearance."""
    found: dict[Key, list[Datum]] = {}
    for row in rows:
        found.setdefault(key(row), []).append(row)
    return found


Panels = list[tuple[Any, dict[str, list[Datum]]]]
"""Axes, and the rows of each condition that they show."""


def panels_of(rows: Sequence[Datum]) -> tuple[Figure, Panels, dict[str, Look]]:
    """A figure with a panel for each task, what is in each, and the look of the conditions."""
    tasks = grouped(rows, lambda row: row.task)
    figure, axes = new_figure(len(tasks))
    panels = []
    for (task, its), axis in zip(tasks.items(), axes, strict=True):
        axis.set_title(task)
        panels.append((axis, grouped(its, lambda row: row.condition)))
    return figure, panels, looks(conditions_of(rows))


def conditions_of(rows: Iterable[Datum]) -> list[str]:
    """The conditions, in order of appearance."""
    return list(dict.fromkeys(row.condition for row in rows))


def add_legend(figure: Figure, axis: Any, conditions: Mapping[str, Look]) -> None:
    """One legend below all panels, if there is something to tell apart."""
    if len(conditions) > 1:
        handles, labels = axis.get_legend_handles_labels()
        columns = min(len(labels), 2 if max(map(len, labels)) > 24 else 4)
        figure.legend(handles, labels, loc="outside lower center", ncols=columns)
