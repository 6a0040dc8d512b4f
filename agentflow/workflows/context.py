"""The context of a workflow: asks roles, simulates machines, records and counts everything."""

import asyncio
import math
import random
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from agentflow.agents.analyst import Analyst
from agentflow.agents.base import AskContext, Role, RoleAttempt, RoleOutcome, ask
from agentflow.agents.context import Elsewhere, RoleInput
from agentflow.agents.refiner import Refinement
from agentflow.agents.registry import ROLES, with_model
from agentflow.agents.tool_agent import Agent, take_turn
from agentflow.errors import BudgetSpentError, DamagedError
from agentflow.llm.messages import Message, Tool
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine
from agentflow.machine.twins import likeness
from agentflow.runs.events import (
    AttemptEvent,
    CandidateEvent,
    EvaluationEvent,
    QueryEvent,
    ResultEvent,
    RunEvent,
    StageBeginEvent,
    StageEvent,
    ToolEvent,
)
from agentflow.runs.locations import FEEDBACK, INITIAL, Location, StageName
from agentflow.search.concurrency import EvaluateOnce
from agentflow.search.node import Evaluation
from agentflow.search.strategies import searches_whole_run
from agentflow.tools.host import Evaluator, SimulationSummary, Told
from agentflow.workflows.base import (
    GREATEST,
    AskContexts,
    Candidate,
    Finalist,
    Maker,
    Record,
    Stage,
    WorkflowResult,
    find_best,
    pareto_front,
    stage_row,
)
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.memory import Memory

In = TypeVar("In")
Out = TypeVar("Out")


@dataclass
class _Count:
    """What a stage has cost so far."""

    calls: int = 0
    tokens: int = 0
    machines: set[Machine] = field(default_factory=set)
    tools: dict[str, dict[str, int]] = field(default_factory=dict)

    def add_tool(self, event: ToolEvent) -> None:
        """Count a call of a tool."""
        row = self.tools.setdefault(event.tool, {"calls": 0, "refused": 0})
        row["calls"] += 1
        row["refused"] += event.refused


