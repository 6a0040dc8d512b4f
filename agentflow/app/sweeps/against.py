"""Differences between the conditions of a sweep, by pairs of runs with the same seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean

from agentflow.app.sweeps.tables import (
    FinishedRun,
    SweepResult,
    conditions,
    identity_notes,
    task_of,
)
from agentflow.errors import UnknownNameError, UsageError
from agentflow.metrics.cells import METRICS, Cell
from agentflow.metrics.intervals import Rate, bootstrap_mean, missing_scipy, seeds_needed
from agentflow.metrics.tables import Column, Row, Table, Value

FEW = 5
"""Fewer pairs have bootstrap intervals that are too narrow."""
MEANING = (
    "Each run gives one number, of all its machines; runs of one task with the same seed are a "
    "pair. difference: mean over pairs of condition - baseline, with its bootstrap interval over "
    "pairs (10,000 resamples). higher: pairs in which the condition has the higher number. seeds "
    "needed: about how many seeds show a difference of this size, so that its interval leaves out "
    "0 in four of five sweeps."
)


@dataclass(frozen=True)
class _Side:
    """What one number of a difference is computed from."""

    run: FinishedRun
    stage: str
    rounds: int | None = None

    def number(self, metric: str) -> float | None:
        """The metric of this run alone; None where it is not a number."""
        with METRICS.blaming(metric):
            value = METRICS[metric].of(Cell((self.run.numbers,), self.stage, self.rounds))
        value = value.value if isinstance(value, Rate) else value
        return float(value) if isinstance(value, float | int) else None


_Sides = Mapping[str, Mapping[int, _Side]]
"""Condition -> seed -> side."""


def against_table(result: SweepResult, baseline: str) -> Table:
    """How the metrics of each condition differ from those of one of them.

    Conditions are the variants of the sweep, or the stages or rounds that its table compares.

    Raises:
        UnknownNameError: The sweep has no such condition.
        UsageError: It has no other condition, or no run of this one is finished.
    """
    found = _groups(result, baseline)
    if not any(baseline in sides for sides in found.values()):
        raise UsageError(f"no run of the condition {baseline!r} is finished")
    layout = result.sweep.table
    rows, fewest, apart = [], 0, False
    for (task, variant), sides in found.items():
        for condition in filter(lambda name: name != baseline, sides):
            pairs = _pairs(sides[baseline], sides[condition]) if baseline in sides else []
            same = [(one, other) for one, other in pairs if one.run.engine == other.run.engine]
            apart |= len(same) < len(pairs)
            for metric in layout.task_metrics.get(task, layout.metrics):
                numbers = [(one.number(metric), other.number(metric)) for one, other in same]
                known = [(a, b) for a, b in numbers if a is not None and b is not None]
                if known:
                    fewest = min(fewest or len(known), len(known))
                label = ", ".join(filter(None, [variant, condition]))
                rows.append(Row((task, label, metric), _difference(known)))
    return Table(
        f"{result.sweep.title}: differences from {baseline}",
        ("task", "condition", "metric"),
        (
            Column("", "pairs"),
            *(Column("mean", name) for name in (baseline, "condition")),
            *(Column("difference", name) for name in ("mean", "95 %")),
            *(Column("", name) for name in ("higher", "seeds needed")),
        ),
        tuple(rows),
        notes=(
            *result.notes[1:],
            MEANING,
            *identity_notes(dict.fromkeys(row.labels[2] for row in rows)),
            *([f"Intervals of fewer than {FEW} pairs are too narrow."] * (0 < fewest < FEW)),
            *(["Runs of different engines are no pair."] * apart),
            *filter(None, [missing_scipy()]),
        ),
    )


def _difference(pairs: Sequence[tuple[float, float]]) -> tuple[Value, ...]:
    """The values of a row, from (baseline, condition) of each pair."""
    if not pairs:
        return 0, *[None] * 6
    apart = [other - one for one, other in pairs]
    return (
        len(pairs),
        *(fmean(side) for side in zip(*pairs, strict=True)),
        fmean(apart),
        bootstrap_mean(apart),
        Rate(sum(value > 0 for value in apart), len(apart)),
        seeds_needed(apart),
    )


def _pairs(one: Mapping[int, _Side], other: Mapping[int, _Side]) -> list[tuple[_Side, _Side]]:
    return [(one[seed], other[seed]) for seed in one if seed in other]


def _groups(
    result: SweepResult, baseline: str
) -> dict[tuple[str, str], dict[str, dict[int, _Side]]]:
    """(task, variant) -> the sides of each condition; variants are themselves conditions, "" then,
    unless the baseline is a stage or a number of rounds."""
    layout = result.sweep.table
    variants = tuple(dict.fromkeys(run.variant for run in result.planned))
    within = () if layout.conditions in ("axes", "none") else conditions(result)
    known = tuple(filter(None, (*variants, *within)))
    if baseline not in known:
        raise UnknownNameError("condition", baseline, known)
    if len(within if baseline in within else variants) < 2:
        raise UsageError(f"the sweep has no other condition than {baseline!r}")
    found: dict[tuple[str, str], dict[str, dict[int, _Side]]] = {}
    seen: dict[tuple[str, str, int], str] = {}
    for run in result.finished:
        task, seed = task_of(run.planned), run.planned.config.seed
        twin = seen.setdefault((task, run.planned.variant, seed), run.planned.name)
        if twin != run.planned.name:
            raise UsageError(
                f"{twin} and {run.planned.name} have the same task, condition and seed, so "
                "--against cannot tell which is whose pair: move one of them elsewhere"
            )
        variant = run.planned.variant
        if baseline in variants:
            group, sides = (task, ""), {variant: _Side(run, layout.stage)}
        elif layout.conditions == "rounds":
            counts = zip(within, layout.rounds, strict=True)
            group = task, variant
            sides = {name: _Side(run, layout.stage, count) for name, count in counts}
        else:
            group, sides = (task, variant), {name: _Side(run, name) for name in within}
        for name, side in sides.items():
            found.setdefault(group, {}).setdefault(name, {})[seed] = side
    return found
