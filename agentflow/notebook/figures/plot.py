"""Figures: their views, drawn from rows alone, and written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from agentflow.errors import UnknownNameError, UsageError
from agentflow.files.atomic import write_output
from agentflow.metrics.intervals import Rate, bootstrap_band
from agentflow.notebook.figures.data import CSV, LEVELS, Datum, Source, read_rows, write_csv
from agentflow.notebook.figures.style import Look, drawing_style, looks, new_figure
from agentflow.notebook.words import By, View, require_word

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


POINTS = 200
"""Most points of a line: those of all runs, thinned where there are more."""


def draw_curve(rows: Sequence[Datum]) -> Figure:
    figure, panels, shown = panels_of(rows)
    for axis, conditions in panels:
        grid = _thin(sorted({row.x or 0.0 for its in conditions.values() for row in its}))
        for name, its in conditions.items():
            runs = grouped(its, lambda row: (row.run, row.seed)).values()
            look, best = shown[name], np.array([_step(run, grid) for run in runs])
            style = {"color": look.color, "drawstyle": "steps-post"}
            axis.plot(
                grid, best.mean(axis=0), label=name, linestyle=look.dashes,
                marker=look.mark, markevery=max(1, len(grid) // 6), **style,
            )  # fmt: skip
            band = bootstrap_band(best)
            if band is not None:
                axis.fill_between(
                    grid, *band, step="post", color=look.color, alpha=0.18, linewidth=0
                )
        axis.set_xlabel(LABELS.get(rows[0].measure, rows[0].measure))
        axis.set_ylabel("best score so far")
    add_legend(figure, panels[0][0], shown)
    return figure


def _thin(values: list[float]) -> NDArray[np.float64]:
    """At most so many of the values, with the first and the last."""
    picks = np.unique(np.linspace(0, len(values) - 1, min(len(values), POINTS)).round().astype(int))
    thinned: NDArray[np.float64] = np.array(values)[picks]
    return thinned


def _step(run: Sequence[Datum], grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """The best score of a run at each place of the grid: 0 before its first one."""
    spent = np.array([row.x or 0.0 for row in run])
    best = np.array([0.0, *(row.y for row in run)])
    at: NDArray[np.float64] = best[np.searchsorted(spent, grid, side="right")]
    return at


def draw_pareto(rows: Sequence[Datum]) -> Figure:
    figure, panels, shown = panels_of(rows)
    for axis, conditions in panels:
        for name, its in conditions.items():
            look = shown[name]
            axis.scatter(
                [row.x for row in its], [row.y for row in its], s=18, marker=look.mark,
                facecolors=look.color, edgecolors="white", linewidths=0.5, label=name, zorder=3,
            )  # fmt: skip
        front = pareto_front([(row.x or 0.0, row.y) for its in conditions.values() for row in its])
        axis.plot(*zip(*front, strict=True), color="#555555", drawstyle="steps-post", linewidth=0.9)
        axis.set_xlabel(LABELS.get(rows[0].measure, rows[0].measure))
        axis.set_ylabel("score")
    add_legend(figure, panels[0][0], shown)
    return figure


def pareto_front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points (cost, score) that no point with at most that cost beats, by rising cost."""
    front: list[tuple[float, float]] = []
    for cost, score in sorted(points, key=lambda point: (point[0], -point[1])):
        if not front or score > front[-1][1]:
            front.append((cost, score))
    return front


def draw_scores(rows: Sequence[Datum]) -> Figure:
    figure, panels, shown = panels_of(rows)
    for axis, conditions in panels:
        for place, (name, its) in enumerate(conditions.items()):
            scores, look = np.array([row.y for row in its]), shown[name]
            axis.scatter(
                _spread(place, len(scores)), scores, s=14, marker=look.mark,
                facecolors="none", edgecolors=look.color, linewidths=0.8, label=name,
            )  # fmt: skip
            _mean_with_interval(axis, place, scores, look)
        axis.set_xticks(range(len(conditions)), list(conditions), rotation=20, ha="right")
        axis.set_xlim(-0.6, len(conditions) - 0.4)
        axis.grid(visible=False, axis="x")
        axis.set_ylabel(" or ".join(sorted({row.measure for row in rows})))
    return figure


