"""The result of a run, and its file result.json, which completes the run."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeInt,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)

from agentflow.errors import RunError
from agentflow.files.atomic import write_file
from agentflow.files.documents import read_object
from agentflow.holding import Holding
from agentflow.runs.reading import RESULT, state_of

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

Count = NonNegativeInt
Number = Annotated[float, Field(allow_inf_nan=False)]
BUDGET = "budget"
"""Why a run stopped if its limit of calls, tokens or money was reached."""


class _Part(BaseModel):
    """Part of a result. Files of other versions may hold more keys, which are kept."""

    model_config = ConfigDict(frozen=True, strict=True, extra="allow")


class ToolUse(_Part):
    """How often a tool was called in a stage."""

    calls: Count
    refused: Count


class StageResult(_Part):
    """A row of the stage table; see `workflows.statistics.stage_row`."""

    name: str
    trajectories: Count
    parsed_first: Count | None = None
    spatial_first: Count | None = None
    valid_first: Count
    valid: Count
    mean: Number | None
    mean_all: Number | None = None
    max: Number | None
    std: Number | None = None
    calls: Count | None = None
    tokens: Count | None = None
    rollouts: Count | None = None
    expansions: Count | None = None
    attempts: Count
    children: Count
    tools: Mapping[str, ToolUse] | None = None
    """By name; None if none was called."""


class PassRate(_Part):
    """How many independent attempts passed, with Wilson's 95 % interval."""

    attempts: Count
    parsed: Count
    spatial: Count
    passes: Count
    share: Number | None
    interval: Sequence[Number] | None


class FrontMember(_Part):
    """A machine of the Pareto front.

    `machine` is a content hash, `mass` is in kg, and `required` is what the requirements of the
    task are about, in their order: the more, the better.
    """

    machine: str
    score: Number
    robust: Number
    blocks: Count
    mass: Number
    required: Sequence[Number] | None = None


class JudgedRequirement(_Part):
    """A requirement with what the best machine has; see `machine.requirements.Judged`."""

    requirement: str
    value: Number | None
    """None if it is unknown, or without limit."""
    margin: Number | None
    met: bool
    cause: str


class MakerResult(_Part):
    """What one of those who make machines in a search has made; see `workflows.base.Maker`."""

    maker: str
    machines: Count
    share: Number
    better: Count
    gain: Number


class FinalistResult(_Part):
    """A machine that was verified to choose the best one.

    `machine` is a content hash. `verified` is None if the verification is incomplete; `mean` is
    that of its scores, by which the best machine was chosen; `simulations` says what it took.
    """

    machine: str
    score: Number
    verified: Number | None
    mean: Number | None
    simulations: Count


class VariationScore(_Part):
    """The score of the best machine under one variation of the simulation."""

    variation: str
    status: str
    score: Number | None
    """None when the simulation crashed or timed out."""


class VerifiedScore(_Part):
    """The verification of the best machine; the numbers are None if it is incomplete.

    `score` is the median; the first of the `scores` is that under the default conditions.
    """

    score: Number | None
    low: Number | None
    high: Number | None
    scores: Annotated[Sequence[VariationScore], Field(min_length=1)]

    @property
    def holding(self) -> Holding | None:
        """In which simulations the score holds; None if the verification is incomplete."""
        return Holding.of_verified(self.model_dump())


def _as_a_whole(value: Any, check: ValidatorFunctionWrapHandler) -> Any:
    """Name the whole value, not its first wrong part."""
    try:
        return check(value)
    except ValidationError:
        raise ValueError("is damaged") from None


