"""What events add up to; the recorded run as a whole."""

from __future__ import annotations

from pathlib import Path

from agentflow.runs import Event, read_result
from agentflow.runs.events import (
    RemarkEvent,
    RunStartEvent,
    StageBeginEvent,
    read_typed_events,
)
from agentflow.runs.locations import Location
from agentflow.runs.record import RunRecord
from tests.metrics.events import attempt, candidate, edit, evaluation, expansion, node

RECORDED = Path(__file__).parent.parent.parent / "runs/recorded-throwing"


def test_events_are_sorted_by_kind() -> None:
    start = RunStartEvent(Location("start"), "throwing", "iterative", "a model")
    begun = StageBeginEvent(Location("initial"), 8)
    found, grown, child = candidate("initial", 1, 2.5), expansion(3, 2, "vxv"), node(3, 4, 2, 1.5)
    remark, unknown = RemarkEvent(Location("1"), "wait"), Event("tomorrow", "a", {"b": 1})
    record = RunRecord.of([start, begun, found, grown, child, remark, unknown, edit(1, 1)])
    assert (record.start, record.stage, record.remarks) == (start, begun, ["wait"])
    assert (record.candidates, record.expansions, record.nodes) == ([found], [grown], [child])
    assert (record.steps, record.calls, record.evaluations, record.best) == (2, 0, 0, None)
    assert (grown.valid, record.of_stage("initial"), record.of_stage("other")) == (2, [found], [])


def test_the_best_is_that_of_valid_machines() -> None:
    record = RunRecord.of(
        [
            evaluation("initial/traj-1", None, "a", status="timeout"),
            evaluation("initial/traj-2", 0.0, "b", valid=False, status="invalid"),
            evaluation("initial/traj-3", -2.0, "c"),
            evaluation("initial/traj-4", -1.0, "d"),
            evaluation("initial/traj-5", -1.5, "d"),
            attempt("designer/traj-1/attempt-1", tokens=10),
            attempt("designer/traj-1/attempt-2", tokens=5, valid=False),
        ]
    )
    assert (record.best, record.evaluations, set(record.machines)) == (-1.0, 5, set("abcd"))
    assert (record.calls, record.valid_calls, record.tokens) == (2, 1, 15)


def test_the_recorded_run_counts_as_its_result_says() -> None:
    record = RunRecord.of(read_typed_events(RECORDED))
    for row in read_result(RECORDED).stages:
        stage = record.of_stage(row.name)
        assert sum(c.valid for c in stage) == row.valid
        assert sum(c.first.parsed for c in stage) == row.parsed_first
        assert max(c.score for c in stage if c.score is not None) == row.max
    assert sum(len(item.attempts) for item in record.expansions) == 4
    assert [stage.data for stage in record.stages] == read_result(RECORDED).to_json()["stages"]