def _spread(place: float, count: int) -> NDArray[np.float64]:
    """Places beside each other, so that equal scores do not hide one another."""
    reach = min(0.03 * (count - 1), 0.25)
    return np.linspace(place - reach, place + reach, count, dtype=np.float64)


def _mean_with_interval(axis: Any, place: float, values: NDArray[np.float64], look: Look) -> None:
    band = bootstrap_band(values[:, None])
    mean = values.mean()
    reach = [[mean - band[0][0]], [band[1][0] - mean]] if band is not None else None
    axis.errorbar(
        place, mean, yerr=reach, fmt=look.mark, color=look.color, markersize=6, capsize=3,
        elinewidth=1.2, markeredgecolor="white", markeredgewidth=0.6, zorder=3,
    )  # fmt: skip


def draw_ranks(rows: Sequence[Datum]) -> Figure:
    names = conditions_of(rows)
    if len(names) < 2:
        raise UsageError("ranks compare conditions: name a sweep with an axis, or several runs")
    ranks = mean_ranks(rows, names)
    if not len(ranks):
        raise UsageError("ranks need a task and a seed that every condition has")
    means, band, shown = ranks.mean(axis=0), bootstrap_band(ranks), looks(names)
    figure, [axis] = new_figure(1, (3.3, 0.9 + 0.3 * len(names)))
    order = np.argsort(means)[::-1]
    for height, index in enumerate(order):
        look = shown[names[index]]
        if band is not None:
            axis.hlines(height, band[0][index], band[1][index], color=look.color, linewidth=1.4)
        axis.plot(means[index], height, look.mark, color=look.color, markersize=6)
    axis.set_yticks(range(len(names)), [names[index] for index in order])
    axis.set_ylim(-0.6, len(names) - 0.4)
    axis.set_xlim(0.8, len(names) + 0.2)
    axis.grid(visible=False, axis="y")
    axis.set_xlabel(f"mean rank over {len(ranks)} tasks and seeds (1 is best)")
    return figure


def mean_ranks(rows: Sequence[Datum], names: Sequence[str]) -> NDArray[np.float64]:
    """The rank of each condition (columns) at each task and seed that all of them have (rows).

    Conditions with equal scores share the mean of their ranks; of runs with the same seed, the mean
    score counts.
    """
    cells = grouped(rows, lambda row: (row.task, row.seed, row.condition))
    places = dict.fromkeys((task, seed) for task, seed, _ in cells)
    by_place = ([cells.get((*place, name), []) for name in names] for place in places)
    whole = [[fmean(row.y for row in its) for its in found] for found in by_place if all(found)]
    table = np.array(whole).reshape(-1, len(names))
    better = (table[:, None, :] > table[:, :, None]).sum(axis=2)
    equal = (table[:, None, :] == table[:, :, None]).sum(axis=2)
    ranks: NDArray[np.float64] = better + (equal + 1) / 2
    return ranks


def draw_validity(rows: Sequence[Datum]) -> Figure:
    figure, panels, shown = panels_of(rows)
    levels = [level for level in LEVELS if any(row.measure == level for row in rows)]
    for axis, conditions in panels:
        for index, (name, its) in enumerate(conditions.items()):
            look, shift = shown[name], (index - (len(conditions) - 1) / 2) * 0.12
            for place, level in enumerate(levels):
                rates = (Rate(int(row.y), int(row.x or 0)) for row in its if row.measure == level)
                rate = sum(rates, Rate(0, 0))
                if rate.value is not None and rate.interval is not None:
                    reach = [[rate.value - rate.interval.low], [rate.interval.high - rate.value]]
                    axis.errorbar(
                        place + shift, rate.value, yerr=np.abs(reach), fmt=look.mark,
                        color=look.color, capsize=2, elinewidth=1,
                        label=name if place == 0 else None,
                    )  # fmt: skip
        axis.set_xticks(range(len(levels)), levels, rotation=20, ha="right")
        axis.set_ylim(-0.03, 1.03)
        axis.grid(visible=False, axis="x")
        axis.set_ylabel("share of trajectories")
    add_legend(figure, panels[0][0], shown)
    return figure


FORMATS = (".pdf", ".svg", ".png", CSV)
METADATA = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
"""Left out, so that equal figures are equal files."""


def plot(
    *sources: Source, view: View = "curve", by: By = "simulations", out: Path | str | None = None
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
