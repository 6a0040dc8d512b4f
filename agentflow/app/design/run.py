"""Carries out design runs, new or resumed, from configuration to result; with rationales of an
earlier run, if wanted."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from shlex import quote
from typing import Any

from agentflow.agents.designer import Designer, extract_rationale
from agentflow.app.design.execution import execute, finding_of, save_rollouts
from agentflow.app.design.notices import REMARK, Remarks, tell_unusable, watch_calls
from agentflow.app.design.plan import AUTHOR, RunPlan, repetition
from agentflow.app.design.trust import Approve, refuse, require_trusted_run, trust_option
from agentflow.app.lessons import extend_book, with_lessons
from agentflow.config.run import DesignConfig
from agentflow.env.pool.pool import OpenPool, RolloutPool, Simulator
from agentflow.errors import ConfigError, DamagedError, EndpointError, InterruptedRunError, RunError
from agentflow.llm.function import FunctionClient
from agentflow.llm.messages import Client
from agentflow.llm.wrappers.limits import Limiters, LocalLimiters
from agentflow.llm.wrappers.record import CallLog
from agentflow.metrics.tables import counted
from agentflow.models.choices import open_models
from agentflow.runs import (
    Listener,
    Notify,
    RunDirectory,
    RunResult,
    read_document,
    read_result,
    state_of,
)
from agentflow.runs.events import AttemptEvent, read_typed_events
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.workflow import Workflow


def with_rationales(config: DesignConfig) -> DesignConfig:
    """The configuration with the rationales of the run in `rationale_from` stored in it."""
    if config.rationale_from is None or config.settings.rationales:
        return config
    plans = rationales_of(Path(config.rationale_from))
    settings = config.settings.model_copy(update={"rationales": plans})
    return config.model_copy(update={"settings": settings})


def rationales_of(path: Path) -> tuple[str, ...]:
    """Rationales of a run's accepted designs, one text per trajectory that has one.

    Each text covers the trajectory's structures in build order.

    Raises:
        RunError: The run cannot be read, or no design of it was accepted.
    """
    read_document(path)
    accepted = {
        event.label: event.location
        for event in read_typed_events(path)
        if isinstance(event, AttemptEvent) and event.role == Designer.name and event.valid
    }
    plans: dict[int, dict[int, str]] = {}
    with CallLog(path / "calls.jsonl", lambda _line: None, writable=False) as call_log:
        for entry in call_log.calls():
            location = accepted.get(entry.request.label)
            if location is not None and location.trajectory:
                text = extract_rationale(entry.reply.text)
                plans.setdefault(location.trajectory, {}).setdefault(location.structure, text)
    texts = tuple("\n".join(plan[n] for n in sorted(plan)) for _, plan in sorted(plans.items()))
    if not any(texts):
        raise RunError(f"{path} contains no rationale: none of its designs was accepted")
    return tuple(filter(None, texts))


ANSWER = "answer"
"""Key of run.yaml: the name of the Python function that answers instead of a model."""
STORE = "unfinished"
"""Folder of all rollouts of an unfinished run, if its workflow stores them."""
LESSONS = "lessons"
"""Key of run.yaml: the book of lessons; what the run has read of it is in the configuration."""


@dataclass(frozen=True)
class RunOptions:
    """How to carry out a run. Only `client` and `workflow` can change the result."""

    notify: Notify = lambda _line: None
    listener: Listener | None = None
    client: Client | None = None
    """Answers for all roles instead of the configured models."""
    pool: Simulator | None = None
    """Simulates machines; by default a new pool of `config.workers` processes."""
    limiters: Limiters = field(default_factory=LocalLimiters)
    """Keep the rate limits of endpoints, for all runs that share them."""
    approve: Approve = refuse
    """Is asked about hosts, key variables and programs that only a resumed run's record names."""
    named: Mapping[str, Any] = field(default_factory=dict)
    """Configuration keys that the user gave; the hosts and key variables in them are allowed."""
    workflow: Workflow | None = None
    """Runs in place of the configured one of the same name, such as with another worker."""
    open_pool: OpenPool = RolloutPool
    lessons: Path | None = None
    """A book of lessons, which a new run reads as it begins and extends as it ends."""
    again: str = ""
    """How to go on after an error; "" for the command that resumes the run."""


