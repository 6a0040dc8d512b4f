"""Owns carrying out a sweep: several runs at once on one pool, none twice, no failure shared."""

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

from agentflow.app.design.run import RunOptions, design_async, resume_async
from agentflow.app.sweeps.folder import LOG, RUNS, STORE, document_of, held
from agentflow.app.sweeps.plan import SweepPlan
from agentflow.config.run import build
from agentflow.config.sweep import Member
from agentflow.env.pool.pool import RolloutPool, Simulator
from agentflow.env.pool.store import Store
from agentflow.errors import AgentflowError, EndpointError, InterruptedRunError, RunError
from agentflow.files import LineFile
from agentflow.llm.wrappers.limits import Limiter
from agentflow.runs import Event, read_document
from agentflow.search.concurrency import run_concurrently


class Watcher(Protocol):
    """Told what becomes of the runs of a sweep."""

    def begun(self, run: str) -> None:
        """A run has begun or goes on."""

    def event(self, run: str, event: Event) -> None:
        """Something happened in a run."""

    def remark(self, run: str, line: str) -> None:
        """A run has something to say to the user."""

    def ended(self, run: str, result: Mapping[str, Any]) -> None:
        """A run is done; the content of its result.json."""

    def failed(self, run: str, reason: str) -> None:
        """A run has failed."""


@dataclass(frozen=True)
class Outcome:
    """What became of a sweep's runs, by name."""

    path: Path
    done: tuple[str, ...]
    """Those of earlier processes included."""
    failed: Mapping[str, str]
    """With the reason, in one line."""
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
) -> Outcome:
    """Carry out what is not yet done of a sweep.

    Args:
        plan: The sweep.
        folder: Its own.
        watcher: Told everything.
        jobs: Runs at once.
        resume: Whether it may have been begun before.
        pool: Where machines are simulated, for all runs; by default `workers` processes, as the
            base configuration says.

    Raises:
        RunError: The folder cannot be used.
        InterruptedRunError: Ctrl-C; everything can be resumed.
    """
    with held(folder, document_of(plan.name, plan.sweep), resume):
        work = _Work(plan, folder, watcher)
        try:
            asyncio.run(work.carry_out(jobs, pool))
        except KeyboardInterrupt:
            raise InterruptedRunError(
                f"interrupted; {len(work.done)} of {len(plan.members)} runs are done; continue "
                f"with: agentflow sweep {quote(str(folder))} --resume"
            ) from None
    order = [member.name for member in plan.members]
    return Outcome(
        folder,
        tuple(name for name in order if name in work.done),
        {name: work.failed[name] for name in order if name in work.failed},
        work.failed.keys() == work.endpoint and bool(work.endpoint),
    )


@dataclass
class _Work:
    """A sweep under way."""

    plan: SweepPlan
    folder: Path
    watcher: Watcher
    done: set[str] = field(default_factory=set)
    failed: dict[str, str] = field(default_factory=dict)
    endpoint: set[str] = field(default_factory=set)
    """Failed because the endpoint could not be used."""
    limiters: dict[str, Limiter] = field(default_factory=dict)

    async def carry_out(self, jobs: int, pool: Simulator | None) -> None:
        waiting = [member for member in self.plan.members if not self._is_done(member)]
        if not waiting:
            return
        self._demand_same_conditions()
        log = LineFile(self.folder / LOG)
        try:
            async with AsyncExitStack() as stack:
                if pool is None:
                    workers = build(self.plan.sweep.base).workers
                    pool = await stack.enter_async_context(RolloutPool(workers))
                store = Store(self.folder / STORE, pool)
                queue = iter(waiting)
                await run_concurrently(self._some(queue, store, log) for _ in range(jobs))
        finally:
            log.close()

    def _is_done(self, member: Member) -> bool:
        if (self.folder / RUNS / member.name / "result.json").exists():
            self.done.add(member.name)
        return member.name in self.done

    def _demand_same_conditions(self) -> None:
        """Refuse to add runs to some that are done and that were made otherwise."""
        for member in self.plan.members:
            if member.name in self.done:
                document = read_document(self.folder / RUNS / member.name)
                if changes := self.plan.plan_of(member).changes_since(document):
                    raise RunError(
                        f"{self.folder}: {member.name} was made with different {changes}: the "
                        "remaining runs would not be comparable; choose another folder with --out"
                    )

    async def _some(self, queue: Iterator[Member], store: Store, log: LineFile) -> None:
        """Carry out runs one after the other, as long as any are left."""
        for member in queue:
            name = member.name
            self.watcher.begun(name)
            try:
                result = await self._run(member, store)
            except AgentflowError as error:
                if isinstance(error, EndpointError):
                    self.endpoint.add(name)
                self._fail(name, str(error), None, log)
            except Exception as error:  # noqa: BLE001 - logged whole; the other runs are unharmed
                reason = f"{type(error).__name__}: {error}"
                self._fail(name, reason, traceback.format_exc(), log)
            else:
                plan = self.plan.plan_of(member)
                store.share(self.folder / RUNS / name, plan.task, member.config.seed)
                self.done.add(name)
                _note(log, {"run": name, "state": "done", "seconds": result["seconds"]})
                self.watcher.ended(name, result)

    async def _run(self, member: Member, store: Store) -> dict[str, Any]:
        runs, name = self.folder / RUNS, member.name
        path = runs / name
        options = RunOptions(
            notify=lambda line: self.watcher.remark(name, line),
            listener=lambda event: self.watcher.event(name, event),
            pool=store,
            limiters=self.limiters,
        )
        if _begun(path):
            return await resume_async(path, options)
        return await design_async(member.config, runs, options, name)

    def _fail(self, name: str, reason: str, trace: str | None, log: LineFile) -> None:
        line = reason.strip().partition("\n")[0]
        self.failed[name] = line
        _note(log, {"run": name, "state": "failed", "reason": line, "traceback": trace})
        self.watcher.failed(name, line)


def _begun(path: Path) -> bool:
    """Whether a run can be resumed; clears away what is less than a run."""
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


def _note(log: LineFile, item: Mapping[str, Any]) -> None:
    try:
        log.append(json.dumps(item).encode())
    except OSError as error:
        raise RunError(f"cannot write {log.path}: {error.strerror}") from None
