"""The types that workflows use and return: evaluator, record, candidates, stages, results; and
their statistics."""

import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, NamedTuple, Protocol

from agentflow.agents.base import AskContext
from agentflow.agents.history import EditRecord, History
from agentflow.machine.tree import Machine
from agentflow.runs.events import FirstAttempt, RunEvent
from agentflow.runs.locations import StageName
from agentflow.search.node import Evaluation, SearchCost
from agentflow.search.pareto import ranks
from agentflow.search.tree import is_better

GREATEST: Final = "greatest score"
"""Why a search or a run ended: a machine has the greatest possible score of the task."""
AskContexts = Callable[[str], AskContext]
"""Role name -> client, prompts and sampling to ask the role with."""


class Record(Protocol):
    """Receives everything that happens in a run, and knows what an earlier process recorded.

    `(kind, label)` is unique in a run. Data is JSON without timings; concurrency changes only the
    order of events.
    """

    def event(self, event: RunEvent) -> None:
        """Record one event."""

    def save_machine(self, digest: str, text: str) -> None:
        """Store a valid machine by its content hash; the same machine may come twice."""

    def log(self, text: bytes) -> None:
        """Keep what a program has printed."""

    def earlier(self, stage: StageName) -> Sequence[RunEvent]:
        """What an earlier process recorded in a stage of this run; nothing in a new run."""

    def load_machine(self, digest: str) -> str:
        """The text of a machine that an earlier process stored."""


@dataclass(frozen=True)
class Candidate:
    """The machine of one trajectory at the end of a stage, or why there is none."""

    trajectory: int
    """1, 2, ..."""
    machine: Machine | None = None
    evaluation: Evaluation | None = None
    """None if it was not simulated, as invalid machines are not."""
    first: FirstAttempt = field(default_factory=FirstAttempt)
    reason: str = ""
    """Why it is invalid; empty if it is valid."""
    groups: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    """Structure -> ids of its blocks as built; empty after an edit."""
    edit: EditRecord | None = None
    """The refinement that made it, without the score after it."""
    trials: History = field(default_factory=History)
    """That refinement and those of the controls after each trial, with scores; empty without."""
    search_cost: SearchCost = field(default_factory=SearchCost)
    """Cost of its search; zeros outside the feedback loop."""

    @property
    def valid(self) -> bool:
        """Whether there is a valid machine that the simulation accepted."""
        return self.evaluation is not None and self.evaluation.valid

    @property
    def perfect(self) -> bool:
        """Whether no machine can do better."""
        return self.evaluation is not None and self.evaluation.perfect

    @property
    def score(self) -> float | None:
        """Score of its simulation; None without one."""
        return self.evaluation.score if self.evaluation is not None else None

    @property
    def reward(self) -> float | None:
        """What machines are compared by: the score, unless the run has another objective."""
        return self.evaluation.reward if self.evaluation is not None else None


@dataclass(frozen=True)
class Stage:
    """A finished stage over all trajectories of a run, including those that ended earlier."""

    name: StageName
    candidates: tuple[Candidate, ...]
    calls: int
    tokens: int
    """Of prompts and completions."""
    rollouts: int
    """Machines first simulated in this stage."""
    tools: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    """Tool -> `calls`, and how many of them were `refused`."""

    @property
    def survivors(self) -> tuple[Candidate, ...]:
        """The valid candidates, which the next stage starts from."""
        return tuple(candidate for candidate in self.candidates if candidate.valid)


@dataclass(frozen=True)
class Maker:
    """What one of those who make machines in a search over the whole run has made."""

    maker: str
    """A role, or another emitter."""
    machines: int
    share: float
    """Of the machines of the search, from 0 to 1."""
    better: int
    """How many scored higher than the machine that they were made from, or, as first machines,
    than all earlier first ones."""
    gain: float
    """By how much, in total."""


class Finalist(NamedTuple):
    """A machine that may be chosen as the best of a run when it is verified."""

    machine: Machine
    score: float
    candidate: Candidate
    """The result's `best` if it is chosen."""
    stage: StageName
    """Where it was first simulated."""


