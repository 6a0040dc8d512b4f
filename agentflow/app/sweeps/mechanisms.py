"""The view of mechanism classes: in how many runs machines of each class were found."""

from __future__ import annotations

import statistics

from agentflow.app.design.execution import best_machine
from agentflow.app.sweeps.tables import FinishedRun, SweepResult
from agentflow.app.sweeps.views import all_variants
from agentflow.env.archive import load_npz
from agentflow.env.mechanism import classify
from agentflow.metrics.intervals import Rate
from agentflow.metrics.niches import best_by_class
from agentflow.metrics.tables import Column, Row, Table
from agentflow.runs.events import NicheEvent


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
    return Table(
        f"{result.sweep.title}: mechanism classes",
        ("task", "model", "variant", "mechanism class"),
        tuple(Column("", name) for name in ("runs", "best", "mean")),
        tuple(rows),
        notes=(
            *result.notes,
            "Classes say what drives / what holds / how it releases. For runs of explore, all "
            "machines count; for other runs, only the best machine. runs: number of runs with "
            "such a machine. mean: mean of its highest score over these runs.",
        ),
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
