"""The archive of a run as JSON for its page: axes, the best machine of each cell, classes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from agentflow.metrics.niches import Elites, best_by_class
from agentflow.runs import Event
from agentflow.runs.events import NicheEvent, RecordedAxis, RunEvent


def archive_of(events: Iterable[RunEvent | Event]) -> dict[str, Any] | None:
    """The merged archives of all searches; None if no search kept one."""
    every = tuple(events)
    elites = Elites.of(every)
    if elites is None:
        return None
    niches = [event for event in every if isinstance(event, NicheEvent)]
    return {
        "axes": [{"name": _title(axis), "cells": _cell_names(axis)} for axis in elites.axes],
        "cells": [{"cell": list(cell), **_machine(event)} for cell, event in elites.cells.items()],
        "size": elites.size,
        "coverage": elites.coverage,
        "qd_score": elites.qd_score,
        "classes": [_machine(event) for event in best_by_class(niches).values()],
    }


def _machine(event: NicheEvent) -> dict[str, Any]:
    return {"machine": event.machine, "score": event.score, "mechanism": event.mechanism}


def _title(axis: RecordedAxis) -> str:
    return f"{axis.name}, {axis.unit}" if axis.unit else axis.name


def _cell_names(axis: RecordedAxis) -> list[str]:
    """Categories, or the lower bound of each cell; cells of whole numbers have their number."""
    if axis.labels:
        return list(axis.labels)
    width = (axis.high - axis.low) / axis.cells
    middle = width / 2 if width == 1.0 and axis.low % 1 else 0.0
    return [f"{axis.low + cell * width + middle:g}" for cell in range(axis.cells)]
