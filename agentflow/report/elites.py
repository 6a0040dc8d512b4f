"""Kinds of machines as JSON for the page of a run: its archive, and its mechanism classes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from agentflow.metrics.niches import Elites
from agentflow.report.lineage import LineageNode
from agentflow.runs import Event
from agentflow.runs.events import RecordedAxis, RunEvent


def archive_of(events: Iterable[RunEvent | Event]) -> dict[str, Any] | None:
    """The merged archives of all searches; None if no search kept one."""
    elites = Elites.of(events)
    if elites is None:
        return None
    return {
        "axes": [{"name": _title(axis), "cells": _cell_names(axis)} for axis in elites.axes],
        "cells": [
            {
                "cell": list(cell),
                "machine": event.machine,
                "score": event.score,
                "count": elites.counts[cell],
                "mechanism": event.mechanism,
            }
            for cell, event in elites.cells.items()
        ],
        "size": elites.size,
        "coverage": elites.coverage,
        "qd_score": elites.qd_score,
    }


def classes_of(
    machines: Mapping[str, LineageNode], mechanisms: Mapping[str, str | None]
) -> list[dict[str, Any]]:
    """The best machine of each mechanism class, best first, and the number of machines in it.

    Args:
        machines: Content hash -> node, the highest scores first.
        mechanisms: Content hash -> class; None or missing if it is unknown.
    """
    found: dict[str, dict[str, Any]] = {}
    count = Counter(mechanisms.get(digest) for digest in machines)
    for digest, node in machines.items():
        mechanism = mechanisms.get(digest)
        if mechanism is not None:
            best = {"machine": digest, "score": node.score, "count": count[mechanism]}
            found.setdefault(mechanism, {"mechanism": mechanism, **best})
    return list(found.values())


def _title(axis: RecordedAxis) -> str:
    return f"{axis.name}, {axis.unit}" if axis.unit else axis.name


def _cell_names(axis: RecordedAxis) -> list[str]:
    """Categories, or the lower bound of each cell; cells of whole numbers have their number."""
    if axis.labels:
        return list(axis.labels)
    width = (axis.high - axis.low) / axis.cells
    middle = width / 2 if width == 1.0 and axis.low % 1 else 0.0
    return [f"{axis.low + cell * width + middle:g}" for cell in range(axis.cells)]
