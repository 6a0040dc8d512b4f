"""Owns the further views of a sweep: scores with intervals, cost, players' scale, expansions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from agentflow.agents.registry import stage_of
from agentflow.app.design.models import cost_function
from agentflow.app.sweeps.tables import Finished, Swept, layout, listed, read_swept, task_of
from agentflow.errors import UnknownNameError, UsageError
from agentflow.metrics import published as literature
from agentflow.metrics.cells import Cell, RunNumbers, Value, curve
from agentflow.metrics.intervals import missing_scipy
from agentflow.metrics.tables import FORMATS, Column, Row, Table, shown
from agentflow.metrics.usage import Bill, SimulationSpeed, Spent, bill
from agentflow.metrics.validity import Rate
from agentflow.runs import read_calls, read_result
from agentflow.runs.places import STAGES

LAYOUT = "published"
"""The view in the layout of the published table."""
PLAYERS = "players"
"""The view over the means of experienced players."""
CURVE = (0, 1, 2, 4, 8, 12, 16, 20, 30, 40)
"""Expansions at which strategies are compared, as far as searches go."""
INTERVAL = "95 %"
OWN_SCALE = "Scores are this simulator's, the players' are the game's: the share is no exact one."


def scores(swept: Swept) -> Table:
    """Means of both kinds with bootstrap intervals, validity with Wilson's, Best@N, by variant.

    Without scipy the bootstrap's are left out, and the notes say so.
    """
    groups = _with_undone(swept)
    cells = {key: last_cell(swept, runs) for key, runs in groups.items()}
    powers = sorted({n for cell in cells.values() for n in cell.scores.best_at()})
    columns = [
        *(Column("valid", name) for name in ("share", INTERVAL)),
        *(Column("valid machines", name) for name in ("mean", INTERVAL)),
        *(Column("all machines, invalid = 0", name) for name in ("mean", INTERVAL)),
        *(Column("", name) for name in ("max", "std")),
        *(Column("Best@N, N =", str(n)) for n in powers),
    ]
    rows = []
    for key, cell in cells.items():
        found = cell.scores
        rate = Rate(len(found.valid), len(found.all))
        best = found.best_at()
        values: list[Value] = [
            rate,
            _between(rate.interval),
            found.mean_valid,
            _between(found.mean_valid_interval()),
            found.mean_all,
            _between(found.mean_all_interval()),
            found.max,
            found.std,
            *(best.get(n) for n in powers),
        ]
        rows.append(Row(key, tuple(values)))
    return Table(
        f"{swept.sweep.title}: scores",
        ("task", "model", "variant"),
        tuple(columns),
        tuple(rows),
        notes=(
            *swept.notes,
            "Of the last stage. Shares with Wilson's interval, means with the bootstrap's (10,000 "
            "resamples); Best@N is exact, over all, invalid = 0; std is the population's.",
            *filter(None, [missing_scipy()]),
        ),
    )


def usage(swept: Swept) -> Table:
    """What runs cost, by role and by stage, and how fast machines were simulated."""
    rows: list[Row] = []
    for (task, model, variant), runs in variants(swept).items():
        whole = _bill(runs)
        speed = _simulated(runs)
        parts = [("all", whole.total), *whole.roles.items(), *whole.stages.items()]
        for name, spent in parts:
            share = whole.token_shares.get(name)
            rate = speed.rollouts_per_second if name == "all" else None
            simulated = speed.speed if name == "all" else None
            rows.append(Row((task, model, variant, name), (*_spent(spent, share), rate, simulated)))
    names = ("calls", "tokens", "share", "reasoning", "money", "seconds", "retries")
    columns = [Column("", name, percent=name == "share") for name in names]
    columns += [Column("", "rollouts/s"), Column("", "simulated s/s")]
    notes = (
        *swept.notes,
        "Tokens as reported by the endpoint; money only where every model has a price; seconds are "
        "latencies added up; rollouts/s and simulated s/s are per worker.",
    )
    heads = ("task", "model", "variant", "of")
    return Table(f"{swept.sweep.title}: usage", heads, tuple(columns), tuple(rows), notes=notes)


def players(swept: Swept) -> Table:
    """The best score of each task over the mean of experienced players (published scale)."""
    means = literature.player_means()
    rows = []
    for (task, model), runs in _by_task(swept).items():
        best = max(
            (_best(run) for run in runs), default=None, key=lambda s: (s is not None, s or 0)
        )
        mean = means.get(task.partition("/")[0])
        share = best / mean if best is not None and mean else None
        rows.append(Row((task, model), (best, mean, share)))
    columns = (
        Column("", "best score"),
        Column("", "players' mean (published)"),
        Column("", "share", percent=True),
    )
    title = f"{swept.sweep.title}: best score over the experienced players' mean"
    return Table(title, ("task", "model"), columns, tuple(rows), notes=(*swept.notes, OWN_SCALE))


def expansions(swept: Swept) -> Table:
    """The mean best score of all searches after so many new machines each, by variant."""
    groups = _with_undone(swept)
    counts = [
        n for n in CURVE if any(curve(_numbers(runs), n) is not None for runs in groups.values())
    ]
    rows = tuple(
        Row(key, tuple(curve(_numbers(runs), count) for count in counts))
        for key, runs in groups.items()
    )
    return Table(
        f"{swept.sweep.title}: score against expansions",
        ("task", "model", "variant"),
        tuple(Column("new machines per search", str(count)) for count in counts),
        rows,
        notes=(
            *swept.notes,
            *(() if counts else ("No run of this sweep searches.",)),
            "Mean over searches of the best score so far, the start included; a search that ended "
            "earlier keeps its last.",
        ),
    )


VIEWS: Mapping[str, Callable[[Swept], Table]] = MappingProxyType(
    {
        LAYOUT: layout,
        "scores": scores,
        "usage": usage,
        PLAYERS: players,
        "expansions": expansions,
    }
)
"""Name -> how a table is made of a sweep."""


def view(path: Path, name: str = LAYOUT, *, published: bool = False) -> Table:
    """A table of a sweep.

    Args:
        path: The sweep's folder.
        name: Of the view.
        published: Whether published rows stand under the measured ones.

    Raises:
        UnknownNameError: There is no such view.
        UsageError: Published rows are asked of a view that has none.
        RunError: As `read_swept`.
    """
    if name not in VIEWS:
        raise UnknownNameError("view", name, VIEWS)
    if not published:
        return VIEWS[name](read_swept(path))
    if name != LAYOUT:
        raise UsageError(f"published rows exist in the view {LAYOUT!r} alone, not in {name!r}")
    return layout(read_swept(path), published=True)


def written(path: Path, name: str, form: str, *, published: bool = False) -> str:
    """A table of a sweep as text in one of the `FORMATS`; see `view`."""
    return FORMATS[form](view(path, name, published=published))


def variants(swept: Swept) -> dict[tuple[str, ...], list[Finished]]:
    """Task, model and variant -> their runs, in the order of the sweep."""
    groups: dict[tuple[str, ...], list[Finished]] = {}
    for run in swept.runs:
        key = (task_of(run.member), run.model, run.member.variant)
        groups.setdefault(key, []).append(run)
    return groups


def _with_undone(swept: Swept) -> dict[tuple[str, ...], list[Finished]]:
    """As `variants`, and those of which nothing is done, without runs."""
    groups: dict[tuple[str, ...], list[Finished]] = {}
    for member, model, runs in listed(swept, lambda one: (task_of(one), one.variant)):
        groups.setdefault((task_of(member), model, member.variant), []).extend(runs)
    return groups


def _by_task(swept: Swept) -> dict[tuple[str, str], list[Finished]]:
    groups: dict[tuple[str, str], list[Finished]] = {}
    for run in swept.runs:
        groups.setdefault((task_of(run.member), run.model), []).append(run)
    return groups


def _numbers(runs: Iterable[Finished]) -> tuple[RunNumbers, ...]:
    return tuple(run.numbers for run in runs)


def last_cell(swept: Swept, runs: Sequence[Finished]) -> Cell:
    """Of the last stage that any of the runs came to."""
    reached = {item.place.name for run in runs for item in run.numbers.record.candidates}
    last = [stage for stage in STAGES if stage in reached]
    return Cell(_numbers(runs), last[-1] if last else swept.sweep.table.stage)


def _best(run: Finished) -> float | None:
    score = read_result(run.path)["score"]
    return None if score is None else float(score)


def _between(interval: tuple[float, float] | None) -> str | None:
    return None if interval is None else f"{shown(interval[0])} - {shown(interval[1])}"


def _bill(runs: Iterable[Finished]) -> Bill:
    total = Bill(Spent(), {}, {})
    for run in runs:
        total += bill(read_calls(run.path), cost_function(run.member.config.model), stage_of)
    return total


def _simulated(runs: Iterable[Finished]) -> SimulationSpeed:
    total = SimulationSpeed(0, 0.0, 0.0)
    for run in runs:
        result = read_result(run.path)
        total += SimulationSpeed(
            result["rollouts"], result["simulated_seconds"], result["worker_seconds"]
        )
    return total


def _spent(spent: Spent, share: float | None) -> tuple[Value, ...]:
    return (
        spent.calls,
        spent.tokens,
        share,
        spent.reasoning,
        spent.money,
        spent.seconds,
        spent.retries,
    )
