"""Stages of whole designs that workflows share: design, simulate, criticise, refine blindly."""

from collections.abc import Sequence
from dataclasses import replace
from random import Random
from typing import Any

from agentflow.agents.base import RoleOutcome
from agentflow.agents.designer import DesignedMachine, Designer, DesignerInput, Drafter
from agentflow.agents.history import EditRecord, History
from agentflow.agents.inspector import Inspector, InspectorInput
from agentflow.agents.meta_designer import Blueprint
from agentflow.agents.refiner import NO_CHANGE, Refinement, Refiner, RefinerInput
from agentflow.errors import UsageError
from agentflow.machine.brief import Brief
from agentflow.machine.edits.random import BLOCKS, random_machine
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check, problems_of
from agentflow.runs.events import FLAWLESS, FirstAttempt, InspectionEvent
from agentflow.runs.locations import BLIND, INITIAL, Location, StageName
from agentflow.search.concurrency import run_concurrently
from agentflow.search.node import Evaluation
from agentflow.tools.host import SimulationSummary
from agentflow.workflows.base import Candidate
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings

UNANSWERED = "the budget ran out before an answer"


def first_attempt_of(outcome: RoleOutcome[Any] | None) -> FirstAttempt:
    """How far the first attempt at a question got."""
    if outcome is None or not outcome.attempts:
        return FirstAttempt()
    parsed = outcome.attempts[0].parsed
    return FirstAttempt(parsed.parsed, parsed.spatial is True, parsed.output is not None)


def failure_reason(outcome: RoleOutcome[Any] | None) -> str:
    """Why a question has no valid answer: the reason of its last attempt, for people."""
    if outcome is None:
        return UNANSWERED
    return outcome.attempts[-1].reason if outcome.attempts else "no attempt was allowed"


def candidate_of(trajectory: int, outcome: RoleOutcome[Any] | None) -> Candidate:
    """The machine in the answer, not simulated yet, or why there is none."""
    first = first_attempt_of(outcome)
    if outcome is None or outcome.output is None:
        return Candidate(trajectory, first=first, reason=failure_reason(outcome))
    return Candidate(trajectory, outcome.output.machine, first=first)


def draw_machine(
    trajectory: int,
    rng: Random,
    brief: Brief,
    *,
    start: Machine | None = None,
    size: tuple[int, int] = BLOCKS,
) -> Candidate:
    """The start machine, or else a random one of this least and most blocks; or why not."""
    try:
        machine = start or random_machine(rng, brief, size)
    except UsageError as error:
        return Candidate(trajectory, reason=str(error))
    return Candidate(trajectory, machine, first=FLAWLESS)


async def ask_designer(
    run: WorkflowContext, given: DesignerInput, location: Location
) -> RoleOutcome[DesignedMachine] | None:
    """A designer's answer, which has seen the check of its draft if the settings allow one.

    A reply without a machine is left out: there is nothing to check.
    """
    if run.settings.drafts:
        at = replace(location, name=Drafter.name)
        drafted = await run.ask(Drafter(), given, at, stage=INITIAL, once=True)
        given = replace(given, draft=None if drafted is None else drafted.output)
    return await run.ask(Designer(), given, location, stage=INITIAL)


def count_designs(settings: WorkflowSettings, each: int = 1) -> dict[str, int]:
    """Role -> calls of a run's first designs without retries; `each` is those per trajectory."""
    calls = settings.trajectories * each * (not settings.start)
    return {Designer.name: calls, **({Drafter.name: calls} if settings.drafts else {})}


async def design_machine(run: WorkflowContext, trajectory: int) -> Candidate:
    """Ask a designer for a whole machine; it is not simulated yet.

    A start machine takes the place of the design.
    """
    start = run.settings.start_machine
    if start is not None:
        return Candidate(trajectory, check(start, run.brief).machine or start, first=FLAWLESS)
    given = DesignerInput(
        **run.role_input,
        rationale=run.settings.rationale(trajectory),
        elsewhere=await run.elsewhere(trajectory),
    )
    location = Location(Designer.name, trajectory=trajectory)
    return candidate_of(trajectory, await ask_designer(run, given, location))


async def design_machines(run: WorkflowContext) -> list[Candidate]:
    """A whole machine per trajectory; nothing is simulated yet."""
    return await run_concurrently(design_machine(run, number) for number in run.trajectories)


async def simulate(
    run: WorkflowContext, stage: StageName, candidates: Sequence[Candidate]
) -> list[Candidate]:
    """Simulate the candidates with a valid machine; give the others a reason."""

    async def judge(candidate: Candidate) -> Candidate:
        machine = candidate.machine
        if machine is None:
            return candidate
        if problems := problems_of(machine, run.brief):
            return replace(candidate, reason=candidate.reason or problems[0].message)
        evaluation = await run.evaluate(machine, Location(stage, trajectory=candidate.trajectory))
        reason = "" if evaluation.valid else "the simulation refused the machine"
        return replace(candidate, evaluation=evaluation, reason=reason)

    return await run_concurrently(judge(candidate) for candidate in candidates)


