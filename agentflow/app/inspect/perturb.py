"""Measures how robust the best machine of a finished run is, and keeps that in the run."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from agentflow.app.design.plan import RunPlan
from agentflow.app.design.results import read_finished
from agentflow.app.inspect.reading import best_machine
from agentflow.app.machines.perturb import perturb_text
from agentflow.errors import RunError
from agentflow.files import write_output
from agentflow.runs import read_document

KEPT = "robustness.json"
"""File of a run in which its report finds the result."""


def perturb_run(
    path: Path, *, count: int | None, workers: int, say: Callable[[int, int], None]
) -> dict[str, Any]:
    """`perturb_text` for the best machine of a run, at the run's task and with its seed.

    Raises:
        RunError: The run is unfinished, damaged or cannot be written, or has no valid machine.
        ConfigError: Its engine is not installed.
    """
    result, plan = read_finished(path), RunPlan.of_run(path, read_document(path))
    given, seed = best_machine(path, result).to_json(), plan.config.seed
    found = perturb_text(given, plan.task, count=count, seed=seed, workers=workers, say=say)
    with write_output(path / KEPT, RunError) as part:
        part.write_text(json.dumps(found) + "\n", encoding="utf-8")
    return {"run": str(path), **found}
