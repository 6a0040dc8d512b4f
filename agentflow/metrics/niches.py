"""Numbers of searches for many kinds of machines: coverage, QD score, mechanism classes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import prod

from agentflow.runs.events import ArchiveEvent, NicheEvent, RecordedAxis, RunEvent
from agentflow.runs.reading import Event

Cell = tuple[int, ...]


@dataclass(frozen=True)
class Elites:
    """The best machine of each cell over all searches of a run, or of several runs of one task.

    `cells` are in their order and have, of machines that score the same, the first; `counts` says
    how many different machines fell into each.
    """

    axes: tuple[RecordedAxis, ...]
    cells: dict[Cell, NicheEvent]
    counts: Mapping[Cell, int]

    @classmethod
    def of(cls, events: Iterable[RunEvent | Event]) -> Elites | None:
        """Merge the archives of all searches; None if no search kept one."""
        axes: tuple[RecordedAxis, ...] | None = None
        best: dict[Cell, NicheEvent] = {}
        machines: dict[Cell, set[str]] = {}
        for event in events:
            if isinstance(event, ArchiveEvent):
                axes = axes or event.axes
            elif isinstance(event, NicheEvent) and event.cell is not None:
                machines.setdefault(event.cell, set()).add(event.machine)
                known = best.get(event.cell)
                if known is None or _rank(event) < _rank(known):
                    best[event.cell] = event
        counts = {cell: len(found) for cell, found in machines.items()}
        return None if axes is None else cls(axes, dict(sorted(best.items())), counts)

    @property
    def size(self) -> int:
        """Number of cells of the grid, with or without a machine."""
        return prod(axis.cells for axis in self.axes)

    @property
    def coverage(self) -> float:
        """Share of the cells that have a machine."""
        return len(self.cells) / self.size

    @property
    def qd_score(self) -> float:
        """Sum of the scores of the best machines of all cells (quality-diversity score).

        It is not normalised; negative scores count as they are.
        """
        return sum(event.score or 0.0 for event in self.cells.values())


def best_by_class(niches: Iterable[NicheEvent]) -> dict[str, NicheEvent]:
    """The best machine of each mechanism class, the highest scores first.

    Every machine counts, kept in an archive or not.
    """
    found: dict[str, NicheEvent] = {}
    for event in niches:
        if event.mechanism is None or event.score is None:
            continue
        known = found.get(event.mechanism)
        if known is None or _rank(event) < _rank(known):
            found[event.mechanism] = event
    return dict(sorted(found.items(), key=lambda item: _rank(item[1])))


def _rank(event: NicheEvent) -> tuple[float, int, int]:
    """The highest score first, then the lowest trajectory and node, whatever came in first."""
    return -(event.score or 0.0), event.location.trajectory, event.location.node or 0
