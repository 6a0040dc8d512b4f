"""Owns what workflows are given and what they yield: laboratory and record, candidates and stages.

How a stage is run is the other modules'; what is done with its result is the caller's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from agentflow.agents.base import AskContext
from agentflow.agents.history import EditRecord
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.search.node import Evaluation, SearchCost
from agentflow.workflows.settings import WorkflowSettings

AskContexts = Callable[[str], AskContext]
"""Role name -> who answers for that role, from which prompts, how."""

StageName = Literal["initial", "blind_refinement", "env_feedback"]


@dataclass(frozen=True)
class SimulationSummary:
    """What a simulation tells designers: the `details` of a laboratory's evaluation."""

    score: float | None
    status: str
    """ok, invalid, diverged, timeout, crashed."""
    feedback: str
    """The default feedback, as told to models."""
    broken: tuple[tuple[int, int, float], ...] = ()
    """(block, partner, seconds since t = 0) of each connection that gave way."""
    digest: str | None = None
    """Hash of every recorded state."""
    moved: float | None = None
    """How far the centre of the block that moved most got from where it began, m; None where
    there are no states."""


class Laboratory(Protocol):
    """Simulates machines at the task of the run; the workflow asks once per distinct machine."""

    async def evaluate(self, machine: Machine, label: str) -> Evaluation:
        """Simulate a machine; `details` is a `SimulationSummary`; the label names the machine."""

    async def query(self, machine: Machine, queries: Sequence[object]) -> str:
        """Answer queries on the states of an evaluated machine, as text for a model."""

    async def views(self, machine: Machine) -> tuple[str, ...]:
        """Pictures of a machine as built, as PNG data URLs; the same bytes whenever asked."""


class Record(Protocol):
    """Where everything that happens goes.

    `(kind, label)` is unique in a run. Data is JSON data without timings; concurrency changes the
    order of events and nothing else.
    """

    def event(self, kind: str, label: str, **data: Any) -> None:
        """Note one event."""

    def save_machine(self, digest: str, text: str) -> None:
        """Keep a valid machine by its content hash; may be told the same machine twice."""


@dataclass(frozen=True)
class FirstAttempt:
    """What the first attempt came to, before any retry."""

    parsed: bool = False
    """The reply had the demanded format."""
    spatial: bool = False
    """... and its machine was spatially valid."""
    valid: bool = False
    """... and it was what was asked for in every respect."""

    def __and__(self, other: FirstAttempt) -> FirstAttempt:
        """Both; of designs that build on each other."""
        return FirstAttempt(
            self.parsed and other.parsed,
            self.spatial and other.spatial,
            self.valid and other.valid,
        )


@dataclass(frozen=True)
class Candidate:
    """What one trajectory has to show at the end of a stage."""

    trajectory: int
    """1, 2, ..."""
    machine: Machine | None = None
    evaluation: Evaluation | None = None
    """None when it was not simulated, which invalid machines are not."""
    first: FirstAttempt = FirstAttempt()
    reason: str = ""
    """Why it is invalid; empty when it is valid."""
    groups: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    """Structure -> ids of its blocks, as built; empty once the machine was edited."""
    edit: EditRecord | None = None
    """The refinement that made it; its score after is the candidate's."""
    search_cost: SearchCost = field(default_factory=SearchCost)
    """What its search cost; zeros outside the feedback loop."""

    @property
    def valid(self) -> bool:
        """Whether there is a machine, whole and legal, and the simulation did not refuse it."""
        return self.evaluation is not None and self.evaluation.valid

    @property
    def score(self) -> float | None:
        """Of its simulation; None without one."""
        return self.evaluation.score if self.evaluation is not None else None


@dataclass(frozen=True)
class Stage:
    """One stage over all trajectories of a run, those that ended earlier included."""

    name: StageName
    candidates: tuple[Candidate, ...]
    calls: int
    """Model calls of this stage."""
    tokens: int
    """Prompt and completion tokens of this stage."""
    rollouts: int
    """Machines simulated in this stage for the first time."""

    @property
    def survivors(self) -> tuple[Candidate, ...]:
        """The valid candidates, with which the next stage goes on."""
        return tuple(candidate for candidate in self.candidates if candidate.valid)


@dataclass(frozen=True)
class WorkflowResult:
    """The outcome of a workflow; without a valid machine it is a result all the same."""

    workflow: str
    best: Candidate | None
    """Highest score of all stages; the earlier stage, then the lower trajectory among equals."""
    best_stage: StageName | None
    stages: tuple[Stage, ...]
    stopped: Literal["budget"] | None
    """What ended it early."""
    reason: str
    """Why there is no best machine; empty when there is one."""


class Workflow(Protocol):
    """A way from a brief to a machine."""

    async def __call__(
        self,
        brief: Brief,
        contexts: AskContexts,
        laboratory: Laboratory,
        settings: WorkflowSettings,
        record: Record,
        seed: int = 0,
    ) -> WorkflowResult:
        """Run it.

        Args:
            brief: The task as its designers see it.
            contexts: Who answers for each role.
            laboratory: Simulates machines at the task.
            settings: The switches.
            record: Told everything that happens.
            seed: Of the choices that the workflow itself makes, by streams of their own names.

        Raises:
            EndpointError: The endpoint cannot be used; the run can be taken up again later.
            ReplayMissError: A replaying client has no record of a request.
        """
