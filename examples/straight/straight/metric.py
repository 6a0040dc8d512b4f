"""A metric: the median score."""

from __future__ import annotations

from statistics import median

from agentflow.metrics.cells import Cell, Metric


def median_score(cell: Cell) -> float | None:
    """The median score of the valid machines; None if there are none."""
    scores = cell.scores.valid
    return median(scores) if scores else None


MEDIAN = Metric(median_score, "median score over valid machines")
