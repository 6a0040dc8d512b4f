"""Views of a sweep: scores with intervals, cost, players' scale, expansions, verified scores,
mechanism classes."""

import statistics
from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path

from agentflow.agents.registry import stage_of
from agentflow.app.design.execution import best_machine
from agentflow.app.sweeps.against import against_table, read_results
from agentflow.app.sweeps.registry import LAYOUT, VIEWS
from agentflow.app.sweeps.tables import (
    FinishedRun,
    SweepResult,
    group_runs,
    layout_table,
    record_note,
    task_of,
)
from agentflow.env.archive import load_npz
from agentflow.env.mechanism import classify
from agentflow.errors import UsageError
from agentflow.metrics import published as literature
from agentflow.metrics.cells import Cell, RunNumbers, Scores, curve, mean_known
from agentflow.metrics.intervals import Rate, bootstrap_clusters, missing_scipy
from agentflow.metrics.niches import best_by_class
from agentflow.metrics.tables import Column, Row, Table, Value
from agentflow.metrics.usage import Spent, UsageSummary, summarize_usage
from agentflow.models.choices import cost_function
from agentflow.runs import RunResult, read_calls
from agentflow.runs.events import NicheEvent
from agentflow.runs.locations import STAGES

VARIANT = ("task", "model", "variant")


def _table(
    result: SweepResult,
    what: str,
    heads: tuple[str, ...],
    columns: Iterable[Column],
    rows: Iterable[Row],
    *notes: str,
) -> Table:
    """A view of a sweep, with the notes of every table and those that are not empty."""
    title = f"{result.sweep.title}: {what}"
    told = (*result.notes, *filter(None, notes))
    return Table(title, heads, tuple(columns), tuple(rows), notes=told)


def mechanisms_table(result: SweepResult) -> Table:
    """In how many runs machines of each mechanism class were found, and how good, by variant."""
    rows = []
    for key, runs in all_variants(result).items():
        scores: dict[str, list[float]] = {}
        for run in runs:
            for name, score in classes_of(run).items():
                scores.setdefault(name, []).append(score)
        for name, found in sorted(scores.items(), key=lambda item: -max(item[1])):
            values = (Rate(len(found), len(runs)), max(found), statistics.fmean(found))
            rows.append(Row((*key, name), values))
    return _table(
        result,
        "mechanism classes",
        (*VARIANT, "mechanism class"),
        (Column("", name) for name in ("runs", "best", "mean")),
        rows,
        "Classes say what drives / what holds / how it releases. For runs of explore, all machines "
        "count; for other runs, only the best machine. runs: number of runs with such a machine. "
        "mean: mean of its highest score over these runs.",
    )


def classes_of(run: FinishedRun) -> dict[str, float]:
    """Mechanism class -> highest score of its machines.

    A run that kept an archive recorded the classes of all its machines. For other runs, only the
    best machine is known, by its stored rollout; nothing if there is none, or if it is from before
    work was measured.
    """
    niches = [event for event in run.numbers.record.archives if isinstance(event, NicheEvent)]
    if niches:
        return {name: event.score or 0.0 for name, event in best_by_class(niches).items()}
    machine = best_machine(run.result)
    file = run.path / "rollouts" / f"{'' if machine is None else machine.digest}.npz"
    if machine is None or not file.exists():
        return {}
    mechanism = classify(machine, load_npz(file))
    return {} if mechanism is None else {str(mechanism): run.result.score or 0.0}


CURVE = (0, 1, 2, 4, 8, 12, 16, 20, 30, 40)
"""Numbers of expansions at which strategies are compared."""
INTERVAL = "95 %"
OWN_SCALE = (
    "Scores come from this simulator, the players' from the game, so the share is approximate."
)

OF_VERIFIED_RUNS = (
    "Means over the best machines of the verified runs: their score, and the median (verified), "
    "lowest and highest score in simulations with a finer time step and slightly different masses, "
    "friction and drives. fragile: how many of them fail in some of these simulations. The share "
    "is the verified score divided by the greatest possible score or, if there is none, by the "
    "verified score of the best known machine."
)


