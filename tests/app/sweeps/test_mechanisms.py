"""Mechanism classes in tables of sweeps."""

from __future__ import annotations

from pathlib import Path

from agentflow.app.sweeps.tables import FinishedRun, read_sweep_result
from agentflow.app.sweeps.views import classes_of, view
from agentflow.metrics.cells import RunNumbers
from agentflow.metrics.intervals import Rate
from agentflow.runs import read_result
from agentflow.runs.events import read_typed_events
from agentflow.runs.record import RunRecord
from tests.app.sweeps.test_tables import MODEL, sweep, values
from tests.metrics.events import candidate
from tests.metrics.test_niches import EVENTS

RECORDED = Path(__file__).parents[3] / "runs" / "recorded-throwing"
ARM, CAR = "springs / container / arm", "wheels / driven wheels / nothing"


def test_runs_with_an_archive_count_all_their_classes(tmp_path: Path) -> None:
    events = [candidate("initial", 1, 2.0), *(event for event in EVENTS)]
    runs = {"seed-0": events, "seed-1": [candidate("initial", 1, 3.0)]}
    table = view(sweep(tmp_path, runs, seeds=[0, 1]), "mechanisms")
    assert values(table) == {
        ("throwing", MODEL, "", ARM): (Rate(1, 2), 5.0, 5.0),
        ("throwing", MODEL, "", CAR): (Rate(1, 2), 4.0, 4.0),
    }


def test_of_other_runs_the_best_machine_counts(tmp_path: Path) -> None:
    planned = read_sweep_result(sweep(tmp_path, {"seed-0": [candidate("initial", 1, 1.0)]}))
    numbers = RunNumbers(RunRecord.of(read_typed_events(RECORDED)), 4)
    run = FinishedRun(planned.planned[0], RECORDED, read_result(RECORDED), "", numbers)
    assert classes_of(run) == {"motors / container / arm": read_result(RECORDED).score}
