"""Carries out sweeps: several runs at a time on one pool; the failure of one stops no other."""

from __future__ import annotations

import asyncio
import json
import traceback
from collections.abc import Iterator, Mapping
from contextlib import AsyncExitStack
from dataclasses import dataclass, field
from pathlib import Path
from shlex import quote
from typing import Any, Protocol

from agentflow.app.design.config import config_json
from agentflow.app.design.run import RunOptions, design_async, resume_async
from agentflow.app.design.trust import trust_option
from agentflow.app.sweeps.folder import LOG, RUNS, STORE, lock_folder, sweep_document
from agentflow.app.sweeps.plan import SweepPlan
from agentflow.config.run import build_config
from agentflow.config.sweep import SweepRun
from agentflow.env.pool.pool import RolloutPool, Simulator
from agentflow.env.pool.store import Store
from agentflow.errors import AgentflowError, EndpointError, InterruptedRunError, RunError
from agentflow.files import LineFile
from agentflow.llm.wrappers.limits import Limiter
from agentflow.runs import Event, read_document
from agentflow.search.concurrency import run_concurrently


class Watcher(Protocol):
    """Receives the progress of a sweep."""

    def run_started(self, run: str) -> None:
        """A run was started or resumed."""

    def event(self, run: str, event: Event) -> None:
        """An event of a run."""

    def remark(self, run: str, line: str) -> None:
        """A line of text from a run for the user."""

    def run_finished(self, run: str, result: Mapping[str, Any]) -> None:
        """A run is finished; `result` is the content of its result.json."""

    def run_failed(self, run: str, reason: str) -> None:
        """A run has failed."""


@dataclass(frozen=True)
class SweepOutcome:
    """The names of a sweep's finished and failed runs."""

    path: Path
    done: tuple[str, ...]
    """Including runs finished by earlier processes."""
    failed: Mapping[str, str]
    """Name -> reason in one line."""
    endpoint: bool = False
    """Whether every failure was the endpoint's."""


def run_sweep(
    plan: SweepPlan,
    folder: Path,
    watcher: Watcher,
    *,
    jobs: int,
    resume: bool,
    pool: Simulator | None = None,
) -> SweepOutcome:
    """Carry out the unfinished runs of a sweep.

    Args:
        plan: The sweep.
        folder: The sweep's folder.
        watcher: Receives progress.
        jobs: Number of concurrent runs.
        resume: Whether the folder may already hold the sweep.
        pool: Simulates machines for all runs; by default a new pool with the `workers` of the
            base configuration.

    Raises:
        RunError: The folder cannot be used.
        InterruptedRunError: Ctrl-C; the sweep can be resumed.
    """
    with lock_folder(folder, sweep_document(plan.name, plan.sweep), resume):
        work = _Work(plan, folder, watcher)
        try:
            asyncio.run(work.carry_out(jobs, pool))
        except KeyboardInterrupt:
            raise InterruptedRunError(
                f"interrupted; {len(work.done)} of {len(plan.runs)} runs are done; continue "
                f"with: agentflow {plan.sweep.command} {quote(str(folder))} --resume"
                f"{trust_option(plan.configs)}"
            ) from None
    order = [run.name for run in plan.runs]
    return SweepOutcome(
        folder,
        tuple(name for name in order if name in work.done),
        {name: work.failed[name] for name in order if name in work.failed},
        work.failed.keys() == work.endpoint and bool(work.endpoint),
    )


@dataclass
class _Work:
    """A sweep in progress."""

    plan: SweepPlan
    folder: Path
    watcher: Watcher
    done: set[str] = field(default_factory=set)
    failed: dict[str, str] = field(default_factory=dict)
    endpoint: set[str] = field(default_factory=set)
    """Runs that failed because the endpoint could not be used."""
    limiters: dict[str, Limiter] = field(default_factory=dict)

    async def carry_out(self, jobs: int, pool: Simulator | None) -> None:
        waiting = [run for run in self.plan.runs if not self._is_done(run)]
        if not waiting:
            return
        self._require_same_conditions()
        log = LineFile(self.folder / LOG)
        try:
            async with AsyncExitStack() as stack:
                if pool is None:
                    workers = build_config(self.plan.sweep.base).workers
                    pool = await stack.enter_async_context(RolloutPool(workers))
                store = Store(self.folder / STORE, pool)
                queue = iter(waiting)
                await run_concurrently(self._work_through(queue, store, log) for _ in range(jobs))
        finally:
            log.close()

    def _is_done(self, run: SweepRun) -> bool:
        if (self.folder / RUNS / run.name / "result.json").exists():
            self.done.add(run.name)
        return run.name in self.done

    def _require_same_conditions(self) -> None:
        """Refuse to mix new runs with finished ones made under different conditions."""
        for run in self.plan.runs:
            if run.name in self.done:
                self._require_same(run)

    def _require_same(self, run: SweepRun) -> None:
        document = read_document(self.folder / RUNS / run.name)
        if changes := self.plan.plan_of(run).changes_since(document):
            raise RunError(
                f"{self.folder}: {run.name} was made with different {changes}: the "
                "remaining runs would not be comparable; choose another folder with --out"
            )

    async def _work_through(self, queue: Iterator[SweepRun], store: Store, log: LineFile) -> None:
        """Carry out runs from a shared queue until none are left."""
        for run in queue:
            name = run.name
            self.watcher.run_started(name)
            try:
                result = await self._run(run, store)
            except AgentflowError as error:
                if isinstance(error, EndpointError):
                    self.endpoint.add(name)
                self._fail(name, str(error), None, log)
            except Exception as error:  # noqa: BLE001 - logged in full; other runs continue
                reason = f"{type(error).__name__}: {error}"
                self._fail(name, reason, traceback.format_exc(), log)
            else:
                plan = self.plan.plan_of(run)
                store.share(self.folder / RUNS / name, plan.task, run.config.seed)
                self.done.add(name)
                _write_log(log, {"run": name, "state": "done", "seconds": result["seconds"]})
                self.watcher.run_finished(name, result)

    async def _run(self, run: SweepRun, store: Store) -> dict[str, Any]:
        runs, name = self.folder / RUNS, run.name
        path = runs / name
        options = RunOptions(
            notify=lambda line: self.watcher.remark(name, line),
            listener=lambda event: self.watcher.event(name, event),
            pool=store,
            limiters=self.limiters,
            named=config_json(run.config),
        )
        if _can_resume(path):
            self._require_same(run)
            return await resume_async(path, options)
        return await design_async(run.config, runs, options, name)

    def _fail(self, name: str, reason: str, trace: str | None, log: LineFile) -> None:
        line = reason.strip().partition("\n")[0]
        self.failed[name] = line
        _write_log(log, {"run": name, "state": "failed", "reason": line, "traceback": trace})
        self.watcher.run_failed(name, line)


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


def _write_log(log: LineFile, item: Mapping[str, Any]) -> None:
    try:
        log.append(json.dumps(item).encode())
    except OSError as error:
        raise RunError(f"cannot write {log.path}: {error.strerror}") from None
