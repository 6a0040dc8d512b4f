"""An archive of elites: the best candidate of each cell of a grid, kept by pyribs.

Needs the extra `explore`. It holds nothing that is not in the nodes offered to it, so a
search that is resumed or replayed builds the same archive again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, Literal, cast

from agentflow.errors import UsageError
from agentflow.extras import is_installed, missing
from agentflow.search.elites.axes import Axis, Measurement
from agentflow.search.node import C, Node

Cell = tuple[int, ...]
"""Number of the cell on each axis, from 0."""
Outcome = Literal["new", "better", "worse", "unmeasured"]
"""`new`: the first of its cell. `better` and `worse`: than the elite of its cell, which it replaced
or not; equals do not replace. `unmeasured`: invalid, without a score or without a value on an axis,
so that it belongs to no cell."""


def require_pyribs() -> None:
    """Raise ConfigError unless pyribs is installed; this does not import it."""
    if not is_installed("ribs"):
        raise missing("pyribs", "explore")


@dataclass(frozen=True)
class Filing:
    """What became of a node that was offered."""

    cell: Cell | None
    """None if it was unmeasured."""
    outcome: Outcome


class Archive(Generic[C]):
    """The best node of each cell."""

    def __init__(self, axes: Sequence[Axis]) -> None:
        """Begin with empty cells.

        Raises:
            UsageError: There are no axes.
        """
        from ribs.archives import GridArchive  # an extra, and seconds to import: pandas, numba ...

        if not axes:
            raise UsageError(
                "the strategy map-elites needs candidates that are measured on at least one axis; "
                "evaluate them with measurements, or choose another strategy"
            )
        self.axes = tuple(axes)
        self._grid: Any = GridArchive(
            solution_dim=(),
            dims=[axis.cells for axis in axes],
            ranges=[(axis.low, axis.high) for axis in axes],
            solution_dtype=int,
            objective_dtype=float,
            measures_dtype=float,
        )
        self._nodes: dict[int, Node[C]] = {}

    def offer(self, node: Node[C]) -> Filing:
        """File a node if its cell is empty or it is better than the elite there."""
        reward, values = node.evaluation.reward, _values(node.evaluation.measurements)
        if not node.evaluation.valid or reward is None or values is None:
            return Filing(None, "unmeasured")
        status = int(self._grid.add_single(node.id, reward, values)["status"])
        if status:
            self._nodes[node.id] = node
        outcomes: tuple[Outcome, ...] = ("worse", "better", "new")  # the numbers of pyribs
        return Filing(self._cell(values), outcomes[status])

    @property
    def elites(self) -> dict[Cell, Node[C]]:
        """The best node of each cell that has one, in order of the cells."""
        found = self._grid.data(["index", "solution"])
        cells = self._grid.int_to_grid_index(found["index"])
        numbered = zip(map(tuple, cells.tolist()), found["solution"].tolist(), strict=True)
        return {cell: self._nodes[id_] for cell, id_ in sorted(numbered)}

    def cell_of(self, node: Node[C]) -> Cell | None:
        """The cell that a node belongs to, filed or not; None if it is unmeasured."""
        values = _values(node.evaluation.measurements)
        return None if values is None else self._cell(values)

    def empty_neighbours(self, cell: Cell) -> list[Cell]:
        """Empty cells that are one step away on one axis; any other category is one step away."""
        taken = self.elites.keys()
        near = (
            (*cell[:at], index, *cell[at + 1 :])
            for at, axis in enumerate(self.axes)
            for index in range(axis.cells)
            if index != cell[at] and (axis.labels or abs(index - cell[at]) == 1)
        )
        return [item for item in near if item not in taken]

    def _cell(self, values: list[float]) -> Cell:
        index = self._grid.index_of_single(values)
        return cast(Cell, tuple(self._grid.int_to_grid_index([index])[0].tolist()))


def _values(measurements: Sequence[Measurement]) -> list[float] | None:
    """The values on all axes; None if one is missing."""
    values = [item.value for item in measurements if item.value is not None]
    return values if values and len(values) == len(measurements) else None
