"""Measures the diversity of sources, and lays the results out as JSON data and as a table.

Sources are the machines of runs, sweeps, training runs, and folders of machine files.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from random import Random
from typing import Any

from pydantic import ValidationError

from agentflow.app.machines.files import read_one
from agentflow.diversity.measures import Measures, compare
from agentflow.errors import RunError, UsageError
from agentflow.files.atomic import os_errors
from agentflow.files.lines import read_lines
from agentflow.machine import Machine, library, place, read_machine, spatial_problems
from agentflow.metrics import published as literature
from agentflow.metrics.machines import recorded_machine
from agentflow.metrics.tables import Column, Row, Table, counted
from agentflow.progress import Progress
from agentflow.runs import find_runs, read_document
from agentflow.runs.events import read_typed_events
from agentflow.runs.record import RunRecord
from agentflow.training.evaluation.replies import JudgedReply
from agentflow.training.record import ABOUT as TRAINING
from agentflow.training.record import read_training

SUFFIXES = (".json", ".bsg")


@dataclass(frozen=True)
class Source:
    """A set of machines, and what it is called."""

    name: str
    machines: tuple[Machine, ...]
    left_out: Mapping[str, str] = field(default_factory=dict)
    """File that is not a construction tree -> why."""


def read_sources(path: Path, valid: bool) -> list[Source]:
    """The machines in a directory; those of a training run by step.

    Args:
        path: A run (the machines at the end of its last stage, one per trajectory), a directory
            that holds runs, such as a sweep (those of all runs), a training run (those in the
            replies of each sampled step), or a folder with machine files.
        valid: Leave out invalid machines. Those of runs and of training were judged by the rules of
            their task, those in files are judged by the rules of space.

    Raises:
        RunError: It is none of these, or is damaged.
    """
    if (path / TRAINING).is_file():
        files = read_training(path).samples.items()
        return [Source(f"{path}, step {n}", tuple(_replies(file, valid))) for n, file in files]
    if runs := list(find_runs(path)):
        return [Source(str(path), tuple(m for run in runs for m in _candidates(run, valid)))]
    return [_folder(path, valid)]


def _candidates(run: Path, valid: bool) -> Iterator[Machine]:
    read_document(run)  # refuses edited runs and links
    found = RunRecord.of(read_typed_events(run)).candidates
    for item in found:
        if item.location.name != found[-1].location.name or item.machine is None:
            continue
        if item.valid or not valid:
            yield recorded_machine(run, item.machine)


def _replies(file: Path, valid: bool) -> Iterator[Machine]:
    for reply in read_lines(file, _read_reply):
        machine = read_machine(reply.machine, tuple(library())).machine if reply.machine else None
        if machine is not None and (reply.valid or not valid):
            yield machine


def _read_reply(line: bytes) -> JudgedReply:
    try:
        return JudgedReply.model_validate_json(line)
    except ValidationError:
        raise ValueError("expected a judged reply") from None


def _folder(path: Path, valid: bool) -> Source:
    with os_errors(f"cannot read {path}"):
        entries = sorted(entry for entry in path.iterdir() if entry.is_file())
    files = [file for file in entries if file.suffix.lower() in SUFFIXES]
    if not files:
        raise RunError(
            f"{path} holds no machines: expected a run, a sweep, a training run, or .json or .bsg "
            "files"
        )
    machines, left_out = [], {}
    for file in files:
        try:
            machines.append(read_one(str(file)))
        except UsageError as error:
            left_out[file.name] = str(error).removeprefix(f"{file}").lstrip(": ")
    kept = (m for m in machines if not valid or not spatial_problems(place(m)))
    return Source(str(path), tuple(kept), left_out)


TABLE = "diversity"
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
        cells = chain.from_iterable(getattr(self.measures, name) for name in NAMES)
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


def results_table(results: Sequence[Result], *, published: bool) -> Table:
    """The results in lines, with published rows if `published`."""
    columns = [Column("", "number")]
    for heading, digits in zip(HEADINGS, DIGITS, strict=True):
        columns += [Column(heading, "mean", digits=digits), Column(heading, "95 %", digits=digits)]
    return Table(
        "Diversity of machines",
        ("machines",),
        tuple(columns),
        tuple(result.row for result in results),
        published_rows() if published else (),
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
