"""The stages of agents: a worker at a bench submits machines, which are then evaluated."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence

from agentflow.machine.tree import Machine
from agentflow.runs.events import FLAWLESS, CandidateEvent, RunEvent
from agentflow.runs.locations import FEEDBACK, INITIAL, STAGES, StageName
from agentflow.tools.bench import Bench
from agentflow.tools.workspace import Allowance, KnownMachines, StageBudget
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import design_machines, simulate

ROLLOUTS = 24
"""Simulations of a run by default: as many as three stages of eight machines need."""
UNSUBMITTED = "submitted no machine"
Worker = Callable[[Bench, StageName], Awaitable[None]]
"""Works at the bench of a stage; the stage ends when it returns, with what it has submitted."""


async def work_in_stages(
    run: WorkflowContext, worker: Worker, stages: Sequence[StageName] = STAGES
) -> WorkflowResult:
    """Let a worker submit machines in one stage after the other.

    Only the stage with feedback has simulations; the submissions of the others are simulated when
    the stage is over, and count in `settings.max_simulations` too. These stages may therefore
    submit no more machines than leave an equal share for each stage that follows. All stages share
    their machines. A start machine takes the place of the stages without feedback. Where nothing is
    submitted, the best machine that was simulated in the stage counts.
    """
    settings, machines = run.settings, KnownMachines()
    rollouts = Allowance.of_simulations(count_rollouts(settings))
    pictures = Allowance.of_pictures(settings.max_pictures) if settings.vision else None
    if settings.start_machine:
        run.begin_stage(INITIAL)
        run.end_stage(INITIAL, await simulate(run, INITIAL, await design_machines(run)))
        machines.add(settings.start_machine).submitted = INITIAL
        rollouts.left, stages = rollouts.total - run.rollouts, (FEEDBACK,)
    for number, stage in enumerate(stages):
        submissions = settings.candidates_per_stage
        if stage != FEEDBACK:
            share = max(1, rollouts.left // (len(stages) - number))
            submissions = min(submissions, share)
        left = len(stages) - number - 1
        budget = StageBudget(submissions, rollouts if stage == FEEDBACK else None, pictures, left)
        bench = Bench(run, stage, budget, machines)
        run.begin_stage(stage)
        await worker(bench, stage)
        await bench.close()
        closed = run.end_stage(stage, await simulate(run, stage, _candidates(run, bench)))
        rollouts.left = rollouts.total - run.rollouts
        run.reached_greatest = any(candidate.perfect for candidate in closed.candidates)
        if run.spent or run.reached_greatest or not rollouts.left:
            break
    return run.result()


async def repeat(run: WorkflowContext, bench: Bench, stage: StageName) -> Sequence[RunEvent]:
    """Do again what is recorded of a stage, and return that; nothing in a new run."""
    earlier = run.earlier(stage)
    for event in earlier:
        await bench.repeat(event, run.load_machine)
    return earlier


def reason_of(earlier: Sequence[RunEvent]) -> str:
    """Why a recorded stage ended before its last submission; "" if it did not, or is not over."""
    start = f"{UNSUBMITTED}: "
    reasons = [event.reason for event in earlier if isinstance(event, CandidateEvent)]
    told = (reason.removeprefix(start) for reason in reasons if reason.startswith(start))
    return next(told, "")


def count_rollouts(settings: WorkflowSettings) -> int:
    """Simulations that a run may use."""
    return settings.max_simulations or ROLLOUTS


def _candidates(run: WorkflowContext, bench: Bench) -> list[Candidate]:
    """One candidate for each machine that might have been submitted."""
    submitted = bench.submitted or _best_simulated(run, bench)
    made = [
        Candidate(number, machine, first=FLAWLESS)
        for number, machine in enumerate(submitted, start=1)
    ]
    missing = list(run.trajectories)[len(made) :]
    reason = f"{UNSUBMITTED}: {bench.reason}" if bench.reason else UNSUBMITTED
    return [*made, *(Candidate(number, reason=reason) for number in missing)]


def _best_simulated(run: WorkflowContext, bench: Bench) -> Sequence[Machine]:
    """The best machine that was simulated but never submitted, if there is any."""
    tried = [
        (evaluation.reward, known.machine)
        for known in bench.machines
        if known.submitted is None
        and (evaluation := run.evaluation_of(known.machine))
        and evaluation.valid
        and evaluation.reward is not None
    ]
    return [max(tried, key=lambda pair: pair[0])[1]] if tried else []
