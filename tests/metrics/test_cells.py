"""The numbers of cells, by hand."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import pytest

from agentflow.errors import RunError, UnknownNameError
from agentflow.metrics.cells import METRICS, Cell, RunNumbers, check_metrics, curve, mean_known
from agentflow.metrics.intervals import Rate
from agentflow.runs.events import RunEvent, read_typed_events
from agentflow.runs.record import RunRecord
from tests.metrics.events import candidate, evaluation, expansion, node

FIRST = [
    candidate("initial", 1, 4.0, first="psv"),
    candidate("initial", 2, None, valid=False, first="p"),
    candidate("env_feedback", 1, 6.0),
    expansion(1, 1, "vxv"),
    node(1, 1, 1, 5.0),
    node(1, 2, 1, 6.0),
    expansion(1, 2, "xx"),
]
SECOND = [
    candidate("initial", 1, 1.0, first="ps"),
    candidate("env_feedback", 1, 1.0),
    expansion(1, 1, "vv"),
    node(1, 1, 1, 0.5),
    node(1, 2, 1, 0.0),
]


def member(events: list[RunEvent], width: int = 2) -> RunNumbers:
    return RunNumbers(RunRecord.of(events), width)


def cell(stage: str, rounds: int | None = None) -> Cell:
    return Cell((member(FIRST), member(SECOND)), stage, rounds)


@pytest.mark.parametrize(
    ("metric", "stage", "value"),
    [
        ("valid", "initial", Rate(2, 3)),
        ("valid", "blind_refinement", None),
        ("mean", "initial", 2.5),
        ("mean_all", "initial", 5 / 3),
        ("max", "initial", 4.0),
        ("std", "initial", 1.5),
        ("file_valid", "initial", Rate(3, 3)),
        ("spatial_valid", "initial", Rate(2, 3)),
        ("machine_valid", "initial", Rate(1, 3)),
        ("mean", "env_feedback", 3.5),
        ("mean", "blind_refinement", None),
        ("avg_retry", "env_feedback", 7 / 4),
        ("validity_rate", "env_feedback", 4 / 6),
        ("avg_expansions_per_round", "env_feedback", 2.0),
        ("pass_of_50", "initial", Rate(2, 3)),
        ("pass_of_50", "blind_refinement", None),
    ],
)
def test_metrics_pool_their_runs(metric: str, stage: str, value: object) -> None:
    assert METRICS[metric].of(cell(stage)) == value


def test_success_counts_machines_not_scores() -> None:
    events = [
        evaluation("initial/traj-1", 5.0, "01", success=True),
        candidate("initial", 1, 5.0, machine="01"),
        evaluation("initial/traj-2", 9.0, "02", success=False),
        candidate("initial", 2, 9.0, machine="02"),
        candidate("initial", 3, None, valid=False, machine="03"),
        evaluation("initial/traj-4", None, "04", status="timeout"),
        candidate("initial", 4, None, machine="04"),
    ]
    found = Cell((member(events), member(events[:2])), "initial")
    assert METRICS["success"].of(found) == Rate(2, 4)
    assert METRICS["success_95"].of(found) == Rate(2, 4).interval


def test_met_counts_requirements_of_valid_machines() -> None:
    events = [
        evaluation("initial/traj-1", 5.0, "01", met=(1, 2)),
        candidate("initial", 1, 5.0, machine="01"),
        evaluation("initial/traj-2", 9.0, "02", met=(2, 2)),
        candidate("initial", 2, 9.0, machine="02"),
        candidate("initial", 3, None, valid=False, machine="03"),
    ]
    assert METRICS["met"].of(Cell((member(events), member(events[:2])), "initial")) == Rate(4, 6)
    assert METRICS["met"].of(cell("initial")) is None


def test_trees_cut_after_rounds_count_only_where_they_are_that_deep() -> None:
    assert METRICS["mean"].of(cell("env_feedback", rounds=1)) == 3.5
    assert METRICS["max"].of(cell("env_feedback", rounds=2)) == 6.0
    assert METRICS["mean"].of(cell("env_feedback", rounds=2)) == 6.0
    assert METRICS["mean"].of(cell("env_feedback", rounds=3)) is None


def test_no_runs_have_no_numbers() -> None:
    empty = Cell((), "initial")
    assert {metric.of(empty) for metric in METRICS.values()} == {None}


def test_the_curve_over_expansions() -> None:
    runs = [member(FIRST), member(SECOND)]
    means = [mean_known(chain.from_iterable(curve(runs, count))) for count in (0, 1, 2, 3)]
    assert means == [2.5, 3.0, 3.5, None]
    assert curve([], 0) == []


def test_a_metric_gets_the_machines_of_recorded_runs() -> None:
    recorded = Path(__file__).parents[2] / "runs" / "recorded-throwing"
    record = RunRecord.of(read_typed_events(recorded))
    run = RunNumbers(record, 4, path=recorded)
    for stage in ("initial", "env_feedback"):
        found = Cell((run, RunNumbers(record, 4)), stage).machines
        assert [machine.digest for machine in found] == [
            item.machine for item in record.of_stage(stage) if item.valid
        ]
        assert found
    with pytest.raises(RunError, match="it has no readable machines/"):
        _ = Cell((RunNumbers(record, 4, path=recorded.parent),), "initial").machines


def test_unknown_metrics_are_refused() -> None:
    check_metrics(METRICS)
    with pytest.raises(UnknownNameError, match="unknown metric 'avg_retri'; known: avg_retry"):
        check_metrics(["avg_retri"])
