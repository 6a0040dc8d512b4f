"""The numbers of a figure: long rows, of runs, sweeps and folders, and the CSV files that hold
them."""

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from pydantic import TypeAdapter

from agentflow.app.sweeps.folder import is_sweep
from agentflow.config.sweep import variant_of
from agentflow.errors import RunError, UsageError
from agentflow.files.atomic import os_errors, write_output
from agentflow.notebook.loading import load
from agentflow.notebook.recorded import Run, Sweep, load_runs
from agentflow.notebook.words import By, View
from agentflow.runs import find_runs
from agentflow.runs.locations import STAGES

CSV = ".csv"


@dataclass(frozen=True)
class Datum:
    """One number of a figure: a row of the CSV file.

    `measure` is what x is, such as `simulations`; of `scores` and `ranks`, what y is; of
    `validity`, a level. `x` is what was spent so far; of `validity`, the number of trajectories;
    None if there is none. `y` is a score; of `validity`, how many trajectories got so far.
    """

    view: str
    task: str
    condition: str
    run: str
    seed: int
    measure: str
    x: float | None
    y: float


_ROW = TypeAdapter(Datum)


def read_csv(path: Path, view: View) -> list[Datum]:
    """Rows that `write_csv` wrote.

    Raises:
        UsageError: The file cannot be read, holds something else, or rows of another view.
    """
    with os_errors(f"cannot read {path}"), path.open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file, restkey="more"))
    try:
        rows = [_ROW.validate_python({**line, "x": line["x"] or None}) for line in lines]
    except (KeyError, ValueError):
        columns = ", ".join(field.name for field in fields(Datum))
        raise UsageError(
            f"{path} is not a table of a figure: it needs the columns {columns}, as agentflow plot "
            "--out writes to .csv files"
        ) from None
    if not rows:
        raise UsageError(f"there is nothing to plot: {path} has no rows")
    if other := next((row.view for row in rows if row.view != view), None):
        raise UsageError(f"{path} has rows of the view {other}, not {view}: add --view {other}")
    return rows


def write_csv(rows: Iterable[Datum], out: Path) -> None:
    """Write the rows of a figure, one number a line, with full precision."""
    with write_output(out) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Datum)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


Source = Run | Sweep | Path | str
"""What figures are made from; a string is a path."""
LEVELS = ("in the format", "without overlaps", "valid", "valid after retries")
"""How far the trajectories of a run got, at their first attempt and in the end."""


@dataclass(frozen=True)
class PlottedRun:
    """A run, and what it is compared as.

    `name` is that of its folder, with folders above where others have the same one. Runs with the
    same `condition` differ only in their seeds.
    """

    run: Run
    name: str
    condition: str
    task: str


def read_rows(sources: Sequence[Source], view: View, by: By) -> list[Datum]:
    """The rows of a figure.

    Raises:
        RunError: A source holds no runs, or is damaged, or is a sweep without a finished run.
        UsageError: There is nothing to plot.
    """
    if not sources:
        raise UsageError("there is nothing to plot: name a run, a sweep, or a folder with runs")
    for item in sources:
        if not isinstance(item, str | Path | Run | Sweep):
            kind = type(item).__name__
            raise UsageError(f"cannot plot a {kind}: name each run, sweep or folder on its own")
    paths = [Path(item) for item in sources if isinstance(item, str | Path)]
    if len(paths) == len(sources) == 1 and paths[0].suffix.lower() == CSV:
        return read_csv(paths[0], view)
    runs = _name_runs(sources)
    rows = [row for run in runs for row in _ROWS[view](run, view, by)]
    if not rows:
        if view == "validity":
            raise UsageError("there is nothing to plot: these runs have no finished trajectories")
        raise UsageError("there is nothing to plot: no machine of these runs has a score")
    if view in ("curve", "pareto") and not any(row.x for row in rows):
        raise UsageError(f"there is nothing to plot: the runs report no {by}; choose another --by")
    return rows


