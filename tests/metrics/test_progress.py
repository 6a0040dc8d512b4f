"""The curve of a run."""

from __future__ import annotations

from agentflow.metrics.progress import ProgressPoint, progress
from tests.metrics.events import attempt, edit, evaluation, expansion


def test_one_point_per_evaluation() -> None:
    events = [
        attempt("designer/traj-1/attempt-1", tokens=10),
        evaluation("initial/traj-1", None, at=1.0),
        evaluation("initial/traj-2", 3.0, at=2.0),
        attempt("refiner/blind/traj-1/attempt-1", tokens=5),
        expansion(1, 1, "v"),
        evaluation("initial/traj-3", 2.0, at=3.0),
        evaluation("initial/traj-4", 9.0, valid=False, at=4.0),
        edit(1, 2),
        evaluation("initial/traj-5", 1.0, at=5.0),
    ]
    assert list(progress(events)) == [
        ProgressPoint(1, 0, 1, 10, 1.0, None, None),
        ProgressPoint(2, 0, 1, 10, 2.0, 3.0, 3.0),
        ProgressPoint(3, 1, 2, 15, 3.0, 2.0, 3.0),
        ProgressPoint(4, 1, 2, 15, 4.0, 9.0, 3.0),
        ProgressPoint(5, 2, 2, 15, 5.0, 1.0, 3.0),
    ]