class RunFinding(_Part):
    """What a run found: the part of its result that a replay reproduces, so no times, no paths."""

    task: str
    workflow: str
    seed: int
    score: Number | None
    """Of the best machine, in the unit of the task; None without one."""
    verified: Annotated[VerifiedScore | None, WrapValidator(_as_a_whole)] = None
    valid: bool
    """Whether there is a best machine."""
    machine: list[Any] | dict[str, Any] | None
    blocks: Count | None = None
    """Of the best machine, as the task counts them."""
    most_blocks: Count | None = None
    best_stage: str | None = None
    stages: Sequence[StageResult]
    rollouts: Count
    """Simulated machines."""
    stopped: str | None
    """`budget` if the budget ended the run early, `greatest score` if reaching it did."""
    reason: str
    """Why there is no valid machine; else empty."""
    attempts: PassRate | None = None
    """Only of workflows that count passes."""
    robust: Number | None = None
    """Robust score of the best machine, if the run compared it."""
    front: Sequence[FrontMember] | None = None
    requirements: Sequence[JudgedRequirement] | None = None
    """Those of the task, if it has any, with what the best machine has."""
    finalists: Sequence[FinalistResult] | None = None
    """By falling score; only if several machines were verified to choose the best."""
    makers: Sequence[MakerResult] | None = None
    """Only of searches over the whole run."""

    @property
    def met(self) -> tuple[int, int] | None:
        """How many requirements the best machine meets, of how many; None without any."""
        judged = self.requirements or ()
        return (sum(item.met for item in judged), len(judged)) if judged else None

    @property
    def verified_score(self) -> float | None:
        """The verified score; None if there is none or the verification is incomplete."""
        return None if self.verified is None else self.verified.score

    @property
    def fragile(self) -> bool | None:
        """Whether the best machine fails under a small change; None if that is not known."""
        return None if self.holding is None else self.holding.fragile

    @property
    def holding(self) -> Holding | None:
        """In which simulations the verified score holds; None if that is not known."""
        return None if self.verified is None else self.verified.holding

    @property
    def trusted_score(self) -> float | None:
        """The verified score, or the plain one if there is no verified score."""
        return self.score if self.verified_score is None else self.verified_score

    def to_json(self) -> dict[str, Any]:
        """The content of result.json: what was given, in the order of the fields."""
        return self.model_dump(mode="json", exclude_unset=True)


class RunResult(RunFinding):
    """The content of result.json."""

    model: str
    """Name of the models, or of who designed in their place."""
    engine: str | None = None
    """Name and version of the physics engine; None in results that do not name one."""
    calls: Count
    tokens: Count
    cost: Number | None = None
    """Money, in the unit of the configured prices; None if unknown."""
    seconds: Number
    simulated_seconds: Number
    worker_seconds: Number
    """Time that workers spent on simulations."""
    run: str
    """Path of the run directory when it was finished."""

    @model_validator(mode="after")
    def _has_what_valid_results_have(self) -> RunResult:
        if self.valid and not self.machine:
            raise ValueError("it is valid without a machine")
        if self.valid and not self.stages:
            raise ValueError("it is valid without a stage")
        return self

    def with_verification(self, found: Mapping[str, Any]) -> RunResult:
        """The same result with this verification, given as JSON data."""
        return self.model_copy(update={"verified": VerifiedScore.model_validate(found)})

    def write(self, path: Path) -> None:
        """Write result.json of the run at `path`, which completes the run."""
        write_file(path / RESULT, json.dumps(self.to_json(), indent=1) + "\n", RunError)


def read_result(path: Path) -> RunResult:
    """The result of a finished run.

    Raises:
        RunError: The run is unfinished, or the file is damaged.
    """
    try:
        content = read_object(path / RESULT)
    except FileNotFoundError:
        if state_of(path) == "running":
            raise RunError(f"{path} has no {RESULT} yet: a process is working on it") from None
        raise RunError(
            f"{path} has no {RESULT}: the run is unfinished; continue it with "
            f"agentflow design --resume {quote(str(path))}"
        ) from None
    try:
        return RunResult.model_validate(content)
    except ValidationError as error:
        raise RunError(f"{path / RESULT} is damaged: {_fault(error.errors())}") from None


def _fault(faults: Sequence[ErrorDetails]) -> str:
    """What the file lacks, or else its first wrong value, in words."""
    lacks = [_place(fault) for fault in faults if fault["type"] == "missing"]
    if lacks:
        return f"it lacks {', '.join(lacks)}"
    first = faults[0]
    if not first["loc"]:  # of the result as a whole
        return str(first["ctx"]["error"])
    return f"its {_place(first)} is {str(first['input'])[:40]!r}"


def _place(fault: ErrorDetails) -> str:
    return ".".join(map(str, fault["loc"]))