def _name_runs(sources: Sequence[Source]) -> list[PlottedRun]:
    """The runs of all sources; with several sweeps or folders, conditions begin with the source."""
    paths = [item.path if isinstance(item, Run | Sweep) else Path(item) for item in sources]
    named = list(zip(_names(paths), map(_runs_of, sources), strict=True))
    together = [run for _, runs in named for run in runs]
    names = dict(zip(together, _names([run.path for run in together]), strict=True))
    several = len(named) > 1 and any(len(runs) > 1 for _, runs in named)
    found = []
    for name, runs in named:
        for run in runs:
            label = _condition(run, together)
            alone = run.config.workflow if len(named) > 1 else name
            condition = ": ".join(filter(None, (name * several, label))) or alone
            task = run.labels.get("task", run.config.task)
            found.append(PlottedRun(run, names[run], condition, task))
    return found


def _names(folders: Sequence[Path]) -> list[str]:
    """The names of folders, with as many folders above as tell them apart."""
    paths = [folder.resolve() for folder in folders]
    most = max((len(path.parts) for path in paths), default=0)
    names = [path.name for path in paths]
    for depth in range(2, most + 1):
        if len(set(names)) == len(set(paths)):
            break
        names = ["/".join(path.parts[-depth:]) for path in paths]
    return names


def _runs_of(source: Source) -> Sequence[Run]:
    if isinstance(source, str | Path):
        path = Path(source)
        if path.is_dir() and not is_sweep(path) and next(find_runs(path), path) != path:
            return load_runs(path)
        loaded = load(path)
        if not isinstance(loaded, Run | Sweep):
            raise RunError(f"{path} is not a run, a sweep, or a folder with runs")
        source = loaded
    if isinstance(source, Run):
        return [source]
    if not source.runs:
        raise RunError(f"no run of {source.path} is finished, so there is nothing to plot")
    return source.runs


def _condition(run: Run, others: Sequence[Run]) -> str:
    """The labels of a run in its sweep; else what of its configuration differs from the others."""
    if run.labels:
        return variant_of(run.labels)
    return ", ".join(
        value(run) for value in _DIFFERING if len({value(other) for other in others}) > 1
    )


_DIFFERING: tuple[Callable[[Run], str], ...] = (
    lambda run: run.config.workflow,
    lambda run: run.config.model.label or run.config.model.name,
    lambda run: run.config.prompts,
    lambda run: run.config.settings.search.strategy,
)
"""What runs outside of sweeps are compared by."""


def _datum(found: PlottedRun, view: View, measure: str, x: float | None, y: float) -> Datum:
    seed = found.run.config.seed
    return Datum(view, found.task, found.condition, found.name, seed, measure, x, y)


def _curve(found: PlottedRun, view: View, by: By) -> list[Datum]:
    """The points where the best score rises, and the last one."""
    points = found.run.curve(by)
    rising = [
        point
        for index, point in enumerate(points)
        if index in (0, len(points) - 1) or point.best > points[index - 1].best
    ]
    return [_datum(found, view, by, float(spent), best) for spent, best in rising]


def _score(found: PlottedRun, view: View, _: By) -> list[Datum]:
    """The verified score where there is one, else the score; 0 without a valid machine."""
    score = found.run.result.trusted_score
    verified = found.run.result.verified_score is not None
    return [_datum(found, view, "verified score" if verified else "score", None, score or 0.0)]


def _cost(found: PlottedRun, view: View, by: By) -> list[Datum]:
    """The score of a run, and what the run had spent at its last machine."""
    points = found.run.curve(by)
    score = found.run.result.trusted_score or 0.0
    return [_datum(found, view, by, float(points[-1].spent), score)] if points else []


def _validity(found: PlottedRun, view: View, _: By) -> list[Datum]:
    """Trajectories of the first stage, and how many of them got how far."""
    record = found.run.record
    items = next((items for stage in STAGES if (items := record.of_stage(stage))), [])
    if not items:
        return []
    counts = (
        sum(item.first.parsed for item in items),
        sum(item.first.spatial for item in items),
        sum(item.first.valid for item in items),
        sum(item.valid for item in items),
    )
    pairs = zip(LEVELS, counts, strict=True)
    return [_datum(found, view, level, len(items), count) for level, count in pairs]


_ROWS: Mapping[View, Callable[[PlottedRun, View, By], list[Datum]]] = {
    "curve": _curve,
    "scores": _score,
    "pareto": _cost,
    "ranks": _score,
    "validity": _validity,
}
