"""Owns what all stages of one run share: asking roles, simulating, noting it all, counting.

The only place where a spent budget is noticed; what to do in which order is the workflows'.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from agentflow.agents.base import Role, RoleAttempt, RoleOutcome, ask
from agentflow.agents.refiner import Refinement
from agentflow.errors import BudgetSpentError
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.search.concurrency import EvaluateOnce
from agentflow.search.node import Evaluation
from agentflow.workflows.base import (
    AskContexts,
    Candidate,
    Laboratory,
    Record,
    SimulationSummary,
    Stage,
    StageName,
    WorkflowResult,
)
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.statistics import best_of, row

In = TypeVar("In")
Out = TypeVar("Out")


@dataclass
class _Count:
    """What a stage has cost."""

    calls: int = 0
    tokens: int = 0
    tried: set[Machine] = field(default_factory=set)


class WorkflowContext:
    """One run of a workflow. Identical machines are simulated once, whoever asks."""

    def __init__(
        self,
        workflow: str,
        brief: Brief,
        contexts: AskContexts,
        laboratory: Laboratory,
        settings: WorkflowSettings,
        record: Record,
        seed: int,
    ) -> None:
        """Everything as for a `Workflow`, and its name."""
        self.brief, self.settings, self.record = brief, settings, record
        self.spent: BudgetSpentError | None = None
        """Set once the budget has run out; no more questions are worth asking then."""
        self._workflow, self._contexts, self._laboratory, self._seed = (
            workflow,
            contexts,
            laboratory,
            seed,
        )
        self._simulate: EvaluateOnce[Machine] = EvaluateOnce(self._try)
        self._stages: list[Stage] = []
        self._counts: dict[str, _Count] = {}
        """By stage name; trajectories may be in different stages at a time."""

    def stream(self, name: str) -> random.Random:
        """A random stream of its own for one purpose, derived from the run's seed by name."""
        return random.Random(f"{self._seed}/{name}")

    async def ask(
        self,
        role: Role[In, Out],
        given: In,
        label: str,
        *,
        stage: StageName,
        model_role: str = "",
        once: bool = False,
    ) -> RoleOutcome[Out] | None:
        """Ask a role, with its retries or `once`; None when the budget runs out before the answer.

        Args:
            role: Who is asked.
            given: What it is told.
            label: Of the question; unique in the run.
            stage: For which it is asked, and counted.
            model_role: Role whose model and sampling to use, if not its own.
            once: Whether one attempt is all; for searches, which own the attempts.
        """
        own = self._contexts(model_role or role.model_role or role.name)
        count = self._counts[stage]
        used = replace(own, on_attempt=lambda made: self._note(made, count, own.on_attempt))
        try:
            return await ask(role, given, replace(used, max_retry=1) if once else used, label)
        except BudgetSpentError as spent:
            self.spent = spent
            return None

    async def evaluate(self, machine: Machine, stage: StageName, place: str) -> Evaluation:
        """Simulate a machine, or remember what came of it, and note it as `stage/place`."""
        label = f"{stage}/{place}"
        self._counts[stage].tried.add(machine)
        evaluation = await self._simulate(machine, f"machine-{machine.digest}")
        summary: SimulationSummary = evaluation.details
        self.record.event(
            "evaluation",
            label,
            machine=machine.digest,
            valid=evaluation.valid,
            score=evaluation.score,
            status=summary.status,
            broken=[list(item) for item in summary.broken],
            rollout=summary.digest,
            moved=summary.moved,
        )
        return evaluation

    async def query(self, machine: Machine, queries: Sequence[object], label: str) -> str:
        """Answer queries on an evaluated machine and note them under the label."""
        answer = await self._laboratory.query(machine, queries)
        self.record.event(
            "query", label, machine=machine.digest, queries=list(queries), answer=answer
        )
        return answer

    @property
    def rollouts(self) -> int:
        """Machines simulated so far, each once."""
        return self._simulate.count

    async def views(self, machine: Machine) -> tuple[str, ...]:
        """Pictures of a machine for a refiner; none when vision is switched off."""
        return await self._laboratory.views(machine) if self.settings.vision else ()

    def begin_stage(self, name: StageName) -> None:
        """Open a stage; opening it again, for another trajectory, changes nothing."""
        if name not in self._counts:
            self._counts[name] = _Count()
            self.record.event("stage_begin", name, trajectories=self.settings.trajectories)

    def end_stage(self, name: StageName, candidates: Sequence[Candidate]) -> Stage:
        """Close a stage, earlier ones first; trajectories without a candidate are invalid."""
        count = self._counts[name]
        earlier = (self._counts[stage.name].tried for stage in self._stages)
        found = {candidate.trajectory: candidate for candidate in candidates}
        every = range(1, self.settings.trajectories + 1)
        stage = Stage(
            name,
            tuple(found.get(t) or Candidate(t, reason="ended in an earlier stage") for t in every),
            count.calls,
            count.tokens,
            len(count.tried.difference(*earlier)),
        )
        for candidate in stage.candidates:
            self.record.event(
                "candidate", f"{stage.name}/traj-{candidate.trajectory}", **outline(candidate)
            )
        self.record.event("stage", stage.name, **row(stage))
        self._stages.append(stage)
        return stage

    def has_ended(self, name: StageName) -> bool:
        """Whether a stage is closed."""
        return any(stage.name == name for stage in self._stages)

    def is_over(self, stage: Stage) -> bool:
        """Whether the run ends with this stage: nothing to go on with, or nothing to pay with."""
        return self.spent is not None or not stage.survivors

    def result(self) -> WorkflowResult:
        """Close the run: the best valid machine of all stages."""
        stages = tuple(self._stages)
        found = best_of(stages)
        best, stage = found if found else (None, None)
        reason = "" if best else _why_none(stages)
        result = WorkflowResult(
            workflow=self._workflow,
            best=best,
            best_stage=stage.name if stage else None,
            stages=stages,
            stopped="budget" if self.spent else None,
            reason=reason,
        )
        self.record.event(
            "result",
            self._workflow,
            **(outline(best) if best else {"reason": reason}),
            stage=result.best_stage,
            stopped=result.stopped,
        )
        return result

    async def _try(self, machine: Machine, label: str) -> Evaluation:
        self.record.save_machine(machine.digest, machine.to_text())
        return await self._laboratory.evaluate(machine, label)

    def _note(
        self, attempt: RoleAttempt[Any], count: _Count, then: Callable[[RoleAttempt[object]], None]
    ) -> None:
        count.calls += 1
        count.tokens += attempt.reply.usage.total
        parsed = attempt.parsed
        data: dict[str, Any] = {
            "role": attempt.role,
            "valid": parsed.output is not None,
            "parsed": parsed.parsed,
            "spatial": parsed.spatial,
            "repaired": parsed.repaired,
            "code": parsed.code,
            "problem": parsed.problem,
            "tokens": attempt.reply.usage.total,
        }
        machine = getattr(parsed.output, "machine", None)
        if isinstance(machine, Machine):
            self.record.save_machine(machine.digest, machine.to_text())
            data["machine"] = machine.digest
        if isinstance(parsed.output, Refinement):
            data["script"] = parsed.output.script
        self.record.event("attempt", attempt.label, **data)
        then(attempt)


def outline(candidate: Candidate) -> dict[str, Any]:
    """A candidate as the record and the result hold it."""
    return {
        "trajectory": candidate.trajectory,
        "machine": candidate.machine.digest if candidate.machine else None,
        "valid": candidate.valid,
        "score": candidate.score,
        "first": {
            "parsed": candidate.first.parsed,
            "spatial": candidate.first.spatial,
            "valid": candidate.first.valid,
        },
        "reason": candidate.reason,
    }


def _why_none(stages: Sequence[Stage]) -> str:
    if any(stage.survivors for stage in stages):
        return "valid machines, but none could be scored: every simulation failed"
    reasons = [c.reason for stage in stages for c in stage.candidates if c.reason]
    return f"no valid machine: {reasons[0]}"
