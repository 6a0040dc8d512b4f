"""A machine is checked once between the reply that holds it and its last rollout."""

from __future__ import annotations

import cProfile
import pstats
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from agentflow.agents.designer import Designer
from agentflow.agents.refiner import Refiner
from agentflow.app.design.run import RunOptions, design
from agentflow.config.run import build_config
from agentflow.machine import validity
from agentflow.runs.events import AttemptEvent, read_typed_events
from tests.runs.sources import InProcess

PACKAGE = Path(validity.__file__).parents[1]
CONFIG = {
    "task": "movement",
    "workflow": "iterative",
    "settings": {"trajectories": 1, "search": {"rounds": 1, "width": 2}},
}


def checks_by_part(profile: cProfile.Profile) -> Counter[str]:
    """How often each part of the package has called the checker."""
    found: Counter[str] = Counter()
    stats: dict[tuple[str, int, str], Any] = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    for (file, _, function), (*_, callers) in stats.items():
        if (file, function) == (validity.__file__, "check"):
            for (caller, _, _), (calls, *_) in callers.items():
                found[Path(caller).relative_to(Path(validity.__file__).parents[1]).parts[0]] += (
                    calls
                )
    return found


@pytest.mark.slow
def test_an_accepted_machine_is_checked_once(tmp_path: Path) -> None:
    profile = cProfile.Profile()
    result = profile.runcall(
        design, build_config(CONFIG), tmp_path, RunOptions(pool=InProcess()), "run"
    )
    assert result.rollouts >= 2
    assert result.verified_score is not None  # eight more rollouts, of the best machine
    replies = [
        event
        for event in read_typed_events(tmp_path / "run")
        if isinstance(event, AttemptEvent) and event.role in (Designer.name, Refiner.name)
    ]
    checks = checks_by_part(profile)
    assert checks["agents"] == len(replies)
    assert {*checks} <= {"agents", "llm"}  # the procedural model checks its own designs
