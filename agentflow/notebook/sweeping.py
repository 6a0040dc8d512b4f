"""Sweeps from Python: of files, documents, grids and seeds, with functions in place of models."""

import re
from collections.abc import Coroutine, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from agentflow.app.sweeps.folder import is_sweep
from agentflow.app.sweeps.plan import SweepPlan, plan_config
from agentflow.app.sweeps.plan import plan_sweep as plan_sweep_file
from agentflow.app.sweeps.run import run_blocking, run_sweep_async
from agentflow.config.grid import ANSWER, METRICS, function_name, sweep_document
from agentflow.config.run import DesignConfig
from agentflow.config.sweep import SweepConfig, TableLayout, read_sweep
from agentflow.env.pool.pool import Pool
from agentflow.errors import RunError, UsageError
from agentflow.llm.function import FunctionClient, ModelFunction
from agentflow.notebook.display.progress import SweepLine
from agentflow.notebook.recorded import Sweep
from agentflow.runs import Listener, Notify

EVERY = ""
"""In place of a label: the function answers in every run."""


@dataclass(frozen=True)
class SweepWork:
    """A sweep to carry out."""

    plan: SweepPlan
    folder: Path
    functions: Mapping[str, FunctionClient]
    """Label on the axis `answer`, or `EVERY` -> what answers in place of the models."""

    def wait_for(self, work: Coroutine[Any, Any, Sweep]) -> Sweep:
        """The result of `carry_out`, on a new event loop.

        Raises:
            InterruptedRunError: Ctrl-C; the sweep can be resumed.
        """
        if EVERY in self.functions:
            again = f"in Python: agentflow.sweep({str(self.folder)!r}, answer=..., resume=True)"
        elif self.functions:
            again = f"with the same call, name={self.folder.name!r} and resume=True"
        else:
            again = ""
        return run_blocking(work, self.plan, self.folder, again)

    async def carry_out(
        self,
        say: Notify,
        *,
        jobs: int,
        resume: bool = False,
        listener: Listener | None = None,
        pool: Pool | None = None,
    ) -> Sweep:
        """Carry out the unfinished runs.

        Raises:
            RunError: Every run has failed, or the folder cannot be used.
        """
        every = self.functions.get(EVERY)
        watcher = SweepLine(len(self.plan.runs), say, listener)
        outcome = await run_sweep_async(
            self.plan, self.folder, watcher,
            jobs=jobs, resume=resume, pool=pool,
            client_of=lambda run: self.functions.get(run.labels.get(ANSWER, EVERY), every),
        )  # fmt: skip
        if not outcome.done:
            first, reason = next(iter(outcome.failed.items()))
            raise RunError(f"every run of {self.folder} has failed; {first}: {reason}")
        return Sweep(self.folder)


def plan_sweep(
    config: Path | str | Mapping[str, Any],
    answer: ModelFunction | None,
    seeds: int | Sequence[int] | None,
    given: Mapping[str, Any],
    trust: bool,
    out: Path,
    name: str | None,
) -> SweepWork:
    """The sweep of a file, a directory, a document or a grid; see `agentflow.sweep`."""
    functions = {}
    begun = not isinstance(config, Mapping) and is_sweep(Path(config))
    if answer is not None:
        shown = str(given.get("model.name", function_name(answer)))
        functions = {EVERY: FunctionClient(answer, shown)}
        given = given if begun else {**given, "model.name": shown}
    if not isinstance(config, Mapping):
        path = Path(config)
        plan = plan_sweep_file(
            path, (), given, seeds, lambda _sentence: trust, answered=bool(functions)
        )
        return SweepWork(plan, path if begun else _new_folder(out, name, plan), functions)
    document, compared = sweep_document(config)
    if answer is not None and compared:
        raise UsageError(f"give either answer= or the key {ANSWER!r} of the grid")
    functions |= {label: FunctionClient(each, label) for label, each in compared.items()}
    sweep = read_sweep(document, "the sweep")
    plan = plan_config(
        "sweep", sweep, (), given, seeds, source="the sweep", answered=bool(functions)
    )
    return SweepWork(plan, _new_folder(out, name, plan), functions)


def plan_seeds(
    config: DesignConfig,
    client: FunctionClient | None,
    seeds: int | Sequence[int],
    seed: int | None,
    out: Path,
) -> SweepWork:
    """The runs of one configuration with several seeds."""
    if seed is not None:
        raise UsageError("give either seed= or seeds=")
    several = tuple(range(seeds)) if isinstance(seeds, int) else tuple(seeds)
    if not several:
        raise UsageError("seeds= needs at least one seed")
    base = config.model_dump(mode="json", exclude={"seed"})
    title = f"{config.task}, {config.workflow}"
    table = TableLayout(metrics=METRICS, conditions="none")
    sweep = SweepConfig(title=title, base=base, seeds=several, table=table)
    functions = {} if client is None else {EVERY: client}
    plan = plan_config(title, sweep, (), {}, None, source=title, answered=bool(functions))
    return SweepWork(plan, _new_folder(out, None, plan), functions)


def _new_folder(out: Path, name: str | None, plan: SweepPlan) -> Path:
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    return out / (name or f"{stamp}-{re.sub(r'[^A-Za-z0-9_.]+', '-', plan.name)}")
