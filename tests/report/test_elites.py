"""What the page of a run says of its archive."""

from __future__ import annotations

from agentflow.report.elites import archive_of
from tests.metrics.test_niches import EVENTS


def test_axes_cells_and_classes() -> None:
    found = archive_of(EVENTS)
    assert found is not None
    assert found["axes"] == [
        {"name": "wheels", "cells": ["0", "1", "2", "3"]},
        {"name": "drive", "cells": ["springs", "motors"]},
    ]
    assert [(item["cell"], item["machine"], item["score"]) for item in found["cells"]] == [
        ([0, 0], "m20", 5.0),
        ([1, 0], "m22", 1.0),
        ([3, 1], "m11", 4.0),
    ]
    assert (found["size"], found["coverage"], found["qd_score"]) == (8, 0.375, 10.0)
    assert [item["mechanism"] for item in found["classes"]] == [
        "springs / container / arm",
        "wheels / driven wheels / nothing",
    ]


def test_a_run_without_an_archive_has_none() -> None:
    assert archive_of(()) is None