def design(
    config: DesignConfig, out: Path, options: RunOptions | None = None, name: str = ""
) -> RunResult:
    """Like `design_async`, on a new event loop.

    Raises:
        InterruptedRunError: Ctrl-C; the run can be resumed.
    """
    return DesignRun.create(config, out, options or RunOptions(), name).carry_out_blocking()


async def design_async(
    config: DesignConfig, out: Path, options: RunOptions | None = None, name: str = ""
) -> RunResult:
    """Run a workflow in a new run directory.

    Args:
        config: What to do.
        out: Parent folder of the run directory; created if missing.
        options: How to do it.
        name: Name of the run directory; by default date, task, workflow and seed.

    Raises:
        UsageError: A name or value is wrong, or the folder cannot be written.
        EndpointError: The model cannot be used; without any reply, nothing is left behind.
    """
    return await DesignRun.create(config, out, options or RunOptions(), name).carry_out()


def resume(path: Path, options: RunOptions | None = None) -> RunResult:
    """Like `resume_async`, on a new event loop.

    Raises:
        InterruptedRunError: Ctrl-C; the run can be resumed again.
    """
    if state_of(path) == "done":
        return _finished_result(path)
    return DesignRun.reopen(path, options or RunOptions()).carry_out_blocking()


async def resume_async(path: Path, options: RunOptions | None = None) -> RunResult:
    """Continue a run without repeating recorded calls. A finished run returns its result.

    Raises:
        RunError: The run is damaged or in use, or prompts, task, constants or engine have changed.
        EndpointError: The model cannot be used.
    """
    if state_of(path) == "done":
        return _finished_result(path)
    return await DesignRun.reopen(path, options or RunOptions()).carry_out()


def _finished_result(path: Path) -> RunResult:
    read_document(path)  # refuses edited runs and other schemas
    return read_result(path).model_copy(update={"run": str(path)})


@contextmanager
def _damage_told() -> Iterator[None]:
    """Add what to do to the error of a record that cannot be continued."""
    try:
        yield
    except DamagedError as error:
        raise DamagedError(f"{error}; restore it from a copy, or begin a new run") from error