class WorkflowContext:
    """One run of a workflow, and the `BenchHost` of its benches. Identical machines are simulated
    once."""

    def __init__(
        self,
        workflow: str,
        brief: Brief,
        contexts: AskContexts,
        evaluator: Evaluator,
        settings: WorkflowSettings,
        record: Record,
        seed: int,
        most_calls: int | None = None,
    ) -> None:
        """Take the arguments of a `Workflow`, and its name."""
        self.brief, self.settings = brief, settings
        self._most_calls = most_calls
        self.spent: BudgetSpentError | None = None
        """Set once the budget has run out; no further question will be answered."""
        self.reached_greatest = False
        """Set once a search has ended because no machine can score higher than its best."""
        self.makers: tuple[Maker, ...] = ()
        """Set by a search over the whole run."""
        self._workflow, self._contexts, self._seed = workflow, contexts, seed
        self.evaluator, self._record = evaluator, record
        self._evaluations: EvaluateOnce[Machine] = EvaluateOnce(self._evaluate)
        self._stages: list[Stage] = []
        self._opened = settings.trajectories
        self._tried: dict[int, set[Machine]] = {}
        """Trajectory -> the machines that were simulated in it."""
        self.memory = Memory(brief, settings, self.note)
        self.models: dict[int, str] = {}
        """Trajectory -> the model that is asked for it, where a search chooses that."""
        self._analysing = asyncio.Lock()
        self._counts: dict[str, _Count] = {}
        """By stage name; trajectories may be in different stages at the same time."""

    @property
    def trajectories(self) -> range:
        """The numbers of the trajectories, from 1."""
        return range(1, self._opened + 1)

    def open_trajectories(self, count: int) -> None:
        """Set their number, where a search decides how many there are."""
        self._opened = count

    @property
    def role_input(self) -> dict[str, Any]:
        """The fields of `RoleInput`, for the inputs of roles."""
        settings = self.settings
        return {
            "brief": self.brief,
            "spatial": settings.spatial,
            "representation": settings.representation,
        }

    def stream(self, name: str) -> random.Random:
        """A random stream for one purpose, derived from the run's seed and the name."""
        return random.Random(f"{self._seed}/{name}")

    async def ask(
        self,
        role: Role[In, Out],
        given: In,
        location: Location,
        *,
        stage: StageName,
        model_role: str = "",
        once: bool = False,
    ) -> RoleOutcome[Out] | None:
        """Ask a role; None if the budget runs out before the answer.

        Args:
            role: Role to ask.
            given: Its input.
            location: Location of the question; unique in the run.
            stage: Stage that the calls count for.
            model_role: Role whose model and sampling to use, if not its own.
            once: Make only one attempt, as searches do.
        """
        own = with_model(role.model_role or role.name, self.models.get(location.trajectory, ""))
        used = self._context(model_role or own, stage)
        used = replace(used, max_retry=1) if once else used
        try:
            with ROLES.blaming(role.name):
                return await ask(role, given, used, str(location))
        except BudgetSpentError as spent:
            self.spent = spent
            return None

    async def elsewhere(self, trajectory: int) -> Elsewhere:
        """What a role of a trajectory is shown of the others; an analyst may have written it."""
        async with self._analysing:
            given = self.memory.to_analyse
            if given is not None:
                at = Location(Analyst.name, round=self.memory.revealed)
                outcome = await self.ask(Analyst(), given, at, stage=FEEDBACK)
                self.memory.analysed((outcome and outcome.output) or ())
        return self.memory.for_trajectory(trajectory)

    def likeness(self, machine: Machine) -> str:
        """The same text for machines of which only one is worth a simulation."""
        return likeness(machine, self.brief) if self.settings.novelty else machine.digest

    async def take_turn(
        self,
        conversation: Sequence[Message],
        tools: Sequence[Tool],
        location: Location,
        *,
        stage: StageName,
    ) -> RoleAttempt[str] | None:
        """Ask the agent for its next reply; None if the budget runs out before it."""
        used = self._context(Agent.name, stage)
        try:
            return await take_turn(conversation, tools, used, str(location))
        except BudgetSpentError as spent:
            self.spent = spent
            return None

    def _context(self, role: str, stage: StageName) -> AskContext:
        """How to ask a role so that its calls count for a stage."""
        own, count = self._contexts(role), self._counts[stage]
        return replace(own, on_attempt=lambda made: self._count(made, count, own.on_attempt))

    def note(self, event: RunEvent) -> None:
        """Record an event, and count calls of tools."""
        if isinstance(event, ToolEvent):
            self._counts[event.location.name].add_tool(event)
        self._record.event(event)

    async def evaluate(self, machine: Machine, location: Location) -> Evaluation:
        """Simulate a machine or reuse its result, and record that at a location in a stage."""
        evaluation = await self._evaluations(machine, f"machine-{machine.digest}")
        self._counts[location.name].machines.add(machine)
        self._tried.setdefault(location.trajectory, set()).add(machine)
        summary: SimulationSummary = evaluation.details
        self.note(
            EvaluationEvent(
                location,
                machine.digest,
                evaluation.valid,
                evaluation.score,
                summary.status,
                summary.broken,
                summary.digest,
                summary.moved,
                evaluation.value,
                # A greatest score of 1 is itself the success.
                None if self.brief.greatest == 1 else summary.success,
                summary.met,
            )
        )
        return evaluation

    def evaluation_of(self, machine: Machine) -> Evaluation | None:
        """The finished evaluation of a machine; None without one."""
        return self._evaluations.find(machine)

    def simulated(self, machine: Machine) -> SimulationSummary | None:
        """The result of a finished simulation; None without one."""
        evaluation = self.evaluation_of(machine)
        summary: SimulationSummary | None = evaluation.details if evaluation else None
        return summary

    async def simulate(self, machine: Machine, location: Location) -> SimulationSummary:
        """Simulate a machine of an agent, whose only trajectory has the number 1."""
        evaluation = await self.evaluate(machine, replace(location, trajectory=1))
        summary: SimulationSummary = evaluation.details
        return summary

    def save(self, machine: Machine) -> None:
        """Store a machine that a later event names; the same machine may come twice."""
        self._record.save_machine(machine.digest, machine.to_text())

    def log(self, text: bytes) -> None:
        """Keep what a program has printed."""
        self._record.log(text)

    def earlier(self, stage: StageName) -> Sequence[RunEvent]:
        """What an earlier process recorded in a stage; nothing in a new run."""
        return self._record.earlier(stage)

    def load_machine(self, digest: str) -> Machine:
        """A machine that an earlier process stored."""
        machine = read_machine(self._record.load_machine(digest), tuple(library())).machine
        if machine is None or machine.digest != digest:
            raise DamagedError(f"machines/{digest}.json of the run is damaged")
        return machine

    async def query(
        self, machine: Machine, queries: Sequence[object], location: Location | None
    ) -> Told:
        """Answer queries on an evaluated machine, recorded at the location of the querier."""
        answer = await self.evaluator.query(machine, queries)
        if location is not None:
            self.note(QueryEvent(location, machine.digest, list(queries), answer.text))
        return answer

    @property
    def rollouts(self) -> int:
        """Number of distinct machines simulated so far."""
        return self._evaluations.count

    @property
    def simulations_left(self) -> int:
        """How many more machines may be simulated in the run; very many without a limit."""
        most = self.settings.max_simulations
        return sys.maxsize if most is None else most - self.rollouts

    @property
    def calls_left(self) -> float:
        """How many more calls may be made in the run, as a resumed run counts them as well;
        infinitely many without a limit on calls."""
        if self.spent:
            return 0
        made = sum(count.calls for count in self._counts.values())
        return math.inf if self._most_calls is None else self._most_calls - made

    def has_tried(self, trajectory: int, machine: Machine) -> bool:
        """Whether a machine was simulated in a trajectory."""
        return machine in self._tried.get(trajectory, ())

    def left_in(self, trajectory: int) -> int:
        """How many more machines a trajectory may simulate; very many without a limit.

        The trajectories share the simulations of the run evenly, so that what one does depends on
        no other; a search over the whole run deals them itself.
        """
        most, many = self.settings.max_simulations, self.settings.trajectories
        if most is None or searches_whole_run(self.settings.search):
            return sys.maxsize
        share = most // many + (trajectory <= most % many)
        return share - len(self._tried.get(trajectory, ()))

    async def views(self, machine: Machine) -> tuple[str, ...]:
        """Pictures of a machine for a refiner; none if vision is switched off."""
        return await self.evaluator.views(machine) if self.settings.vision else ()

    def prompts_of(self, role: Role[In, Out], given: In) -> tuple[str, str]:
        """The system and the user prompt of a role."""
        prompts = self._contexts(role.model_role or role.name).prompts
        return role.prompt(given, prompts)

    @property
    def brief_text(self) -> str:
        """The user prompt of an agent: the task, the blocks and the rules."""
        return self.prompts_of(Agent(), RoleInput(**self.role_input))[1]

    def begin_stage(self, name: StageName) -> None:
        """Open a stage; a second call, for another trajectory, does nothing."""
        if name not in self._counts:
            self._counts[name] = _Count()
            self.note(StageBeginEvent(Location(name), self.settings.trajectories))

    def end_stage(self, name: StageName, candidates: Sequence[Candidate]) -> Stage:
        """Close a stage, after all earlier ones; trajectories without a candidate are invalid."""
        count = self._counts[name]
        earlier = (self._counts[stage.name].machines for stage in self._stages)
        found = {candidate.trajectory: candidate for candidate in candidates}
        every = tuple(
            found.get(t) or Candidate(t, reason="ended in an earlier stage")
            for t in self.trajectories
        )
        rollouts = len(count.machines.difference(*earlier))
        stage = Stage(name, every, count.calls, count.tokens, rollouts, count.tools)
        for candidate in stage.candidates:
            location = Location(name, trajectory=candidate.trajectory)
            self.note(CandidateEvent(location, **_fields(candidate)))
        self.note(StageEvent(Location(name), **stage_row(stage)))
        self._stages.append(stage)
        return stage

    def has_ended(self, name: StageName) -> bool:
        """Whether a stage is closed."""
        return any(stage.name == name for stage in self._stages)

    def is_over(self, stage: Stage) -> bool:
        """Whether the run ends with this stage: no valid machine is left, or no budget."""
        return self.spent is not None or not stage.survivors

    def result(self) -> WorkflowResult:
        """Close the run: the best valid machine of all stages."""
        stages = tuple(self._stages)
        best, stage = find_best(stages) or (None, None)
        reason = "" if best else _why_none(stages)
        result = WorkflowResult(
            workflow=self._workflow,
            best=best,
            best_stage=stage.name if stage else None,
            stages=stages,
            stopped="budget" if self.spent else GREATEST if self.reached_greatest else None,
            reason=reason,
            front=pareto_front(self._evaluations.finished),
            lessons=self.memory.findings,
            makers=self.makers,
            finalists=self._finalists(best) if best and self.makers else (),
        )
        found = _fields(best) if best else {"reason": reason}
        location, stopped = Location(self._workflow), result.stopped
        self.note(ResultEvent(location, **found, stage=result.best_stage, stopped=stopped))
        return result

    def _finalists(self, best: Candidate) -> tuple[Finalist, ...]:
        """The machines with the highest scores that meet what is required, `best` first."""
        if self.settings.objective != "score":
            return ()
        ranked = sorted(
            (-found.score, machine != best.machine, machine.digest, machine, found)
            for machine, found in self._evaluations.finished
            if found.valid and found.score is not None and found.missed is None
        )
        finalists = []
        for score, _, _, machine, found in ranked[: self.settings.finalists]:
            of = next(number for number in sorted(self._tried) if self.has_tried(number, machine))
            candidate = replace(best, trajectory=of, machine=machine, evaluation=found)
            first = machine in self._counts[INITIAL].machines
            finalists.append(Finalist(machine, -score, candidate, INITIAL if first else FEEDBACK))
        return tuple(finalists)

    async def _evaluate(self, machine: Machine, label: str) -> Evaluation:
        self.save(machine)
        evaluation = await self.evaluator.evaluate(machine, label)
        greatest, reward = self.brief.greatest, evaluation.reward
        reached = greatest is not None and reward is not None and reward >= greatest
        alone = evaluation.objectives is None  # else smaller machines are better still
        return replace(evaluation, perfect=evaluation.valid and reached and alone)

    def _count(
        self, attempt: RoleAttempt[Any], count: _Count, then: Callable[[RoleAttempt[object]], None]
    ) -> None:
        parsed, tokens = attempt.parsed, attempt.reply.usage.total
        count.calls += 1
        count.tokens += tokens
        machine = getattr(parsed.output, "machine", None)
        if isinstance(machine, Machine):
            self.save(machine)
        self.note(
            AttemptEvent(
                Location.parse(attempt.label),
                role=attempt.role,
                valid=parsed.output is not None,
                parsed=parsed.parsed,
                spatial=parsed.spatial,
                repaired=parsed.repaired,
                code=parsed.code,
                problem=parsed.problem,
                tokens=tokens,
                machine=machine.digest if isinstance(machine, Machine) else None,
                script=parsed.output.script if isinstance(parsed.output, Refinement) else None,
            )
        )
        then(attempt)


def _fields(candidate: Candidate) -> dict[str, Any]:
    """The fields of a candidate in its event and in the result's."""
    return {
        "trajectory": candidate.trajectory,
        "machine": candidate.machine.digest if candidate.machine else None,
        "valid": candidate.valid,
        "score": candidate.score,
        "first": candidate.first,
        "reason": candidate.reason,
    }


def _why_none(stages: Sequence[Stage]) -> str:
    if any(stage.survivors for stage in stages):
        return "valid machines, but none could be scored: every simulation failed"
    reasons = [c.reason for stage in stages for c in stage.candidates if c.reason]
    return f"no valid machine: {reasons[0]}"
