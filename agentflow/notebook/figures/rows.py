"""The rows of figures, and the CSV files that hold them."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from agentflow.errors import UsageError
from agentflow.files.atomic import os_errors, write_output
from agentflow.notebook.words import View

CSV = ".csv"


@dataclass(frozen=True)
class Datum:
    """One number of a figure: a row of the CSV file."""

    view: str
    task: str
    condition: str
    run: str
    seed: int
    measure: str
    """What x is: `simulations`, ...; of `scores` and `ranks`, what y is; of `validity`, a level."""
    x: float | None
    """Spent so far; of `validity`, the number of trajectories. None if there is no x."""
    y: float
    """Score; of `validity`, how many trajectories got so far."""


def read_csv(path: Path, view: View) -> list[Datum]:
    """Rows that `write_csv` wrote.

    Raises:
        UsageError: The file cannot be read, holds something else, or rows of another view.
    """
    with os_errors(f"cannot read {path}"), path.open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    try:
        rows = [
            Datum(
                **{name: line[name] for name in ("view", "task", "condition", "run", "measure")},
                seed=int(line["seed"]),
                x=float(line["x"]) if line["x"] else None,
                y=float(line["y"]),
            )
            for line in lines
        ]
    except (KeyError, ValueError, TypeError):
        columns = ", ".join(field.name for field in fields(Datum))
        raise UsageError(
            f"{path} is not a table of a figure: it needs the columns {columns}, as agentflow plot "
            "--out writes to .csv files"
        ) from None
    if not rows:
        raise UsageError(f"there is nothing to plot: {path} has no rows")
    if other := next((row.view for row in rows if row.view != view), None):
        raise UsageError(f"{path} has rows of the view {other}, not {view}: add --view {other}")
    return rows


def write_csv(rows: Iterable[Datum], out: Path) -> None:
    """Write the rows of a figure, one number a line, with full precision."""
    with write_output(out) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Datum)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
