"""What the page of a run says of kinds of machines."""

from __future__ import annotations

from agentflow.report.elites import archive_of, classes_of
from agentflow.report.lineage import LineageNode
from tests.metrics.test_niches import EVENTS


def test_axes_and_cells() -> None:
    found = archive_of(EVENTS)
    assert found is not None
    assert found["axes"] == [
        {"name": "wheels", "cells": ["0", "1", "2", "3"]},
        {"name": "drive", "cells": ["springs", "motors"]},
    ]
    keys = ("cell", "machine", "score", "count")
    assert [tuple(item[key] for key in keys) for item in found["cells"]] == [
        ([0, 0], "m20", 5.0, 2),
        ([1, 0], "m22", 1.0, 1),
        ([3, 1], "m11", 4.0, 2),
    ]
    assert (found["size"], found["coverage"], found["qd_score"]) == (8, 0.375, 10.0)


def test_a_run_without_an_archive_has_none() -> None:
    assert archive_of(()) is None


def test_classes_name_their_best_machine_and_count_the_others() -> None:
    scores = {"a": 9.0, "b": 7.0, "c": 3.0, "d": None}
    machines = {
        name: LineageNode(name, None, "", "", name, score) for name, score in scores.items()
    }
    mechanisms = {"a": "springs", "b": "motors", "c": "springs", "d": None}
    assert classes_of(machines, mechanisms) == [
        {"mechanism": "springs", "machine": "a", "score": 9.0, "count": 2},
        {"mechanism": "motors", "machine": "b", "score": 7.0, "count": 1},
    ]
    assert classes_of(machines, {}) == []
