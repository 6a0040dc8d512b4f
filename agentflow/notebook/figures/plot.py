"""Draws figures, from their rows alone, and writes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from agentflow.errors import UnknownNameError
from agentflow.files.atomic import write_output
from agentflow.notebook.figures.data import CSV, Datum, Source, read_rows, write_csv
from agentflow.notebook.figures.style import drawing_style
from agentflow.notebook.figures.views import (
    draw_curve,
    draw_pareto,
    draw_ranks,
    draw_scores,
    draw_validity,
)
from agentflow.notebook.words import By, View, require_word

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".pdf", ".svg", ".png", CSV)
METADATA = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
"""Left out, so that equal figures are equal files."""


def plot(
    *sources: Source,
    view: View = "curve",
    by: By = "simulations",
    out: Path | str | None = None,
) -> Figure:
    """Draw a figure for a paper. Runs with the same condition differ only in their seeds.

    Views: `curve` is the best score so far against what a run has spent, as mean over runs with a
    95 % bootstrap band over seeds; `scores` has the score of every run, with means and intervals;
    `pareto` the score of every run against what it has spent, with those that no cheaper run beats;
    `ranks` the mean rank of each condition over tasks and seeds; `validity` how many trajectories
    got how far, with Wilson intervals. Scores are verified ones where there are any, except in
    curves. A run without a valid machine counts as 0, and keeps its last score when it has ended.

    Args:
        *sources: Runs, sweeps, folders with runs, or paths of them; or a `.csv` file that `out`
            wrote before.
        view: What to show.
        by: What the horizontal axis of `curve` and `pareto` counts.
        out: File to write: `.pdf` or `.svg` (with text as text), `.png`, or `.csv`: the numbers,
            one a line.

    Returns:
        The figure, which notebooks show.

    Raises:
        UsageError: There is nothing to plot, a source holds no runs or is damaged, or a name is
            unknown.
        ConfigError: matplotlib is not installed.
    """
    require_word("view of figures", view, View)
    require_word("cost", by, By)
    rows = read_rows(sources, view, by)
    if out is not None and Path(out).suffix.lower() not in FORMATS:
        raise UnknownNameError("kind of figure", Path(out).suffix or out, FORMATS)
    with drawing_style():
        figure = DRAWN[view](rows)
        if out is not None:
            _save(figure, rows, Path(out))
    return figure


def _save(figure: Figure, rows: Sequence[Datum], out: Path) -> None:
    """Write a figure, or its rows, depending on the suffix of the file."""
    kind = out.suffix.lower()
    if kind == CSV:
        write_csv(rows, out)
        return
    with write_output(out) as part:
        figure.savefig(part, format=kind[1:], metadata=METADATA.get(kind))


DRAWN: Mapping[str, Callable[[Sequence[Datum]], Figure]] = {
    "curve": draw_curve,
    "scores": draw_scores,
    "pareto": draw_pareto,
    "ranks": draw_ranks,
    "validity": draw_validity,
}
"""View -> what draws it."""