@dataclass(frozen=True)
class WorkflowResult:
    """The result of a workflow, with or without a valid machine."""

    workflow: str
    best: Candidate | None
    """Highest score of all stages; if tied, the earlier stage, then the lower trajectory."""
    best_stage: StageName | None
    stages: tuple[Stage, ...]
    stopped: Literal["budget", "greatest score"] | None
    """Why it ended early, if it did; `greatest score` if a search ended because of it."""
    reason: str
    """Why there is no best machine; empty if there is one."""
    front: tuple[tuple[Machine, Evaluation], ...] = ()
    """The Pareto front of all simulated machines, the highest robust score first; empty unless the
    objective is `pareto`."""
    lessons: tuple[str, ...] = ()
    """What the search found out, one sentence each, for other runs at the task."""
    makers: tuple[Maker, ...] = ()
    """Empty unless one search dealt the budget of the whole run."""
    finalists: tuple[Finalist, ...] = ()
    """The machines of such a search with the highest scores, the best first; empty with other
    objectives than the score."""


PASS = 1.0
"""Lowest score that counts as a success."""


def stage_row(stage: Stage) -> dict[str, Any]:
    """The stage as one row of the table, over all trajectories of the run.

    `mean`, `max` and `std` (of the population) are over the valid machines; `mean_all` counts
    invalid ones as 0; neither includes failed simulations. They are None without machines.
    `parsed_first`, `spatial_first` and `valid_first` count first attempts (in the feedback loop,
    the first of each search), `valid` counts machines after the retries. `tools` is there if
    tools were called.
    """
    candidates = stage.candidates
    valid = [c.score for c in candidates if c.valid and c.score is not None]
    invalid = [0.0 for c in candidates if not c.valid]
    return {
        "name": stage.name,
        "trajectories": len(candidates),
        "parsed_first": sum(c.first.parsed for c in candidates),
        "spatial_first": sum(c.first.spatial for c in candidates),
        "valid_first": sum(c.first.valid for c in candidates),
        "valid": sum(c.valid for c in candidates),
        "mean": statistics.fmean(valid) if valid else None,
        "mean_all": statistics.fmean(valid + invalid) if valid or invalid else None,
        "max": max(valid, default=None),
        "std": statistics.pstdev(valid) if valid else None,
        "calls": stage.calls,
        "tokens": stage.tokens,
        "rollouts": stage.rollouts,
        "expansions": sum(c.search_cost.expansions for c in candidates),
        "attempts": sum(c.search_cost.attempts for c in candidates),
        "children": sum(c.search_cost.valid for c in candidates),
        **({"tools": stage.tools} if stage.tools else {}),
    }


def count_passes(stage: Stage) -> dict[str, Any]:
    """Number of attempts of a stage that parsed, were spatially valid, and passed.

    An attempt passes with a score of at least 1, which is what pass-or-fail tasks give for a
    success. Attempts whose simulation failed are not counted.
    """
    scored = [c for c in stage.candidates if not c.valid or c.score is not None]
    count = sum(c.valid and c.score is not None and c.score >= PASS for c in scored)
    return {
        "attempts": len(scored),
        "parsed": sum(c.first.parsed for c in scored),
        "spatial": sum(c.first.spatial for c in scored),
        "passes": count,
        "share": count / len(scored) if scored else None,
    }


def find_best(stages: tuple[Stage, ...]) -> tuple[Candidate, Stage] | None:
    """The valid machine with the highest reward, the earliest if tied; None without one."""
    best: tuple[Candidate, Stage] | None = None
    for stage in stages:
        for candidate in stage.survivors:
            found, earlier = candidate.evaluation, best and best[0].evaluation
            if candidate.reward is None or found is None:
                continue
            if earlier is None or is_better(found, earlier):
                best = candidate, stage
    return best


def pareto_front(
    found: Iterable[tuple[Machine, Evaluation]],
) -> tuple[tuple[Machine, Evaluation], ...]:
    """The machines that no other dominates, by falling reward; none without objectives."""
    compared = [(machine, result) for machine, result in found if result.objectives]
    fronts = ranks([result.objectives or () for _, result in compared])
    first = [pair for pair, front in zip(compared, fronts, strict=True) if front == 1]
    return tuple(sorted(first, key=lambda pair: (-(pair[1].reward or 0.0), pair[0].digest)))
