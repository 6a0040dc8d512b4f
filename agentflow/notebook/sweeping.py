"""Sweeps from Python: plans of files, documents and grids, carried out on a running event loop."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from agentflow.app.sweeps.folder import is_sweep
from agentflow.app.sweeps.members import ClientOf
from agentflow.app.sweeps.plan import SweepPlan, plan_config
from agentflow.app.sweeps.plan import plan_sweep as plan_sweep_file
from agentflow.app.sweeps.run import run_sweep_async
from agentflow.config.grid import ANSWER, METRICS, function_name, sweep_document
from agentflow.config.run import DesignConfig, load_document
from agentflow.config.sweep import SweepConfig, TableLayout, read_sweep
from agentflow.env.pool.base import Pool
from agentflow.errors import RunError, UsageError
from agentflow.llm.function import FunctionClient, ModelFunction
from agentflow.notebook.display.progress import SweepLine
from agentflow.notebook.sweeps import Sweep
from agentflow.runs import Notify


def plan_sweep(
    config: Path | str | Mapping[str, Any],
    answer: ModelFunction | None,
    seeds: int | Sequence[int] | None,
    given: Mapping[str, object],
    trust: bool,
) -> tuple[SweepPlan, ClientOf, Path | None]:
    """The plan of a sweep, what answers in its runs, and its directory if it has one."""
    known = {key: value for key, value in given.items() if value is not None}
    path = None if isinstance(config, Mapping) else Path(config)
    folder = path if path is not None and is_sweep(path) else None
    only = None if answer is None else FunctionClient(answer, function_name(answer))
    if path is not None and (only is None or folder):
        number = len(seeds) if isinstance(seeds, Sequence) else seeds
        plan = plan_sweep_file(path, (), known, number, lambda _sentence: trust)
        if isinstance(seeds, Sequence):
            sweep = plan.sweep.model_copy(update={"seeds": tuple(seeds)})
            plan = SweepPlan.of(plan.name, sweep)
        return plan, lambda _run: only, folder
    grid = config if isinstance(config, Mapping) else load_document(Path(config))
    document, functions = sweep_document(grid)
    clients = {label: FunctionClient(each, label) for label, each in functions.items()}
    if only is not None:
        known["model.name"] = only.name
    plan = plan_config(
        "sweep" if path is None else path.stem,
        read_sweep(document, "the sweep" if path is None else str(path)),
        (),
        known,
        seeds,
        source="the sweep",
        answered=bool(only or clients),
    )
    return plan, lambda run: only or clients.get(run.labels.get(ANSWER, "")), folder


async def design_seeds(
    config: DesignConfig,
    client: FunctionClient | None,
    seeds: int | Sequence[int],
    seed: int | None,
    jobs: int,
    out: Path,
    say: Notify,
    pool: Pool | None = None,
) -> Sweep:
    """The runs of one configuration with several seeds."""
    if seed is not None:
        raise UsageError("give either seed= or seeds=")
    several = tuple(range(seeds)) if isinstance(seeds, int) else tuple(seeds)
    if not several:
        raise UsageError("seeds= needs at least one seed")
    base = config.model_dump(mode="json", exclude={"seed"})
    title = f"{config.task}, {config.workflow}"
    table = TableLayout(metrics=METRICS, conditions="none")
    plan = SweepPlan.of(title, SweepConfig(title=title, base=base, seeds=several, table=table))
    return await carry_out_sweep(plan, lambda _run: client, None, jobs, out, None, False, say, pool)


async def carry_out_sweep(
    plan: SweepPlan,
    client_of: ClientOf,
    folder: Path | None,
    jobs: int,
    out: Path,
    name: str | None,
    resume: bool,
    say: Notify,
    pool: Pool | None = None,
) -> Sweep:

    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    place = folder or out / (name or f"{stamp}-{re.sub(r'[^A-Za-z0-9_.]+', '-', plan.name)}")
    watcher = SweepLine(len(plan.runs), say)
    outcome = await run_sweep_async(
        plan, place, watcher, jobs=jobs, resume=resume, pool=pool, client_of=client_of
    )
    if not outcome.done:
        first, reason = next(iter(outcome.failed.items()))
        raise RunError(f"every run of {place} has failed; {first}: {reason}")
    return Sweep(place)
