"""What the views share: a panel for each task, the look of each condition, one legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from agentflow.notebook.figures.rows import Datum
from agentflow.notebook.figures.style import Look, looks, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LABELS: Mapping[str, str] = {
    "simulations": "simulations",
    "calls": "model calls",
    "tokens": "tokens",
    "seconds": "seconds of work",
}


def groups(rows: Sequence[Datum]) -> dict[str, dict[str, list[Datum]]]:
    """Task -> condition -> rows, in order of appearance."""
    found: dict[str, dict[str, list[Datum]]] = {}
    for row in rows:
        found.setdefault(row.task, {}).setdefault(row.condition, []).append(row)
    return found


def by_run(rows: Sequence[Datum]) -> list[list[Datum]]:
    """The rows of each run."""
    found: dict[tuple[str, int], list[Datum]] = {}
    for row in rows:
        found.setdefault((row.run, row.seed), []).append(row)
    return list(found.values())


Panels = list[tuple[Any, dict[str, list[Datum]]]]
"""Axes, and the rows of each condition that they show."""


def panels_of(rows: Sequence[Datum]) -> tuple[Figure, Panels, dict[str, Look]]:
    """A figure with a panel for each task, what is in each, and the look of the conditions."""
    tasks = groups(rows)
    figure, axes = new_figure(len(tasks))
    for task, axis in zip(tasks, axes, strict=True):
        axis.set_title(task)
    names = list(dict.fromkeys(row.condition for row in rows))
    return figure, list(zip(axes, tasks.values(), strict=True)), looks(names)


def add_legend(figure: Figure, axis: Any, conditions: Mapping[str, Look]) -> None:
    """One legend below all panels, if there is something to tell apart."""
    if len(conditions) > 1:
        handles, labels = axis.get_legend_handles_labels()
        columns = min(len(labels), 2 if max(map(len, labels)) > 24 else 4)
        figure.legend(handles, labels, loc="outside lower center", ncols=columns)
