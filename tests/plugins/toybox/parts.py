"""A family, a strategy, a role, a workflow, a metric and a page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import Any, ClassVar

from pydantic import BaseModel

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import machine_context, task_context
from agentflow.env.tasks.families.movement import Movement
from agentflow.llm.procedural.reading import PromptContent, Script
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.metrics.cells import Metric
from agentflow.runs import read_result
from agentflow.runs.events import RunEvent
from agentflow.runs.locations import Location
from agentflow.search.best_of_n import best_of_n
from agentflow.search.concurrency import run_concurrently
from agentflow.search.pooled.pool import Choice, Pool, PooledStrategy
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import design_machines, simulate
from agentflow.workflows.stages.feedback import feedback_loop
from agentflow.workflows.workflow import Workflow


@dataclass(frozen=True)
class Rolling(Movement):
    """Movement with another objective."""

    family: ClassVar[str] = "rolling"

    @property
    def brief(self) -> Brief:
        return replace(super().brief, objective="Build a machine that rolls along z+.")


class EagerOptions(BaseModel, extra="forbid"):
    """What eager can be told."""

    floor: float = 0.0
    rates: tuple[float, ...] = (1.0,)


async def eager(
    root: Any,
    evaluation: Any,
    expand: Any,
    evaluate: Any,
    *rest: Any,
    rng: Random,
    options: EagerOptions,
) -> Any:
    """Best-of-N, but not for bad machines."""
    floor = options.floor * rng.choice(options.rates)
    return await best_of_n(root, replace(evaluation, score=floor), expand, evaluate, *rest)


class DealerOptions(BaseModel, extra="forbid"):
    """What a dealer can be told."""

    most: int = 1


class Dealer(PooledStrategy):
    """Begins so many branches, and refines none."""

    def __init__(self, options: DealerOptions) -> None:
        self.most = options.most

    def choose(self, pool: Pool[Any], rng: Random) -> Choice | None:  # noqa: ARG002
        return Choice(pool.openers[0]) if len(pool.branches) < self.most else None


@dataclass(frozen=True)
class JudgeInput:
    """What to judge."""

    brief: Brief
    machine: Machine


def praise(prompt: PromptContent, rng: Random) -> str:
    """Like any machine."""
    return f"{rng.choice(('A good', 'A fine'))} machine of {len(prompt.machine)} blocks."


class Judge(Role[JudgeInput, str]):
    """Takes any sentence."""

    name: ClassVar[str] = "judge"
    stage: ClassVar[str] = "env_feedback"
    tokens: ClassVar[tuple[int, int]] = (500, 20)
    labels: ClassVar[tuple[str, ...]] = ("Observe",)
    script: ClassVar[Script] = Script(praise, "One sentence")

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> JudgeInput:
        return JudgeInput(brief, machine)

    def variables(self, given: JudgeInput) -> Mapping[str, object]:
        return {**task_context(given.brief), **machine_context(given.machine, spatial=False)}

    def parse(self, text: str, given: JudgeInput) -> Parsed[str]:  # noqa: ARG002
        return Parsed(text.strip())


@dataclass(frozen=True)
class Judgement(RunEvent, kind="judgement"):
    """An event of its own kind."""

    text: str


async def judged(run: WorkflowContext) -> WorkflowResult:
    """Whole machines, refined by search, each judged at the end."""

    async def follow(candidate: Candidate) -> Candidate:
        found = await feedback_loop(run, candidate, None)
        assert found.machine is not None
        location = Location(Judge.name, trajectory=candidate.trajectory)
        given = JudgeInput(run.brief, found.machine)
        outcome = await run.ask(Judge(), given, location, stage="env_feedback")
        run.note(Judgement(location, outcome.output if outcome and outcome.output else ""))
        return found

    run.begin_stage("initial")
    initial = run.end_stage("initial", await simulate(run, "initial", await design_machines(run)))
    if not run.is_over(initial):
        run.begin_stage("env_feedback")
        refined = await run_concurrently(follow(candidate) for candidate in initial.survivors)
        run.end_stage("env_feedback", refined)
    return run.result()


def calls(settings: WorkflowSettings) -> dict[str, int]:
    many = settings.trajectories
    return {"designer": many, "refiner": many * settings.search.rounds, "judge": many}


JUDGED = Workflow("judged", judged, calls, rollouts=lambda settings: 2 * settings.trajectories)
RUN_COUNT = Metric(lambda cell: len(cell.runs), "number of runs")


def plain_page(path: Path, out: Path, **_: Any) -> Path:
    """The score of a run in plain HTML."""
    out.write_text(f"<p>{read_result(path).score}</p>", encoding="utf-8")
    return out
