"""Owns a design run from configuration to result, fresh or resumed; repeating it is replay.py's."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Any

from agentflow.app.design.conduct import Plan, answer, asked, changed, conduct
from agentflow.app.design.keeping import keep_rollouts, run_document, run_name
from agentflow.app.design.models import Models, answered_by, open_models
from agentflow.app.design.prices import prices_of
from agentflow.app.design.rationales import with_rationales
from agentflow.app.design.remarks import REMARK, Remarks, Say
from agentflow.app.design.results import finished
from agentflow.app.design.watching import watched
from agentflow.config.run import DesignConfig, build
from agentflow.env.pool.pool import Simulator
from agentflow.errors import (
    ConfigError,
    EndpointError,
    InterruptedRunError,
    RunError,
)
from agentflow.llm.client import Client
from agentflow.llm.wrappers.budget import Budget
from agentflow.llm.wrappers.limits import Limiter
from agentflow.llm.wrappers.tape import Tape
from agentflow.runs import Event, Listener, RunDirectory, read_document, state_of


def design(
    config: DesignConfig,
    out: Path,
    say: Say,
    listener: Listener | None = None,
    client: Client | None = None,
) -> dict[str, Any]:
    """Run a workflow and keep it under `out`; see `design_async`.

    Raises:
        InterruptedRunError: Ctrl-C; the run can be resumed.
    """
    return _to_end(_Work.begin(config, out, say, listener, client))


async def design_async(
    config: DesignConfig,
    out: Path,
    say: Say,
    listener: Listener | None = None,
    client: Client | None = None,
    pool: Simulator | None = None,
    limiters: dict[str, Limiter] | None = None,
    name: str = "",
) -> dict[str, Any]:
    """Run a workflow and keep it under `out`.

    Args:
        config: What to do.
        out: Folder that holds run directories; made if missing.
        say: Takes remarks for the user, one line each.
        listener: Told every event.
        client: Answers for all roles, instead of the configured models.
        pool: Where machines are simulated; its own by default, of `config.workers` processes.
        limiters: Of endpoints, by base URL, shared with other runs.
        name: Of the run directory; by default date, task, workflow and seed.

    Returns:
        The content of result.json.

    Raises:
        UsageError: A name or value is wrong, or the folder cannot be written.
        EndpointError: The model cannot be used; a run without any answer leaves nothing behind.
    """
    work = _Work.begin(config, out, say, listener, client, pool, limiters, name)
    return await work.carry_out()


def resume(
    path: Path, say: Say, listener: Listener | None = None, client: Client | None = None
) -> dict[str, Any]:
    """Continue a run; see `resume_async`.

    Raises:
        InterruptedRunError: Ctrl-C; the run can be resumed again.
    """
    if state_of(path) == "done":
        return _result(path)
    return _to_end(_Work.go_on(path, say, listener, client))


async def resume_async(
    path: Path,
    say: Say,
    listener: Listener | None = None,
    client: Client | None = None,
    pool: Simulator | None = None,
    limiters: dict[str, Limiter] | None = None,
) -> dict[str, Any]:
    """Continue a run; recorded calls are not asked again. A finished run gives its result.

    Raises:
        RunError: The run is damaged or in use, or prompts, the task's demands or physics have
            changed since.
        EndpointError: The model cannot be used.
    """
    if state_of(path) == "done":
        return _result(path)
    return await _Work.go_on(path, say, listener, client, pool, limiters).carry_out()


def _result(path: Path) -> dict[str, Any]:
    read_document(path)  # refuses what another version wrote, and what was edited
    return {**finished(path), "run": str(path)}


@dataclass(frozen=True)
class _Work:
    """A run that is ready to be carried out."""

    plan: Plan
    run: RunDirectory
    say: Say
    client: Client | None
    pool: Simulator | None
    limiters: dict[str, Limiter]

    @classmethod
    def begin(
        cls,
        config: DesignConfig,
        out: Path,
        say: Say,
        listener: Listener | None,
        client: Client | None,
        pool: Simulator | None = None,
        limiters: dict[str, Limiter] | None = None,
        name: str = "",
    ) -> _Work:
        plan = Plan.of(with_rationales(config))
        run = RunDirectory.create(out, name or run_name(plan), run_document(plan))
        return cls._heard(cls(plan, run, say, client, pool, limiters or {}), listener)

    @classmethod
    def go_on(
        cls,
        path: Path,
        say: Say,
        listener: Listener | None,
        client: Client | None,
        pool: Simulator | None = None,
        limiters: dict[str, Limiter] | None = None,
    ) -> _Work:
        document = read_document(path)
        plan = Plan.of(build(document.get("config")))
        if other := changed(plan, document):
            raise RunError(
                f"{path} was begun with other {other}: its record and a continuation would not "
                "belong together; continue it with the version that began it"
            )
        run = RunDirectory.resume(path)
        return cls._heard(cls(plan, run, say, client, pool, limiters or {}), listener)

    def _heard(self, listener: Listener | None) -> _Work:
        if listener is not None:
            self.run.listeners.append(
                lambda event: None if event.kind == REMARK else listener(event)
            )
        return self

    @property
    def how_to_go_on(self) -> str:
        return f"continue with: agentflow design --resume {quote(str(self.run.path))}"

    def _goes_on(self, tape: Tape) -> bool:
        """Whether there is a run to go on with: an answer, or whatever an earlier process left."""
        return self.run.resumed or bool(len(tape))

    async def carry_out(self) -> dict[str, Any]:
        """Do what is left to do, and close the run."""
        remarks, budget = Remarks(self.run, self.say), Budget(self.plan.config.model.budget)
        try:
            with Tape(self.run.tape, remarks.tell) as tape:
                _count(tape, budget, self.plan)
                try:
                    return await self._carry_out(tape, budget, remarks)
                except EndpointError as error:
                    if self._goes_on(tape):
                        remarks.keep(str(error))
                        raise type(error)(f"{error}; {self.how_to_go_on}") from error
                    self.run.discard()
                    raise
                except ConfigError:  # a key that is missing, for instance
                    if not self._goes_on(tape):
                        self.run.discard()
                    raise
                except RunError as error:
                    raise RunError(f"{error}; {self.how_to_go_on}") from error
        finally:
            self.run.close()

    async def _carry_out(self, tape: Tape, budget: Budget, remarks: Remarks) -> dict[str, Any]:
        plan = self.plan
        models = watched(self._models(tape, budget, remarks), budget, self._tell)
        conducted = await conduct(plan, models, self.run, self.pool)
        remarks.tell_differences()
        keep_rollouts(self.run.path, plan.config, conducted)
        result = {
            **answer(plan, conducted),
            "model": asked(plan.config, models),
            "calls": budget.calls,
            "tokens": budget.usage.total,
            "cost": None if budget.cost is None else round(budget.cost, 6),
            "seconds": round(self.run.seconds, 2),
            "simulated_seconds": round(conducted.laboratory.simulated_seconds, 3),
            "worker_seconds": round(conducted.laboratory.worker_seconds, 3),
            "run": str(self.run.path),
        }
        self.run.finish(result)
        return result

    def _tell(self, event: Event) -> None:
        for listener in self.run.listeners:
            listener(event)

    def _models(self, tape: Tape, budget: Budget, remarks: Remarks) -> Models:
        if self.client is not None:
            return answered_by(self.client, self.plan.config, tape, budget)
        return open_models(self.plan.config, tape, budget, remarks.tell, self.limiters)


def _to_end(work: _Work) -> dict[str, Any]:
    try:
        return asyncio.run(work.carry_out())
    except KeyboardInterrupt:
        work.run.close()
        raise InterruptedRunError(f"interrupted; {work.how_to_go_on}") from None


def _count(tape: Tape, budget: Budget, plan: Plan) -> None:
    """Charge what an earlier process has spent."""
    prices = prices_of(plan.config.model)
    for entry in tape.calls():
        budget.count(entry.request, entry.reply, prices.get(entry.model))