@dataclass(frozen=True)
class DesignRun:
    """An open run directory, and everything needed to carry the run out."""

    plan: RunPlan
    directory: RunDirectory
    options: RunOptions

    @classmethod
    def create(cls, config: DesignConfig, out: Path, options: RunOptions, name: str) -> DesignRun:
        """Start a new run; see `design_async`."""
        plan, book = RunPlan.of(with_rationales(config)), options.lessons
        if book is not None:
            plan = replace(plan, config=with_lessons(plan.config, book, plan.task.name))
        plan.require_workflow()
        client = options.client
        if client is None:
            plan.require_sight()
        document = plan.run_document | ({} if client is None else {ANSWER: client.name})
        document |= {} if book is None else {LESSONS: str(book)}
        workflow = options.workflow or WORKFLOWS[config.workflow]
        if not workflow.repeatable:
            document[AUTHOR] = workflow.author(config.settings)
        directory = RunDirectory.create(out, name or plan.run_name, document)
        if plan.sketch:
            plan.sketch.write(directory.path)
        if unused := workflow.unused(config.settings):
            verb = "changes" if len(unused) == 1 else "change"
            which = f"{' and '.join(unused)} {verb} nothing in the workflow {config.workflow}"
            options.notify(f"{which}, as configured")
        if plan.model_note and options.client is None and workflow.asks_models:
            options.notify(plan.model_note)
        return cls(plan, directory, options)

    @classmethod
    @_damage_told()
    def reopen(cls, path: Path, options: RunOptions) -> DesignRun:
        """Open an unfinished run; see `resume_async`."""
        document = read_document(path)
        if options.client is None and ANSWER in document:
            raise RunError(
                f"{path} was started with the Python function {document[ANSWER]!r}, which answers "
                f"instead of a model; continue it in Python: {_resume_call(path)}"
            )
        if options.client is None:
            require_trusted_run(path, options.approve, options.named)
        plan = RunPlan.of_run(path, document)
        if changes := plan.changes_since(document):
            raise RunError(
                f"{path} was started with different {changes}, so its recording cannot be "
                "continued; resume it with the version that started it"
            )
        plan.require_workflow()
        for note in plan.notes_on(path, document):
            options.notify(note)
        if options.workflow is None and (again := repetition(path, document)):
            options = replace(options, workflow=again)
            options.notify(f"{document[AUTHOR]} cannot be asked again; what it did counts")
        return cls(plan, RunDirectory.resume(path), options)

    def __post_init__(self) -> None:
        listener = self.options.listener
        if listener is not None:
            self.directory.listeners.append(
                lambda event: None if event.kind == REMARK else listener(event)
            )

    def carry_out_blocking(self) -> RunResult:
        """Finish the run on a new event loop."""
        try:
            return asyncio.run(self.carry_out())
        except KeyboardInterrupt:
            self.directory.close()
            raise InterruptedRunError(f"interrupted; {self._resume_hint}") from None

    async def carry_out(self) -> RunResult:
        """Finish the run and close it."""
        remarks = Remarks(self.directory, self.options.notify)
        try:
            with _damage_told(), CallLog(self.directory.call_log, remarks.tell) as call_log:
                try:
                    return await self._finish(call_log, remarks)
                except (EndpointError, ConfigError) as error:
                    # there is nothing to resume without a reply or the work of an earlier process
                    resumable = self.directory.resumed or bool(len(call_log))
                    if not resumable:
                        self.directory.discard()
                    if not resumable or not isinstance(error, EndpointError):
                        raise
                    remarks.record(str(error))
                    raise type(error)(f"{error}; {self._resume_hint}") from error
        except DamagedError:
            raise
        except RunError as error:
            raise RunError(f"{error}; {self._resume_hint}") from error
        finally:
            self.directory.close()

    async def _finish(self, call_log: CallLog, remarks: Remarks) -> RunResult:
        plan, directory, options = self.plan, self.directory, self.options
        models = watch_calls(
            open_models(plan.config, call_log, remarks.tell, self._client, options.limiters),
            directory.notify,
        )
        workflow = options.workflow or WORKFLOWS[plan.config.workflow]
        store = directory.path / STORE if workflow.stores else None
        execution = await execute(
            plan, models, directory, options.pool, workflow, options.open_pool, store=store
        )
        remarks.tell_differences()
        tell_unusable(remarks, plan.task.name, execution.evaluator.statuses)
        if (book := options.lessons) is not None:
            added = extend_book(book, plan.task.name, execution.result.lessons)
            options.notify(f"{book}: {counted(added, 'lesson')} added")
        save_rollouts(directory.path, plan.config, execution)
        result = RunResult(
            **finding_of(plan, execution).to_json(),
            model=execution.model,
            engine=plan.engine,
            **models.budget.to_json(),
            seconds=round(directory.seconds, 2),
            simulated_seconds=round(execution.evaluator.simulated_seconds, 3),
            worker_seconds=round(execution.evaluator.worker_seconds, 3),
            run=str(directory.path),
        )
        directory.finish(result)
        if store:
            shutil.rmtree(store, ignore_errors=True)
        return result

    @property
    def _client(self) -> Client | None:
        """What answers in place of the models; functions learn for which run."""
        client = self.options.client
        if isinstance(client, FunctionClient):
            return client.of_run(self.directory.path.name, self.plan.config.seed)
        return client

    @property
    def _resume_hint(self) -> str:
        if self.options.again:
            return self.options.again
        path = self.directory.path
        if self.options.client is not None:
            return f"continue in Python: {_resume_call(path)}"
        trust = trust_option([self.plan.config])
        return f"continue with: agentflow design --resume {quote(str(path))}{trust}"


def _resume_call(path: Path) -> str:
    return f"agentflow.resume({str(path)!r}, answer=...)"
