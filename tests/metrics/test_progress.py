"""The curve of a run."""

from __future__ import annotations

from agentflow.metrics.progress import Progress, progress
from agentflow.runs import Event
from tests.metrics.events import attempt, evaluation


def test_one_point_per_evaluation() -> None:
    events = [
        attempt("designer/traj-1/attempt-1", tokens=10),
        evaluation("a", None, at=1.0),
        evaluation("b", 3.0, at=2.0),
        attempt("refiner/blind/traj-1/attempt-1", tokens=5),
        Event("expand", "env_feedback/traj-1/round-1", {}),
        evaluation("c", 2.0, at=3.0),
        evaluation("d", 9.0, valid=False, at=4.0),
        Event("edit", "env_feedback/traj-1/round-2", {}),
        evaluation("e", 1.0, at=5.0),
    ]
    assert list(progress(events)) == [
        Progress(1, 0, 1, 10, 1.0, None, None),
        Progress(2, 0, 1, 10, 2.0, 3.0, 3.0),
        Progress(3, 1, 2, 15, 3.0, 2.0, 3.0),
        Progress(4, 1, 2, 15, 4.0, 9.0, 3.0),
        Progress(5, 2, 2, 15, 5.0, 1.0, 3.0),
    ]
