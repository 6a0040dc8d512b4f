"""Carries out sweeps: several runs at a time on one pool; the failure of one stops no other."""

import asyncio
import json
from collections.abc import Coroutine, Iterator, Mapping
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from shlex import quote
from typing import Any, Protocol, TypeVar

from agentflow.app.design.trust import trust_option
from agentflow.app.pools import Where, connect
from agentflow.app.sweeps import members
from agentflow.app.sweeps.folder import LOG, RUNS, lock_folder, sweep_document
from agentflow.app.sweeps.plan import SweepPlan
from agentflow.config.run import build_config
from agentflow.config.sweep import SweepRun
from agentflow.env.pool.pool import Simulator
from agentflow.errors import InterruptedRunError, RunError
from agentflow.files.lines import LineFile
from agentflow.runs import Event, RunResult
from agentflow.runs.events import RunEvent
from agentflow.runs.reading import RESULT
from agentflow.search.concurrency import run_concurrently

T = TypeVar("T")


class Watcher(Protocol):
    """Receives the progress of a sweep."""

    def run_started(self, run: str) -> None:
        """A run was started or resumed."""

    def event(self, run: str, event: RunEvent | Event) -> None:
        """An event of a run."""

    def remark(self, run: str, line: str) -> None:
        """A line of text from a run for the user."""

    def run_finished(self, run: str, result: RunResult) -> None:
        """A run is finished."""

    def run_failed(self, run: str, reason: str) -> None:
        """A run has failed."""


@dataclass(frozen=True)
class SweepOutcome:
    """The names of a sweep's finished and failed runs.

    `done` includes runs finished by earlier processes; `failed` maps names to reasons in one line;
    `endpoint` says whether every failure was that of the endpoint.
    """

    path: Path
    done: tuple[str, ...]
    failed: Mapping[str, str]
    endpoint: bool = False


def run_blocking(work: Coroutine[Any, Any, T], plan: SweepPlan, folder: Path, again: str = "") -> T:
    """The result of the work on a sweep, on a new event loop.

    Raises:
        InterruptedRunError: Ctrl-C; the message has `again`, which says how to continue, by default
            with the command.
    """
    try:
        return asyncio.run(work)
    except KeyboardInterrupt:
        done = f"{len(_done(plan, folder))} of {len(plan.runs)} runs are done"
        again = again or f"with: {_resume_command(plan, folder)}"
        raise InterruptedRunError(f"interrupted; {done}; continue {again}") from None


def _resume_command(plan: SweepPlan, folder: Path) -> str:
    command = f"agentflow {plan.sweep.command} {quote(str(folder))} --resume"
    return f"{command}{trust_option(plan.configs)}"


async def run_sweep_async(
    plan: SweepPlan,
    folder: Path,
    watcher: Watcher,
    *,
    jobs: int,
    resume: bool,
    pool: Simulator | None = None,
    on: Where = "local",
    shared_store: str | None = None,
    client_of: members.ClientOf = members.models_answer,
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
        on: Where the runs are carried out; on a cluster, each on one node.
        shared_store: URL of a store that sweeps share; rollouts are looked up there before they are
            simulated.
        client_of: What answers in place of the models of a run; only where `on` is "local".

    Raises:
        RunError: The folder cannot be used.
    """
    workers = build_config(plan.sweep.base).workers
    if on == "ray":
        connect(workers)
    with lock_folder(folder, sweep_document(plan.name, plan.sweep), resume):
        place = (
            members.carry_out_on_ray(folder, workers, shared_store, jobs)
            if on == "ray"
            else members.carry_out_here(folder, workers, shared_store, pool, client_of=client_of)
        )
        work = _Work(plan, folder, watcher)
        await work.carry_out(jobs, place)
    order = [run.name for run in plan.runs]
    return SweepOutcome(
        folder,
        tuple(name for name in order if name in work.done),
        {name: work.failed[name].line for name in order if name in work.failed},
        bool(work.failed) and all(failure.endpoint for failure in work.failed.values()),
    )


def _done(plan: SweepPlan, folder: Path) -> set[str]:
    """Names of the finished runs."""
    return {run.name for run in plan.runs if (folder / RUNS / run.name / RESULT).exists()}


@dataclass
class _Work:
    """A sweep in progress."""

    plan: SweepPlan
    folder: Path
    watcher: Watcher
    done: set[str] = field(default_factory=set)
    failed: dict[str, members.Failure] = field(default_factory=dict)

    async def carry_out(
        self, jobs: int, place: AbstractAsyncContextManager[members.CarryOut]
    ) -> None:
        self.done = _done(self.plan, self.folder)
        waiting = [run for run in self.plan.runs if run.name not in self.done]
        if not waiting:
            return
        for run in self.plan.runs:  # new runs must not mix with finished ones of other conditions
            if run.name in self.done:
                members.require_same_plan(self.plan.plan_of(run), self.folder / RUNS / run.name)
        log = LineFile(self.folder / LOG)
        try:
            async with place as carry:
                queue = iter(waiting)
                await run_concurrently(self._work_through(queue, carry, log) for _ in range(jobs))
        finally:
            log.close()

    async def _work_through(
        self, queue: Iterator[SweepRun], carry: members.CarryOut, log: LineFile
    ) -> None:
        """Carry out runs from a shared queue until none are left."""
        for run in queue:
            name = run.name
            self.watcher.run_started(name)
            outcome = await carry(run, partial(self._tell, name))
            if isinstance(outcome, members.Failure):
                self.failed[name] = outcome
                row = {"reason": outcome.line, "traceback": outcome.trace}
                self._write(log, {"run": name, "state": "failed", **row})
                self.watcher.run_failed(name, outcome.line)
            else:
                self.done.add(name)
                self._write(log, {"run": name, "state": "done", "seconds": outcome.seconds})
                self.watcher.run_finished(name, outcome)

    def _tell(self, name: str, told: RunEvent | Event | str) -> None:
        if isinstance(told, str):
            self.watcher.remark(name, told)
        else:
            self.watcher.event(name, told)

    def _write(self, log: LineFile, item: Mapping[str, Any]) -> None:
        try:
            log.append(json.dumps(item).encode())
        except RunError as error:
            again = _resume_command(self.plan, self.folder)
            raise RunError(f"{error}; continue with: {again}") from error
