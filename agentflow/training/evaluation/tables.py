"""Tables of evaluations and training runs, in the layouts of the published ones."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from agentflow.errors import RunError, UsageError
from agentflow.metrics.cells import Scores
from agentflow.metrics.intervals import missing_scipy
from agentflow.metrics.published import published
from agentflow.metrics.tables import FORMATS, Column, Row, Table, Value
from agentflow.training.evaluation.record import Collection, PooledEvaluation, collect, read_replies
from agentflow.training.evaluation.replies import Summary, summaries
from agentflow.training.record import OF_SAMPLES, flatten
from agentflow.training.views import COMPARED, CURVES, VIEWS

GENERAL, UNCERTAINTY = "post_training", "post_training_ci"
"""Published tables."""
MAIN = ("valid", "mean", "max")
IN_SHARES = (".count", ".of")
"""Ends of the names of logged numbers that are left out, as the share of both is there."""
BASE = "Base"
"""Name of the published model before training."""
TO = " to "
"""Between the tasks in the name of a published transfer, as in "Throwing to Movement"."""
INTERVAL = "95 %"
NUMBERS = (
    Column("valid", "count"),
    Column("valid", INTERVAL, percent=True),
    Column("all replies", "mean"),
    Column("all replies", INTERVAL),
    Column("all replies", "SD"),
    Column("", "max"),
)
MEANING = (
    "valid: replies with a valid machine. Means and SD (of the population) are over all replies, "
    "invalid ones scored 0; max is over valid machines."
)
INTERVALS = "Shares have Wilson intervals, means have bootstrap intervals (10,000 resamples)."
BEST = (
    "Best@N is the expected best score of N replies, computed exactly over all replies, with "
    "invalid ones scored 0."
)


def general_table(found: Collection, *, with_published: bool = False) -> Table:
    """Validity, mean and greatest score by task, a row for each name."""
    tasks = found.tasks
    rows = tuple(
        Row(_labels(item), tuple(value for task in tasks for value in _main(item, task)))
        for item in found.evaluations
    )
    others = tuple(_published_general(tasks)) if with_published else ()
    columns = tuple(Column(task, name) for task in tasks for name in MAIN)
    notes = (*_notes(found), MEANING)
    return Table("Trained models", ("name", "model"), columns, rows, others, notes)


def uncertainty_table(found: Collection, *, with_published: bool = False) -> Table:
    """Every number with its interval, by task."""
    return _numbers_table(found, with_published, transfer=False)


def transfer_table(found: Collection, *, with_published: bool = False) -> Table:
    """What models achieve at tasks, beside the tasks of their reinforcement learning."""
    return _numbers_table(found, with_published, transfer=True)


def _numbers_table(found: Collection, with_published: bool, *, transfer: bool) -> Table:
    """The numbers of each evaluation at each task; with the tasks that it was trained on."""

    def row(trained_on: str, labels: tuple[str, ...], values: tuple[Value, ...]) -> Row:
        return Row((trained_on, *labels) if transfer else labels, values)

    own = tuple(
        row(
            ", ".join(item.first.trained_on) or "-",
            (task, *_labels(item)),
            _numbers(item.summaries[task]),
        )
        for task, item in _by_task(found)
    )
    others = _published_numbers(found.tasks, transfer=transfer) if with_published else ()
    about = "trained on: the tasks of the reinforcement learning; a dash for models without any."
    return Table(
        f"Trained models: {'transfer' if transfer else 'uncertainty'}",
        (*(("trained on", "evaluated on") if transfer else ("task",)), "name", "model"),
        NUMBERS,
        own,
        tuple(row(key[1].lower().partition(TO)[0], key, values) for key, values in others),
        (*_notes(found), *[about] * transfer, MEANING, INTERVALS, *filter(None, [missing_scipy()])),
    )


def best_table(found: Collection) -> Table:
    """Best@N of the evaluations, and of the samples that training runs took between steps."""
    scores: dict[tuple[str, ...], Scores] = {
        (task, item.name, "-"): item.summaries[task].scores for task, item in _by_task(found)
    }
    for name, run in found.trainings.items():
        for step, path in run.samples.items():
            replies = read_replies(path)
            for task, own in summaries(replies, dict.fromkeys(r.task for r in replies)).items():
                scores[task, name, str(step)] = own.scores
    best = {key: own.best_at() for key, own in scores.items()}
    counts = sorted({n for own in best.values() for n in own})
    return Table(
        "Trained models: Best@N",
        ("task", "name", "step"),
        tuple(Column("Best@N, N =", str(n)) for n in counts),
        tuple(Row(key, tuple(own.get(n) for n in counts)) for key, own in best.items()),
        notes=(
            *_notes(found),
            BEST,
            "Rows with a step are samples of a training run after that step.",
        ),
    )


def curves_table(found: Collection) -> Table:
    """Every number that training runs logged, a row for each step."""
    runs = {name: [flatten(row) for row in run.curves] for name, run in found.trainings.items()}
    every = dict.fromkeys(key for rows in runs.values() for row in rows for key in row)
    names = [key for key in every if key != "step" and not key.endswith(IN_SHARES)]
    names.sort(key=lambda key: key.startswith(OF_SAMPLES))  # the numbers of every step come first
    return Table(
        "Training runs: curves",
        ("run", "step"),
        tuple(Column("", key) for key in names),
        tuple(
            Row((name, str(row["step"])), tuple(row.get(key) for key in names))
            for name, rows in runs.items()
            for row in rows
        ),
        notes=tuple(f"{name}: {run.about.label}." for name, run in found.trainings.items()),
    )


def format_tables(folders: Sequence[Path], name: str, form: str, *, published: bool) -> str:
    """A view of the evaluations and training runs in folders, as text in one of the `FORMATS`.

    Raises:
        UnknownNameError: There is no such view of them.
        UsageError: The view has no published rows.
        RunError: A folder holds neither, or something is damaged.
    """
    make = VIEWS[name]
    if published and name not in COMPARED:
        views = ", ".join(COMPARED)
        raise UsageError(f"only these views have published rows: {views}; not {name!r}")
    found = collect(folders)
    _require_rows(found, name)
    return FORMATS[form](make(found, with_published=True) if published else make(found))


def _require_rows(found: Collection, name: str) -> None:
    """Refuse a table without rows, and name one that has some."""
    if name in COMPARED and not found.evaluations:
        raise RunError(
            f"there is no evaluation for the view {name!r}: make one with agentflow evaluate, or "
            "use --show curves or --show best"
        )
    if name == CURVES and not found.trainings:
        raise RunError(f"there is no training run for the view {name!r}, only evaluations")


def _labels(item: PooledEvaluation) -> tuple[str, str]:
    return item.name, item.first.label


def _by_task(found: Collection) -> Iterator[tuple[str, PooledEvaluation]]:
    """Every task with each evaluation of it."""
    for task in found.tasks:
        for item in found.evaluations:
            if task in item.tasks:
                yield task, item


def _main(item: PooledEvaluation, task: str) -> tuple[Value, Value, Value]:
    own = item.summaries.get(task)
    if own is None or not own.replies:
        return None, None, None
    return own.valid, own.mean, own.scores.max


def _numbers(own: Summary) -> tuple[Value, ...]:
    return (
        own.valid if own.replies else None,
        own.valid.interval,
        own.mean,
        own.scores.mean_all_interval(own.seed),
        own.sd,
        own.scores.max,
    )


def _published_general(tasks: Sequence[str]) -> Iterator[Row]:
    rows: dict[str, dict[tuple[str, str], str]] = {}
    for item in published():
        if item.table == GENERAL:
            rows.setdefault(item.model, {})[item.task, item.metric] = item.value
    for model, values in rows.items():
        base, _, training = model.partition(" + ")
        cells = tuple(values.get((task, name)) for task in tasks for name in MAIN)
        if any(cell is not None for cell in cells):
            yield Row((training or BASE, base), cells)


def _published_numbers(
    tasks: Sequence[str], *, transfer: bool
) -> list[tuple[tuple[str, str, str], tuple[Value, ...]]]:
    """(task, name, model) and numbers of the published models, or of the published transfers."""
    rows: dict[tuple[str, str, str], dict[str, str]] = {}
    for item in published():
        if item.table == UNCERTAINTY and item.task in tasks and (TO in item.condition) == transfer:
            rows.setdefault((item.task, item.condition, item.model), {})[item.metric] = item.value
    names = ("valid", "validity_ci95", "mean", "mean_ci95", "sd", "max")
    ordered = sorted(rows.items(), key=lambda row: tasks.index(row[0][0]))
    return [(key, tuple(map(values.get, names))) for key, values in ordered]


def _notes(found: Collection) -> tuple[str, ...]:
    notes = []
    for item in found.evaluations:
        if len(item.members) > 1:
            notes.append(f"{item.name}: {len(item.members)} evaluations, pooled.")
        if item.missing:
            total = item.missing + len(item.replies)
            notes.append(f"INCOMPLETE: {item.name} lacks {item.missing} of {total} replies.")
        for task, own in item.summaries.items():
            if own.faults:
                notes.append(
                    f"{item.name}, {task}: left out {own.faults} of "
                    f"{own.replies + own.faults} replies, whose simulation crashed or timed out."
                )
    if found.engines:
        only = "; no number is of more than one" if len(found.engines) > 1 else ""
        notes.append(f"Physics engine: {', '.join(found.engines)}{only}.")
    return tuple(notes)
