"""Owns the stages that workflows share: whole-machine designs, criticism, blind refinement.

Building by structure is hierarchical.py's; the feedback loop is feedback.py's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from agentflow.agents.base import RoleOutcome
from agentflow.agents.designer import Designer, DesignerInput
from agentflow.agents.history import EditRecord
from agentflow.agents.inspector import Inspector, InspectorInput
from agentflow.agents.meta_designer import Blueprint
from agentflow.agents.refiner import Refinement, Refiner, RefinerInput
from agentflow.machine.validity import check
from agentflow.search.concurrency import run_concurrently
from agentflow.workflows.base import Candidate, FirstAttempt, StageName
from agentflow.workflows.context import WorkflowContext

INITIAL: StageName = "initial"
BLIND: StageName = "blind_refinement"
UNANSWERED = "the budget ran out before an answer"


def first_attempt_of(outcome: RoleOutcome[Any] | None) -> FirstAttempt:
    """What the first attempt of a question came to."""
    if outcome is None or not outcome.attempts:
        return FirstAttempt()
    parsed = outcome.attempts[0].parsed
    return FirstAttempt(parsed.parsed, parsed.spatial is True, parsed.output is not None)


def failure_reason(outcome: RoleOutcome[Any] | None) -> str:
    """Why a question gave no output: the problem of its last attempt."""
    if outcome is None:
        return UNANSWERED
    return outcome.attempts[-1].parsed.problem if outcome.attempts else "no attempt was allowed"


async def design_machines(run: WorkflowContext) -> list[Candidate]:
    """One designer per trajectory, each for a whole machine; not simulated yet."""

    async def design(trajectory: int) -> Candidate:
        given = DesignerInput(
            run.brief,
            spatial=run.settings.spatial,
            representation=run.settings.representation,
            rationale=run.settings.rationale(trajectory),
        )
        label = f"designer/traj-{trajectory}"
        outcome = await run.ask(Designer(), given, label, stage="initial")
        first = first_attempt_of(outcome)
        if outcome is None or outcome.output is None:
            return Candidate(trajectory, first=first, reason=failure_reason(outcome))
        return Candidate(trajectory, outcome.output.machine, first=first)

    every = range(1, run.settings.trajectories + 1)
    return await run_concurrently(design(number) for number in every)


async def simulate(
    run: WorkflowContext, stage: StageName, candidates: Sequence[Candidate]
) -> list[Candidate]:
    """Simulate the candidates that have a valid machine; say of the others why not."""

    async def judge(candidate: Candidate) -> Candidate:
        machine = candidate.machine
        if machine is None:
            return candidate
        report = check(machine, run.brief)
        if not report.task_valid:
            return replace(candidate, reason=candidate.reason or report.problems[0].message)
        evaluation = await run.evaluate(machine, stage, f"traj-{candidate.trajectory}")
        reason = "" if evaluation.valid else "the simulation refused the machine"
        return replace(candidate, evaluation=evaluation, reason=reason)

    return await run_concurrently(judge(candidate) for candidate in candidates)


async def refine_blindly(
    run: WorkflowContext, candidate: Candidate, blueprint: Blueprint | None
) -> Candidate:
    """Criticise a machine, refine it once without having seen a simulation, simulate it.

    A trajectory whose refiner gives nothing valid within its retries ends here (spec 5.2).
    """
    critique = await _critique(run, candidate, blueprint)
    assert candidate.machine is not None
    given = RefinerInput(
        brief=run.brief,
        machine=candidate.machine,
        blueprint=blueprint,
        critique=critique,
        spatial=run.settings.spatial,
        format=run.settings.refinement,
        representation=run.settings.representation,
        images=await run.views(candidate.machine),
    )
    label = f"refiner/blind/traj-{candidate.trajectory}"
    outcome = await run.ask(Refiner(), given, label, stage=BLIND)
    first = first_attempt_of(outcome)
    if outcome is None or outcome.output is None:
        return Candidate(candidate.trajectory, first=first, reason=failure_reason(outcome))
    edit = edit_record(outcome.output, candidate.score)
    made = Candidate(candidate.trajectory, outcome.output.machine, first=first, edit=edit)
    return (await simulate(run, BLIND, [made]))[0]


def edit_record(refinement: Refinement, before: float | None) -> EditRecord:
    """A refinement as an entry of the edit history, its own score still unknown."""
    return EditRecord(refinement.script or refinement.description, "Success", before=before)


async def _critique(run: WorkflowContext, candidate: Candidate, blueprint: Blueprint | None) -> str:
    """The inspector's report; "" when it is switched off or gives none."""
    if not run.settings.inspector or candidate.machine is None:
        return ""
    given = InspectorInput(
        run.brief,
        candidate.machine,
        blueprint,
        groups=candidate.groups,
        spatial=run.settings.spatial,
        representation=run.settings.representation,
    )
    label = f"inspector/traj-{candidate.trajectory}"
    outcome = await run.ask(Inspector(), given, label, stage=BLIND)
    if outcome is None or outcome.output is None:
        return ""
    found = outcome.output
    run.record.event(
        "inspection",
        label,
        machine=candidate.machine.digest,
        world_score=found.orientation_score,
        world=found.orientation,
        defects=[
            {"blocks": list(d.blocks), "structure": d.structure, "text": d.text}
            for d in found.defects
        ],
    )
    return found.text
