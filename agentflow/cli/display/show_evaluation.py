"""Evaluations as text for people; programs use --json."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from agentflow.cli.display.output import columns, output
from agentflow.cli.display.show import Data
from agentflow.cli.display.text import number


def show_evaluation(found: Data) -> None:
    """Print the numbers of each task."""
    console = output()
    console.print(f"{found['name']}: {found['label']}, {found['conditions']['engine']}")
    results = found["results"].items()
    table = columns("task", "valid", "share", "95 %", "mean", "95 %", "SD", "max")
    for task, row in results:
        valid = row["valid"]
        table.add_row(
            task,
            f"{valid['count']}/{valid['of']}",
            _percent(valid["share"]),
            _interval(valid["interval"], _percent),
            number(row["mean"]),
            _interval(row["mean_interval"], number),
            number(row["sd"]),
            number(row["max"]),
        )
    console.print(table)
    counts = list(dict.fromkeys(n for _, row in results for n in row["best_at"]))
    table = columns("task", *(f"Best@{n}" for n in counts))
    for task, row in results:
        table.add_row(task, *(number(row["best_at"].get(n)) for n in counts))
    console.print(table)
    for task, row in results:
        if row["faults"]:
            console.print(
                f"{task}: {row['faults']} left out because their simulation crashed or timed out"
            )


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{share:.1%}"


def _interval(ends: Sequence[float] | None, show: Callable[[float], str]) -> str:
    return "-" if ends is None else f"{show(ends[0])} - {show(ends[1])}"
