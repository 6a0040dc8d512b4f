"""Views of scores against what runs have spent: the curve, and the Pareto front."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agentflow.metrics.intervals import bootstrap_band
from agentflow.notebook.figures.panels import LABELS, add_legend, grouped, panels_of
from agentflow.notebook.figures.rows import Datum

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
