"""Owns carrying out a sweep: several runs at once on one pool, none twice, no failure shared."""

from __future__ import annotations

import asyncio
import json
import os
import traceback
from collections.abc import Iterable, Mapping
from contextlib import AsyncExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from agentflow.app.runs.conduct import Plan
from agentflow.app.runs.design import design_async, resume_async
from agentflow.app.runs.models import with_credentials, with_environment
from agentflow.app.sweeps.folder import (
    LOG,
    RUNS,
    STORE,
    document_of,
    folder_name,
    held,
    is_sweep,
    read_folder,
)
from agentflow.config import build, load, override, put
from agentflow.env.pool import RolloutPool
from agentflow.errors import (
    AgentflowError,
    ConfigError,
    EndpointError,
    InterruptedRunError,
    UsageError,
)
from agentflow.laboratory import Simulator
from agentflow.llm.limits import Limiter
from agentflow.metrics.cells import check_metrics
from agentflow.metrics.published import check_source
from agentflow.runs import Event
from agentflow.runs.lines import LineFile
from agentflow.search.concurrency import together
from agentflow.store import Store
from agentflow.sweeps import Member, SweepConfig, members, read_sweep, varied

LEFTOVERS = {"run.yaml.part"}
"""What a process that was killed while it began a run may have left of it."""


@dataclass(frozen=True)
class SweepPlan:
    """A sweep whose every name has been looked up."""

    name: str
    sweep: SweepConfig
    members: tuple[Member, ...]
    plans: Mapping[str, Plan]
    """Run's name -> its plan."""

    @classmethod
    def of(cls, name: str, sweep: SweepConfig) -> SweepPlan:
        """Look up tasks, workflows, prompts, metrics and published tables.

        Raises:
            UnknownNameError: One of them does not exist.
            ConfigError: A configuration is wrong, or an axis holds credentials.
        """
        check_metrics(sweep.table.metrics)
        for metrics in sweep.table.task_metrics.values():
            check_metrics(metrics)
        for source in sweep.table.published:
            check_source(source.table)
        found = members(sweep)
        _demand_no_credentials(sweep, found)
        return cls(name, sweep, found, {member.name: Plan.of(member.config) for member in found})


def _demand_no_credentials(sweep: SweepConfig, found: Iterable[Member]) -> None:
    """What axes hold is written down, and names runs; what the base holds is not."""
    known = with_credentials(build(sweep.base))
    for member in found:
        if with_credentials(member.config) - known:
            raise ConfigError(
                "an axis has a base URL with a user or a query, which would be written down; "
                "name the environment variable of the key in model.key_variable instead"
            )


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


def plan_sweep(
    path: Path, settings: Iterable[str], options: Mapping[str, Any], seeds: int | None = None
) -> SweepPlan:
    """Read a sweep, lay settings over its base and look everything up.

    Args:
        path: The YAML file, or the folder of a sweep that was begun.
        settings: `a.b=value` each, of all runs.
        options: Dotted configuration keys of all runs; None means not given.
        seeds: How many seeds, from 0, instead of the file's.

    Raises:
        ConfigError: A key is unknown, or set although an axis varies it.
        UnknownNameError: A task, workflow, metric or the like does not exist.
    """
    given = {key: value for key, value in options.items() if value is not None}
    if is_sweep(path):
        if list(settings) or given or seeds is not None:
            raise UsageError(
                f"{path} is continued as it was begun; leave out --model, --base-url, --set "
                "and --seeds"
            )
        document, sweep = read_folder(path)
        return SweepPlan.of(document["name"], sweep)
    sweep = read_sweep(load(path), str(path))
    axes = varied(sweep)
    for key in [*(setting.partition("=")[0].strip() for setting in settings), *given]:
        if key.removeprefix("settings.") in {name.removeprefix("settings.") for name in axes}:
            raise ConfigError(
                f"{key} is what the sweep varies ({axes.get(key, 'axes')}): it cannot be set "
                "for all runs; --seeds N sets the seeds"
            )
    base = override(sweep.base, settings)
    for key, value in given.items():
        base = put(base, key, value)
    changed: dict[str, Any] = {"base": with_environment(base, os.environ)}
    if seeds is not None:
        changed["seeds"] = tuple(range(seeds))
    return SweepPlan.of(path.stem, sweep.model_copy(update=changed))


def folder_of(plan: SweepPlan, path: Path, out: Path) -> Path:
    """Where a sweep lies: at `path` if that is its folder, else under `out`."""
    return path if is_sweep(path) else out / folder_name(plan.name, plan.sweep)


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
                f"with: agentflow sweep {folder} --resume"
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
        log = LineFile(self.folder / LOG)
        try:
            async with AsyncExitStack() as stack:
                if pool is None:
                    workers = build(self.plan.sweep.base).workers
                    pool = await stack.enter_async_context(RolloutPool(workers))
                store = Store(self.folder / STORE, pool)
                free = asyncio.Semaphore(jobs)
                await together(self._one(member, store, free, log) for member in waiting)
        finally:
            log.close()

    def _is_done(self, member: Member) -> bool:
        if (self.folder / RUNS / member.name / "result.json").exists():
            self.done.add(member.name)
        return member.name in self.done

    async def _one(
        self, member: Member, store: Store, free: asyncio.Semaphore, log: LineFile
    ) -> None:
        async with free:
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
                plan = self.plan.plans[name]
                store.share(self.folder / RUNS / name, plan.task, member.config.seed)
                self.done.add(name)
                _note(log, {"run": name, "state": "done", "seconds": result["seconds"]})
                self.watcher.ended(name, result)

    async def _run(self, member: Member, store: Store) -> dict[str, Any]:
        runs, name = self.folder / RUNS, member.name
        path = runs / name
        listener = lambda event: self.watcher.event(name, event)  # noqa: E731
        say = lambda line: self.watcher.remark(name, line)  # noqa: E731
        if _begun(path):
            return await resume_async(path, say, listener, None, store, self.limiters)
        return await design_async(
            member.config, runs, say, listener, None, store, self.limiters, name
        )

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
    if {entry.name for entry in path.iterdir()} <= LEFTOVERS:
        for entry in path.iterdir():
            entry.unlink()
        path.rmdir()
        return False
    return True


def _note(log: LineFile, item: Mapping[str, Any]) -> None:
    log.append(json.dumps(item).encode())
