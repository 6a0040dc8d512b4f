"""One run of a sweep: begin or resume it, and say what came of it."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agentflow.app.design.config import config_json
from agentflow.app.design.plan import RunPlan
from agentflow.app.design.run import RunOptions, design_async, resume_async
from agentflow.app.sweeps.folder import RUNS
from agentflow.config.sweep import SweepRun
from agentflow.env.pool.store import Store
from agentflow.errors import AgentflowError, EndpointError, RunError
from agentflow.llm.wrappers.limits import Limiters
from agentflow.runs import Event, read_document


@dataclass(frozen=True)
class Failure:
    """Why a run failed."""

    reason: str
    trace: str | None = None
    """The traceback of a bug."""
    endpoint: bool = False
    """Whether the endpoint could not be used."""


Outcome = Mapping[str, Any] | Failure
"""What came of a run: its result, or why there is none."""
Tell = Callable[[Event | str], None]
"""Receives the events of a run, and its remarks for the user."""


async def carry_out(
    run: SweepRun, folder: Path, store: Store, limiters: Limiters, tell: Tell
) -> Outcome:
    """Carry out a run in the folder of its sweep, and link its files to those of the store.

    Args:
        run: The run, possibly begun by an earlier process.
        folder: The sweep's folder.
        store: Simulates its machines.
        limiters: Shared with the other runs.
        tell: Receives events and remarks.
    """
    options = RunOptions(tell, tell, pool=store, limiters=limiters, named=config_json(run.config))
    try:
        result = await _run(run, folder / RUNS, options)
        store.share(folder / RUNS / run.name, RunPlan.of(run.config).task, run.config.seed)
    except AgentflowError as error:
        return Failure(str(error), endpoint=isinstance(error, EndpointError))
    except Exception as error:  # noqa: BLE001 - logged in full; other runs continue
        return Failure(f"{type(error).__name__}: {error}", traceback.format_exc())
    return result


async def _run(run: SweepRun, runs: Path, options: RunOptions) -> dict[str, Any]:
    path = runs / run.name
    if not _can_resume(path):
        return await design_async(run.config, runs, options, run.name)
    require_same(RunPlan.of(run.config), path)
    return await resume_async(path, options)


def require_same(plan: RunPlan, path: Path) -> None:
    """Refuse to mix new runs with one that was made under different conditions.

    Raises:
        RunError: The run at this path was.
    """
    if changes := plan.changes_since(read_document(path)):
        raise RunError(
            f"{path.parents[1]}: {path.name} was made with different {changes}: the remaining runs "
            "would not be comparable; choose another folder with --out"
        )


def _can_resume(path: Path) -> bool:
    """Whether a run can be resumed. Removes a folder whose run.yaml was never completed."""
    if not path.exists():
        return False
    if (path / "run.yaml").exists():
        return True
    if all(entry.name.endswith("-run.yaml") for entry in path.iterdir()):  # half-written
        for entry in path.iterdir():
            entry.unlink()
        path.rmdir()
        return False
    return True