def scores_table(result: SweepResult) -> Table:
    """Validity with Wilson intervals, means with bootstrap intervals, and Best@N, by variant.

    Without scipy, bootstrap intervals are missing and a note says so.
    """
    cells = {key: last_cell(result, runs) for key, runs in all_variants(result).items()}
    powers = sorted({n for cell in cells.values() for n in cell.scores.best_at()})
    columns = [
        *(Column("valid", name) for name in ("share", INTERVAL)),
        *(Column("valid machines", name) for name in ("mean", INTERVAL)),
        *(Column("all machines (invalid scored 0)", name) for name in ("mean", INTERVAL)),
        *(Column("", name) for name in ("max", "std")),
        *(Column("Best@N, N =", str(n)) for n in powers),
    ]
    return _table(
        result,
        "scores",
        VARIANT,
        columns,
        (Row(key, _score_values(cell.scores, powers)) for key, cell in cells.items()),
        "Scores are those of the last stage. Shares have Wilson intervals, means have bootstrap "
        "intervals (10,000 resamples). Best@N is the expected best score of N machines, computed "
        "exactly over all machines, with invalid ones scored 0. std is the population standard "
        "deviation.",
        missing_scipy(),
    )


def _score_values(found: Scores, powers: Iterable[int]) -> tuple[Value, ...]:
    rate, best = Rate(len(found.valid), len(found.all)), found.best_at()
    return (
        *(rate, rate.interval),
        *(found.mean_valid, found.mean_valid_interval()),
        *(found.mean_all, found.mean_all_interval()),
        *(found.max, found.std),
        *(best.get(n) for n in powers),
    )


def usage_table(result: SweepResult) -> Table:
    """Cost of runs by role and stage, and speed of simulation."""
    rows: list[Row] = []
    for key, runs in variants(result).items():
        whole = total_usage(runs)
        speeds = simulation_speeds([run.result for run in runs])
        parts = [("all", whole.total), *whole.roles.items(), *whole.stages.items()]
        for name, spent in parts:
            share = whole.token_shares.get(name)
            values = (
                *(spent.calls, spent.tokens, share, spent.reasoning),
                *(spent.money, spent.seconds, spent.retries),
                *(speeds if name == "all" else (None, None)),
            )
            rows.append(Row((*key, name), values))
    names = ("calls", "tokens", "share", "reasoning", "money", "seconds", "retries")
    columns = [Column("", name, percent=name == "share") for name in names]
    columns += [Column("", "rollouts/s"), Column("", "simulated s/s")]
    about = (
        "Tokens are those reported by the endpoint. Money is shown only if every model has a "
        "price. Seconds are the sum of latencies. rollouts/s and simulated s/s are per worker."
    )
    return _table(result, "usage", (*VARIANT, "of"), columns, rows, about)


def players_table(result: SweepResult) -> Table:
    """The best score of each task divided by the published mean of experienced players."""
    means = literature.player_means()
    rows = []
    for (task, model), runs in _by_task(result).items():
        scores = [run.result.score for run in runs]
        best = max((score for score in scores if score is not None), default=None)
        mean = means.get(task.partition("/")[0])
        share = best / mean if best is not None and mean else None
        rows.append(Row((task, model), (best, mean, share)))
    columns = (
        Column("", "best score"),
        Column("", "players' mean (published)"),
        Column("", "share", percent=True),
    )
    what = "best score relative to the experienced players' mean"
    return _table(result, what, VARIANT[:2], columns, rows, OWN_SCALE)


def expansions_table(result: SweepResult) -> Table:
    """Mean best score of searches against the number of new machines, by variant."""
    groups = all_variants(result)
    curves = {key: {n: curve(_numbers(runs), n) for n in CURVE} for key, runs in groups.items()}
    counts = [n for n in CURVE if any(any(found[n]) for found in curves.values())]
    rows = []
    for key, found in curves.items():
        pairs = (
            (mean_known(chain.from_iterable(found[n])), bootstrap_clusters(found[n]))
            for n in counts
        )
        rows.append(Row(key, tuple(chain.from_iterable(pairs))))
    return _table(
        result,
        "score against expansions",
        VARIANT,
        (Column(f"N = {n}", name) for n in counts for name in ("mean", INTERVAL)),
        rows,
        "" if counts else "No run of this sweep searches.",
        "Best score so far after N new machines, averaged over searches and including the initial "
        "machine; a search that ended early keeps its final value. Intervals are bootstrap "
        "intervals over runs (10,000 resamples), because searches of one run are not independent; "
        "a single run has none.",
        missing_scipy(),
    )


