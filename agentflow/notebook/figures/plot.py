"""Draws figures: one function for each view, from its rows alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from agentflow.errors import UnknownNameError, UsageError
from agentflow.files.atomic import write_output
from agentflow.metrics.intervals import bootstrap_band, wilson
from agentflow.notebook.figures.data import (
    CSV,
    LEVELS,
    Datum,
    Source,
    read_rows,
    require_view,
    write_csv,
)
from agentflow.notebook.figures.style import Look, drawing_style, looks, new_figure
from agentflow.notebook.machine_rows import require_by
from agentflow.notebook.words import By, View

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".pdf", ".svg", ".png", CSV)
METADATA = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
"""Left out, so that equal figures are equal files."""
LABELS: Mapping[str, str] = {
    "simulations": "simulations",
    "calls": "model calls",
    "tokens": "tokens",
    "seconds": "seconds of work",
}
POINTS = 200
"""Most points of a line: those of all runs, thinned where there are more."""


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
        UsageError: There is nothing to plot, a source is none or damaged, or a name is unknown.
        ConfigError: matplotlib is not installed.
    """
    rows = read_rows(sources, require_view(view), require_by(by))
    file = None if out is None else _require_format(Path(out))
    with drawing_style():
        figure = DRAWN[view](rows)
        if file is not None:
            save_figure(figure, rows, file)
    return figure


def save_figure(figure: Figure, rows: Sequence[Datum], out: Path) -> None:
    """Write a figure, or its rows, depending on the suffix of the file."""
    if out.suffix.lower() == CSV:
        write_csv(rows, out)
        return
    kind = out.suffix.lower()
    with write_output(out) as part:
        figure.savefig(part, format=kind[1:], metadata=METADATA.get(kind))


def _require_format(out: Path) -> Path:
    if out.suffix.lower() not in FORMATS:
        raise UnknownNameError("kind of figure", out.suffix or out.name, FORMATS)
    return out


def _groups(rows: Sequence[Datum]) -> dict[str, dict[str, list[Datum]]]:
    """Task -> condition -> rows, in order of appearance."""
    found: dict[str, dict[str, list[Datum]]] = {}
    for row in rows:
        found.setdefault(row.task, {}).setdefault(row.condition, []).append(row)
    return found


def _by_run(rows: Sequence[Datum]) -> list[list[Datum]]:
    """The rows of each run."""
    found: dict[tuple[str, int], list[Datum]] = {}
    for row in rows:
        found.setdefault((row.run, row.seed), []).append(row)
    return list(found.values())


Panels = list[tuple[Any, dict[str, list[Datum]]]]
"""Axes, and the rows of each condition that they show."""


def _panels(rows: Sequence[Datum]) -> tuple[Figure, Panels, dict[str, Look]]:
    """A figure with a panel for each task, what is in each, and the look of the conditions."""
    tasks = _groups(rows)
    figure, axes = new_figure(len(tasks))
    for task, axis in zip(tasks, axes, strict=True):
        axis.set_title(task)
    names = list(dict.fromkeys(row.condition for row in rows))
    return figure, list(zip(axes, tasks.values(), strict=True)), looks(names)


def _legend(figure: Figure, axis: Any, conditions: Mapping[str, Look]) -> None:
    """One legend below all panels, if there is something to tell apart."""
    if len(conditions) > 1:
        handles, labels = axis.get_legend_handles_labels()
        columns = min(len(labels), 2 if max(map(len, labels)) > 24 else 4)
        figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def _draw_curve(rows: Sequence[Datum]) -> Figure:
    figure, panels, shown = _panels(rows)
    for axis, conditions in panels:
        grid = _thin(sorted({row.x or 0.0 for its in conditions.values() for row in its}))
        for name, its in conditions.items():
            look, best = shown[name], np.array([_step(run, grid) for run in _by_run(its)])
            style = {"color": look.color, "drawstyle": "steps-post"}
            axis.plot(
                grid, best.mean(axis=0), label=name, linestyle=look.dashes,
                marker=look.mark, markevery=_few(grid), **style,
            )  # fmt: skip
            band = bootstrap_band(best)
            if band is not None:
                axis.fill_between(
                    grid, *band, step="post", color=look.color, alpha=0.18, linewidth=0
                )
        axis.set_xlabel(LABELS.get(rows[0].measure, rows[0].measure))
        axis.set_ylabel("best score so far")
    _legend(figure, panels[0][0], shown)
    return figure


