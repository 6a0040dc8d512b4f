"""The stages of agents: a worker at a bench submits machines, which are then evaluated."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from random import Random

from agentflow.agents.tool_agent import Agent, AgentInput
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.runs.events import FLAWLESS, CandidateEvent, RunEvent
from agentflow.runs.locations import FEEDBACK, INITIAL, STAGES, Location, StageName
from agentflow.tools.bench import Bench
from agentflow.tools.host import Aims, Shot, Told
from agentflow.tools.workspace import Allowance, KnownMachines, StageBudget
from agentflow.workflows.base import Candidate, SimulationSummary, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import design_machines, simulate

ROLLOUTS = 24
"""Simulations of a run by default: as many as three stages of eight machines need."""
UNSUBMITTED = "submitted no machine"
Worker = Callable[[Bench, StageName], Awaitable[None]]
"""Works at the bench of a stage; the stage ends when it returns, with what it has submitted."""


class RunHost:
    """Implements the `BenchHost` of a bench over a run of a workflow."""

    def __init__(self, run: WorkflowContext) -> None:
        self._run = run

    @property
    def brief(self) -> Brief:
        """The task as plain data."""
        return self._run.brief

    @property
    def brief_text(self) -> str:
        """The user prompt of the agent."""
        return self._run.prompts_of(Agent(), AgentInput(**self._run.role_input))[1]

    def stream(self, name: str) -> Random:
        """A random stream for one purpose."""
        return self._run.stream(name)

    def simulated(self, machine: Machine) -> SimulationSummary | None:
        """The result of a finished simulation; None without one."""
        evaluation = self._run.evaluation_of(machine)
        summary: SimulationSummary | None = evaluation.details if evaluation else None
        return summary

    async def simulate(self, machine: Machine, location: Location) -> SimulationSummary:
        """Simulate a machine; the only trajectory of an agent has the number 1."""
        evaluation = await self._run.evaluate(machine, replace(location, trajectory=1))
        summary: SimulationSummary = evaluation.details
        return summary

    @property
    def aims(self) -> Aims:
        """What a score is worth, and how the final one is made."""
        return self._run.aims

    def count_changes(self, machine: Machine) -> int:
        """How many simulations verifying a machine takes."""
        return self._run.count_changes(machine)

    async def verify(self, machine: Machine) -> Told:
        """How the score of a simulated machine holds under small changes."""
        return await self._run.verified(machine)

    async def feedback(self, machine: Machine, trial: int) -> Told:
        """What happened in a trial of a simulated machine."""
        return await self._run.feedback(machine, trial)

    async def query(self, machine: Machine, queries: Sequence[object], location: Location) -> Told:
        """Recorded states of a simulated machine, as tables and data."""
        return await self._run.query(machine, queries, location)

    async def look(self, machine: Machine, shot: Shot) -> bytes:
        """A PNG picture of a machine."""
        return await self._run.look(machine, shot)

    def save(self, machine: Machine) -> None:
        """Store a machine by its content hash."""
        self._run.save(machine)

    def note(self, event: RunEvent) -> None:
        """Record an event."""
        self._run.note(event)


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
        bench = Bench(RunHost(run), stage, budget, machines)
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
