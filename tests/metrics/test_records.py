"""What metrics take from events; the recorded run as a whole."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.metrics.records import RunRecord, stage_of
from agentflow.runs import Event, read_events, read_result
from tests.metrics.events import candidate, expansion, node

RECORDED = Path(__file__).parent.parent.parent / "runs/recorded-throwing"


@pytest.mark.parametrize(
    ("label", "stage"),
    [
        ("meta_designer/attempt-1", "initial"),
        ("designer/structure-1/traj-2/candidate-1/attempt-3", "initial"),
        ("designer/traj-2/attempt-1", "initial"),
        ("placer/traj-1/attempt-1", "initial"),
        ("inspector/traj-1/attempt-1", "blind_refinement"),
        ("refiner/blind/traj-1/attempt-1", "blind_refinement"),
        ("querier/traj-2/node-0/attempt-1", "env_feedback"),
        ("refiner/feedback/traj-2/round-1/node-0/try-1/attempt-1", "env_feedback"),
        ("somebody/else", "other"),
    ],
)
def test_stage_of_a_call(label: str, stage: str) -> None:
    assert stage_of(label) == stage


def test_events_are_sorted_by_kind() -> None:
    record = RunRecord.of(
        [
            Event("run", "start", {}),
            candidate("initial", 1, 2.5),
            expansion(3, 2, "vxv"),
            node(3, 4, 2, 1.5),
        ]
    )
    (found,) = record.candidates
    assert (found.stage, found.trajectory, found.score, found.valid) == ("initial", 1, 2.5, True)
    assert [vars(item) for item in record.expansions] == [
        {"trajectory": 3, "round": 2, "attempts": 3, "children": 2}
    ]
    (child,) = record.nodes
    assert (child.trajectory, child.id, child.round, child.score) == (3, 4, 2, 1.5)
    assert record.stage("initial") == [found]
    assert record.stage("env_feedback") == []


def test_the_recorded_run_counts_as_its_result_says() -> None:
    record = RunRecord.of(read_events(RECORDED))
    for row in read_result(RECORDED)["stages"]:
        stage = record.stage(row["name"])
        assert sum(c.valid for c in stage) == row["valid"]
        assert sum(c.parsed_first for c in stage) == row["parsed_first"]
        assert max(c.score for c in stage if c.score is not None) == row["max"]
    assert sum(item.attempts for item in record.expansions) == 4
