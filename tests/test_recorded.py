"""The recorded runs that ship with the project replay to the last event."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.app.design.replay import replay

RUNS = sorted((Path(__file__).parent.parent / "runs").glob("recorded-*"))


def test_there_is_a_recorded_run() -> None:
    assert RUNS


@pytest.mark.pybullet
@pytest.mark.parametrize("run", RUNS, ids=lambda run: run.name)
def test_a_recorded_run_replays_identically(run: Path) -> None:
    said: list[str] = []
    assert replay(run, said.append) is None
    assert said == []