async def try_machines(
    run: WorkflowContext, stage: StageName, candidates: Sequence[Candidate], *, model_role: str = ""
) -> list[Candidate]:
    """Simulate candidates, in as many trials as the task gives; the best trial of each counts.

    After each trial but the last, a refiner may revise the controls alone; `model_role` is the role
    whose model it uses, if not its own.
    """
    tried = await simulate(run, stage, candidates)
    return await run_concurrently(_retry(run, stage, item, model_role) for item in tried)


async def _retry(
    run: WorkflowContext, stage: StageName, candidate: Candidate, model_role: str
) -> Candidate:
    """All trials of a simulated machine after the first one; they end when nothing is revised."""
    best, history = candidate, History()
    if candidate.edit is not None and candidate.evaluation is not None:
        history = history.add(with_result(candidate.edit, candidate.evaluation))
    for trial in range(1, run.brief.limits.trials):
        if not best.valid or best.perfect or best.machine is None or best.evaluation is None:
            break
        if not run.left_in(candidate.trajectory):
            break
        given = RefinerInput(
            **run.role_input,
            machine=best.machine,
            history=history if run.settings.history else History(),
            **_shown(run, best.evaluation),
            trial=trial + 1,
        )
        at = Location(stage, trajectory=candidate.trajectory, try_=trial)
        asked = replace(at, name=f"{Refiner.name}/{stage}")
        outcome = await run.ask(Refiner(), given, asked, stage=stage, model_role=model_role)
        made = None if outcome is None else outcome.output
        if made is None or made.machine == best.machine:
            break
        edit = edit_record(made, best.evaluation)
        evaluation = await run.evaluate(made.machine, at)
        history = history.add(with_result(edit, evaluation))
        if (evaluation.reward or 0.0) > (best.reward or 0.0):
            best = replace(best, machine=made.machine, evaluation=evaluation, edit=edit)
        best = replace(best, trials=history)
    return best


async def refine_blindly(
    run: WorkflowContext, candidate: Candidate, blueprint: Blueprint | None
) -> Candidate:
    """Criticise a machine, refine it once, simulate it.

    With `simulate_first`, the refiner sees the simulation of the machine as it was designed.
    A trajectory ends here if its refiner gives no valid machine within its retries.
    """
    critique = await _critique(run, candidate, blueprint)
    assert candidate.machine is not None
    given = RefinerInput(
        **run.role_input,
        machine=candidate.machine,
        blueprint=blueprint,
        critique=critique,
        **(_shown(run, candidate.evaluation) if run.settings.simulate_first else {}),
        format=run.settings.refinement,
        images=await run.views(candidate.machine),
    )
    location = Location("refiner/blind", trajectory=candidate.trajectory)
    outcome = await run.ask(Refiner(), given, location, stage=BLIND)
    made = candidate_of(candidate.trajectory, outcome)
    if outcome is None or outcome.output is None:
        return made
    made = replace(made, edit=edit_record(outcome.output, candidate.evaluation))
    return (await try_machines(run, BLIND, [made]))[0]


def edit_record(refinement: Refinement, before: Evaluation | None) -> EditRecord:
    """A refinement as an entry of the edit history; its own score is not known yet."""
    whole = "" if refinement.description == NO_CHANGE else "a new machine: "
    return EditRecord(
        refinement.script or f"{whole}{refinement.description}",
        "Success",
        before=before.score if before else None,
        facts=(before.details.facts if before else {}, {}),
        ids=refinement.ids,
    )


def with_result(edit: EditRecord, after: Evaluation) -> EditRecord:
    """An entry of the edit history with what the simulation of its machine showed."""
    return replace(edit, after=after.score, facts=(edit.facts[0], after.details.facts))


def _shown(run: WorkflowContext, evaluation: Evaluation | None) -> dict[str, Any]:
    """Score and feedback of a simulation for a refiner, as far as the settings show them."""
    if evaluation is None:
        return {}
    summary: SimulationSummary = evaluation.details
    told = "" if run.settings.feedback == "score_only" else summary.feedback
    return {"score": evaluation.score, "feedback": told}


async def _critique(run: WorkflowContext, candidate: Candidate, blueprint: Blueprint | None) -> str:
    """The inspector's report; "" if it is switched off or gives none."""
    if not run.settings.inspector or candidate.machine is None:
        return ""
    given = InspectorInput(
        **run.role_input, machine=candidate.machine, blueprint=blueprint, groups=candidate.groups
    )
    location = Location(Inspector.name, trajectory=candidate.trajectory)
    outcome = await run.ask(Inspector(), given, location, stage=BLIND)
    if outcome is None or outcome.output is None:
        return ""
    found = outcome.output
    defects = [vars(defect) | {"blocks": list(defect.blocks)} for defect in found.defects]
    world = (found.orientation_score, found.orientation)
    run.note(InspectionEvent(location, candidate.machine.digest, *world, defects))
    return found.text