def _thin(values: list[float]) -> NDArray[np.float64]:
    """At most so many of the values, with the first and the last."""
    picks = np.unique(np.linspace(0, len(values) - 1, min(len(values), POINTS)).round().astype(int))
    thinned: NDArray[np.float64] = np.array(values)[picks]
    return thinned


def _few(grid: NDArray[np.float64]) -> int:
    """Every how many points a line has a mark."""
    return max(1, len(grid) // 6)


def _step(run: Sequence[Datum], grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """The best score of a run at each place of the grid: 0 before its first one."""
    spent = np.array([row.x or 0.0 for row in run])
    best = np.array([0.0, *(row.y for row in run)])
    at: NDArray[np.float64] = best[np.searchsorted(spent, grid, side="right")]
    return at


def _draw_scores(rows: Sequence[Datum]) -> Figure:
    figure, panels, shown = _panels(rows)
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


def _draw_pareto(rows: Sequence[Datum]) -> Figure:
    figure, panels, shown = _panels(rows)
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
    _legend(figure, panels[0][0], shown)
    return figure


def pareto_front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points (cost, score) that no point with at most that cost beats, by rising cost."""
    front: list[tuple[float, float]] = []
    for cost, score in sorted(points, key=lambda point: (point[0], -point[1])):
        if not front or score > front[-1][1]:
            front.append((cost, score))
    return front


def _draw_ranks(rows: Sequence[Datum]) -> Figure:
    names = list(dict.fromkeys(row.condition for row in rows))
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

    Conditions with equal scores share the mean of their ranks.
    """
    scores: dict[tuple[str, int], dict[str, float]] = {}
    for row in rows:
        scores.setdefault((row.task, row.seed), {})[row.condition] = row.y
    whole = [[its[n] for n in names] for its in scores.values() if its.keys() >= {*names}]
    table = np.array(whole).reshape(-1, len(names))
    better = (table[:, None, :] > table[:, :, None]).sum(axis=2)
    equal = (table[:, None, :] == table[:, :, None]).sum(axis=2)
    ranks: NDArray[np.float64] = better + (equal + 1) / 2
    return ranks


def _draw_validity(rows: Sequence[Datum]) -> Figure:
    figure, panels, shown = _panels(rows)
    levels = [level for level in LEVELS if any(row.measure == level for row in rows)]
    for axis, conditions in panels:
        for index, (name, its) in enumerate(conditions.items()):
            look, shift = shown[name], (index - (len(conditions) - 1) / 2) * 0.12
            for place, level in enumerate(levels):
                count = sum(int(row.y) for row in its if row.measure == level)
                trials = sum(int(row.x or 0) for row in its if row.measure == level)
                share, interval = count / trials, wilson(count, trials)
                assert interval is not None
                reach = [[share - interval.low], [interval.high - share]]
                axis.errorbar(
                    place + shift, share, yerr=np.abs(reach), fmt=look.mark, color=look.color,
                    capsize=2, elinewidth=1, label=name if place == 0 else None,
                )  # fmt: skip
        axis.set_xticks(range(len(levels)), levels, rotation=20, ha="right")
        axis.set_ylim(-0.03, 1.03)
        axis.grid(visible=False, axis="x")
        axis.set_ylabel("share of trajectories")
    _legend(figure, panels[0][0], shown)
    return figure


DRAWN: Mapping[str, Callable[[Sequence[Datum]], Figure]] = {
    "curve": _draw_curve,
    "scores": _draw_scores,
    "pareto": _draw_pareto,
    "ranks": _draw_ranks,
    "validity": _draw_validity,
}
"""View -> what draws it."""
