"""Scorecards: the result of a benchmark in one sealed file."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import fmean
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, ValidationError

from agentflow.errors import RunError
from agentflow.files.atomic import os_errors, write_output
from agentflow.files.documents import break_seal, holds, require_schema, sealed
from agentflow.files.faults import locate_fault
from agentflow.files.lines import parse_object
from agentflow.metrics.intervals import Interval, bootstrap_mean

NAME = "card.json"
SCHEMA = 1
DIGITS = 6
"""Decimals of scores and shares in cards."""

Outcome = Literal[
    "scored", "invalid", "diverged", "simulation_failed", "unverified", "stopped", "missing"
]
"""scored; invalid: no valid machine, share 0; diverged: the machine made the simulation fail, score
0; simulation_failed: it timed out or crashed; unverified: some verifying simulation did; stopped:
the budget of calls, tokens or money ran out; missing: the run failed or is unfinished, mostly
because of the endpoint. The last four say nothing about the model: the item gets no share."""
Number = Annotated[float, Field(allow_inf_nan=False)]


class _Part(BaseModel, frozen=True, extra="forbid"):
    """Base class: frozen, no unknown keys."""


class Mean(_Part):
    """A mean share of the full score, with its 95 % bootstrap interval."""

    mean: Number | None
    """None if nothing counts."""
    interval: Interval | None = None
    """None for fewer than two values, or without scipy."""

    @classmethod
    def of(cls, shares: Iterable[float | None]) -> Mean:
        """The mean of the shares that are known."""
        known = [share for share in shares if share is not None]
        found = bootstrap_mean(known)
        ends = found and Interval(round(found.low, DIGITS), round(found.high, DIGITS))
        return cls(mean=round(fmean(known), DIGITS) if known else None, interval=ends)


class CountedMachine(_Part):
    """One machine that counts: a first reply, or the best machine of a refined run."""

    outcome: Outcome
    score: Number | None
    share: Number | None
    """Of the full score; None unless the outcome counts."""
    reason: str = ""
    """Why there is no score."""
    fragile: bool | None = None
    """Of a verified machine: whether it fails under some small change; None if nobody looked."""
    met: tuple[int, int] | None = None
    """Of a refined run's: how many requirements it meets, of how many; None without any."""
    machine: str = ""
    """The machine as JSON text; "" without one, and in cards of old versions."""


class ItemResult(_Part):
    """What was reached on one item."""

    item: str
    family: str
    task: str
    knobs: dict[str, Any]
    full: Number
    """Score that a share of 1 stands for: the greatest possible one, or that of the record."""
    first: tuple[CountedMachine, ...]
    """First replies, with plain scores."""
    refined: CountedMachine
    """Best machine of the refined run, with its verified score."""

    @property
    def first_share(self) -> float | None:
        """Mean share of the first replies; None if any of them does not count."""
        shares = [attempt.share for attempt in self.first]
        known = [share for share in shares if share is not None]
        return fmean(known) if known and len(known) == len(shares) else None


class Cost(_Part):
    """What a benchmark cost."""

    calls: int
    prompt_tokens: int
    completion_tokens: int
    money: Number | None
    """None if a model has no price."""
    rollouts: int


class FamilyShares(_Part):
    """Mean shares over the items of a family, or over all."""

    first: Mean
    refined: Mean


class Scorecard(_Part, populate_by_name=True):
    """A scorecard."""

    schema_version: int = Field(SCHEMA, alias="schema")
    agentflow: str
    conditions: Annotated[dict[str, Any], holds("version", "lite", "engine")]
    """What cards must share to be comparable; see `plan.conditions`."""
    digest: str
    """Hash of the conditions."""
    model: str
    """Name in results, for example "procedural (no language model)"."""
    sampling: dict[str, Any]
    made: str
    """Day, UTC."""
    complete: bool
    """Whether every item has its shares."""
    total: FamilyShares
    families: dict[str, FamilyShares]
    items: tuple[ItemResult, ...]
    cost: Cost
    isolated: bool | None = None
    """Whether agent programs ran isolated, all of them; None without any."""

    @property
    def fragile(self) -> int | None:
        """Number of items whose best machine is fragile; None if nobody looked."""
        known = [item.refined.fragile for item in self.items if item.refined.fragile is not None]
        return sum(known) if known else None

    @property
    def holds_machines(self) -> bool:
        """Whether it can be checked: cards of old versions cannot."""
        return any(one.machine for item in self.items for one in (*item.first, item.refined))

    @property
    def missing(self) -> tuple[str, ...]:
        """Items without one of their shares."""
        return tuple(item.item for item in self.items if not is_counted(item))


def is_counted(item: ItemResult) -> bool:
    """Whether an item has both shares."""
    return item.first_share is not None and item.refined.share is not None


def summary(items: Sequence[ItemResult]) -> FamilyShares:
    """Mean shares over items."""
    return FamilyShares(
        first=Mean.of(item.first_share for item in items),
        refined=Mean.of(item.refined.share for item in items),
    )


def write_card(path: Path, card: Scorecard) -> None:
    """Write a card, sealed."""
    content = card.model_dump(mode="json", by_alias=True)
    with write_output(path) as part:
        part.write_text(json.dumps(sealed(content), indent=1) + "\n", encoding="utf-8")


def read_card(path: Path) -> Scorecard:
    """Read a card.

    Raises:
        RunError: It cannot be read, is not a card, is of another version, lacks something, or was
            edited.
    """
    again = "make it again with: agentflow benchmark"
    with os_errors(f"cannot read {path}"):
        content = parse_object(path.read_bytes())
    if content is None or "schema" not in content:
        raise RunError(
            f"{path} is not a scorecard: expected the {NAME} that agentflow benchmark writes"
        )
    require_schema(path, content, SCHEMA, otherwise=f", or {again}")
    whole = break_seal(content)
    try:
        card = Scorecard.model_validate(content)
    except ValidationError as error:
        told = " ".join(locate_fault(error, "the file"))
        raise RunError(f"{path} is damaged: {told}; {again}") from None
    if not whole:
        raise RunError(f"{path} was edited after it was written; restore it, or {again}")
    return card
