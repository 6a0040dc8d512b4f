"""Measures the diversity of sources, and lays the results out as JSON data and as a table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from agentflow.app.diversity.sources import Source, read_sources
from agentflow.diversity.measures import Measures, compare
from agentflow.machine import Machine
from agentflow.metrics import published as literature
from agentflow.metrics.formats import counted
from agentflow.metrics.tables import FORMATS, Column, Row, Table
from agentflow.progress import Progress

TABLE = "diversity"
"""Name of the published table."""
NAMES = ("chamfer", "hausdorff", "iou", "graph_similarity", "tree_edit_distance")
"""Measures, in the order of results."""
PUBLISHED_NAMES = {"graph_similarity": "graph_embedding_similarity"}
"""Names of measures in the published table, where they differ."""
HEADINGS = ("Chamfer", "Hausdorff", "IoU", "graph similarity", "tree edit distance")
DIGITS = (3, 3, 3, 3, 2)

ABOUT = (
    "Means over all pairs of machines, with 95 % bootstrap intervals over machines. Chamfer and "
    "Hausdorff distances are in diagonals of a machine; the tree edit distance counts blocks; IoU "
    "and graph similarity are 1 for equal machines. The graph similarity also depends on which "
    "sources are compared."
)


@dataclass(frozen=True)
class Result:
    """A source and how different its machines are."""

    source: Source
    measures: Measures

    def to_json(self) -> dict[str, Any]:
        """The result as JSON data; without pairs, means and intervals are None."""
        found = {name: getattr(self.measures, name)._asdict() for name in NAMES}
        return {
            "source": self.source.name,
            "machines": self.measures.machines,
            "of": len(self.source.machines),
            **found,
            "left_out": dict(self.source.left_out),
        }

    @property
    def row(self) -> Row:
        """The result as a line of the table."""
        cells = [
            cell
            for name, digits in zip(NAMES, DIGITS, strict=True)
            for measure in [getattr(self.measures, name)]
            for cell in (measure.mean, measure.interval)
        ]
        return Row((self.source.name,), (self.measures.machines, *cells))

    @property
    def notes(self) -> list[str]:
        """What readers of the row should know."""
        name, count, of = self.source.name, self.measures.machines, len(self.source.machines)
        notes = [f"{name}/{file} is left out: {why}" for file, why in self.source.left_out.items()]
        if count < 2:
            notes.append(f"{name}: {counted(count, 'machine')}, so no pairs.")
        elif count < of:
            notes.append(f"{name}: {count} of {of} machines, drawn at random.")
        return notes


def measure_sources(
    paths: Iterable[Path], valid: bool, most: int, seed: int, say: Progress
) -> list[Result]:
    """Measure the machines of directories.

    Args:
        paths: See `read_sources`.
        valid: Leave out invalid machines.
        most: Machines of a source that are used; if it has more, they are drawn at random.
        seed: Of the draw, the embedding and the intervals.
        say: Told the number of pairs done, and of all pairs.

    Raises:
        RunError: A path is not a source, or is damaged.
    """
    sources = [source for path in paths for source in read_sources(path, valid)]
    drawn = [_draw(source.machines, most, seed) for source in sources]
    return [Result(*pair) for pair in zip(sources, compare(drawn, seed, say), strict=True)]


def _draw(machines: Sequence[Machine], most: int, seed: int) -> Sequence[Machine]:
    if len(machines) <= most:
        return machines
    return Random(f"diversity/{seed}").sample(machines, most)


def format_results(results: Sequence[Result], form: str, *, published: bool) -> str:
    """The results as text in one of the `FORMATS`, with published rows if `published`."""
    return FORMATS[form](_table(results, published_rows() if published else ()))


def _table(results: Sequence[Result], published: tuple[Row, ...]) -> Table:
    columns = [Column("", "number")]
    for heading, digits in zip(HEADINGS, DIGITS, strict=True):
        columns += [Column(heading, "mean", digits=digits), Column(heading, "95 %", digits=digits)]
    return Table(
        "Diversity of machines",
        ("machines",),
        tuple(columns),
        tuple(result.row for result in results),
        published,
        (*(note for result in results for note in result.notes), ABOUT),
    )


def published_rows() -> tuple[Row, ...]:
    """The published means as lines of the table; numbers of machines and intervals are unknown."""
    return tuple(
        Row((source,), (None, *(cell for name in NAMES for cell in (means[name], None))))
        for source, means in _published_means().items()
    )


def published_json() -> list[dict[str, Any]]:
    """The published means as JSON data, like `Result.to_json`."""
    return [
        {"source": source, **{name: {"mean": means[name], "interval": None} for name in NAMES}}
        for source, means in _published_means().items()
    ]


def _published_means() -> dict[str, dict[str, float]]:
    """Source -> name of a measure -> published mean."""
    ours = {PUBLISHED_NAMES.get(name, name): name for name in NAMES}
    found: dict[str, dict[str, float]] = {}
    for item in literature.published():
        if item.table == TABLE:
            means = found.setdefault(f"{item.model}, {item.task}", {})
            means[ours[item.metric]] = float(item.value)
    return found