def verified_table(result: SweepResult) -> Table:
    """Recorded and verified scores of the best machines of the runs, by variant."""
    rows = []
    for key, runs in all_variants(result).items():
        found = [run.numbers.record.verification for run in runs]
        complete = [item for item in found if item is not None and item.score is not None]
        scores = [item.scores[0].score for item in complete if item.scores]
        verified = mean_known(item.score for item in complete)
        low = mean_known(item.low for item in complete)
        high = mean_known(item.high for item in complete)
        done = Rate(len(complete), len(found))
        holding = [item.holding for item in complete]
        fragile = sum(bool(item and item.fragile) for item in holding) if complete else None
        share = mean_known(run.numbers.share for run in runs if run.numbers.record.verification)
        rows.append(Row(key, (done, mean_known(scores), verified, low, high, fragile, share)))
    names = ("verified runs", "score", "verified", "low", "high", "fragile")
    columns = (*(Column("", name) for name in names), Column("", "share", percent=True))
    notes = OF_VERIFIED_RUNS, *record_note(result)
    return _table(result, "verified scores", VARIANT, columns, rows, *notes)


def view(
    folders: Path | Sequence[Path],
    name: str = LAYOUT,
    *,
    published: bool = False,
    against: str | None = None,
) -> Table:
    """A table of the sweeps and the runs in folders, with published rows if `published`.

    `against` is a condition, in place of the view: the table shows differences from it.

    Raises:
        UnknownNameError: There is no such view, or no such condition.
        UsageError: The view has no published rows.
        RunError: A folder is damaged, or has no finished run.
    """
    folders = [folders] if isinstance(folders, Path) else folders
    make = VIEWS[name]
    if against is not None:
        if published or name != LAYOUT:
            raise UsageError("--against has a table of its own: remove --show and --published")
        return against_table(read_results(folders), against)
    if not published:
        return make(read_results(folders))
    if name != LAYOUT:
        raise UsageError(f"only the view {LAYOUT!r} has published rows, not {name!r}")
    return layout_table(read_results(folders), published=True)


def variants(result: SweepResult) -> dict[tuple[str, ...], list[FinishedRun]]:
    """Task, model and variant -> finished runs, in the order of the sweep."""
    return {key: runs for key, runs in all_variants(result).items() if runs}


def all_variants(result: SweepResult) -> dict[tuple[str, ...], list[FinishedRun]]:
    """Like `variants`, including those without finished runs."""
    return group_runs(result, lambda run, model: (task_of(run), model, run.variant))


def _by_task(result: SweepResult) -> dict[tuple[str, str], list[FinishedRun]]:
    """Task and model, with the engine if there are several -> finished runs."""
    groups: dict[tuple[str, str], list[FinishedRun]] = {}
    for run in result.finished:
        model = run.result.model
        if len(result.engines) > 1:
            model = f"{model}, {run.engine}"
        groups.setdefault((task_of(run.planned), model), []).append(run)
    return groups


def _numbers(runs: Iterable[FinishedRun]) -> tuple[RunNumbers, ...]:
    return tuple(run.numbers for run in runs)


def last_cell(result: SweepResult, runs: Sequence[FinishedRun]) -> Cell:
    """The cell of the last stage that any of the runs reached."""
    reached = {item.location.name for run in runs for item in run.numbers.record.candidates}
    last = [stage for stage in STAGES if stage in reached]
    return Cell(_numbers(runs), last[-1] if last else result.sweep.table.stage)


def total_usage(runs: Iterable[FinishedRun]) -> UsageSummary:
    """What the runs cost."""
    summaries = (
        summarize_usage(read_calls(run.path), cost_function(run.planned.config.model), stage_of)
        for run in runs
    )
    return sum(summaries, UsageSummary(Spent(), {}, {}))


def simulation_speeds(found: Sequence[RunResult]) -> tuple[float | None, float | None]:
    """Rollouts, and simulated seconds, per second of a worker; None if nothing was simulated."""
    seconds = sum(result.worker_seconds for result in found)
    if not seconds:
        return None, None
    simulated = sum(result.simulated_seconds for result in found)
    return sum(result.rollouts for result in found) / seconds, simulated / seconds
