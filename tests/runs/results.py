"""Results of runs for tests that do not carry one out."""

from __future__ import annotations

from typing import Any

from agentflow.runs import RunResult


def a_result(**changes: Any) -> RunResult:
    """The result of a run that found nothing, with these changes."""
    found: dict[str, Any] = {
        "task": "throwing",
        "workflow": "hierarchical",
        "seed": 0,
        "score": None,
        "valid": False,
        "machine": None,
        "stages": [],
        "rollouts": 0,
        "stopped": None,
        "reason": "",
        "model": "m",
        "calls": 0,
        "tokens": 0,
        "seconds": 0.0,
        "simulated_seconds": 0.0,
        "worker_seconds": 0.0,
        "run": "",
    }
    return RunResult.model_validate(found | changes)
