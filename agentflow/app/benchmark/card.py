"""Scorecards: the result of a benchmark in one sealed file."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import fmean
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, ValidationError, model_validator

from agentflow.errors import RunError
from agentflow.files.atomic import os_errors, write_output
from agentflow.files.documents import break_seal, holds, require_schema, sealed
from agentflow.files.faults import locate_fault
from agentflow.files.lines import parse_object
from agentflow.metrics.intervals import Interval, bootstrap_mean

NAME = "card.json"
SCHEMA = 2
"""Cards of schema 1, which has two parts, are read too."""
FIRST, REFINED, LONG = "first", "refined", "long"
"""Parts: single replies; the second part of schema 1; the one whose course is kept."""
PARTS = {
    FIRST: "one reply, no feedback",
    REFINED: "refined with feedback",
    "search": "search with feedback",
    "agent": "agent with tools",
    LONG: "long search",
}
"""What pages call the parts."""
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
    """A mean share, with its 95 % bootstrap interval."""

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


class Point(_Part):
    """Where the best score of a run rose, and what the run had spent by then."""

    simulations: int
    tokens: int
    money: Number | None
    """None if a model has no price."""
    share: Number
    """Of the plain score."""


class CountedMachine(_Part):
    """One machine that counts: a first reply, or the best machine of a run."""

    outcome: Outcome
    score: Number | None
    share: Number | None
    """From floor to par; None unless the outcome counts."""
    reason: str = ""
    """Why there is no score."""
    fragile: bool | None = None
    """Of a verified machine: whether it fails under some small change; None if nobody looked."""
    met: tuple[int, int] | None = None
    """Of a run's best: how many requirements it meets, of how many; None without any."""
    machine: str = ""
    """The machine as JSON text; "" without one, and in cards of old versions."""
    seed: int = 0
    """Of its run."""
    course: tuple[Point, ...] = ()
    """Of the part `long`."""
    area: Number | None = None
    """Of the part `long`: the mean share of the best machine so far, over all simulations."""


class ItemResult(_Part):
    """What was reached on one item."""

    item: str
    family: str
    task: str
    knobs: dict[str, Any]
    full: Number
    """Score that a share of 1 stands for: the par; in cards of the first benchmark, the greatest
    possible score or that of the record."""
    parts: dict[str, tuple[CountedMachine, ...]]
    """First replies, with plain scores; of other parts the best machine of each seed, with its
    verified score."""

    @model_validator(mode="before")
    @classmethod
    def _of_two_parts(cls, content: Any) -> Any:
        """Read what schema 1 says."""
        if not isinstance(content, dict) or not {FIRST, REFINED} <= content.keys():
            return content
        parts = {FIRST: content[FIRST], REFINED: [content[REFINED]]}
        return {**{k: v for k, v in content.items() if k not in parts}, "parts": parts}

    def share(self, part: str) -> float | None:
        """Mean share in a part; None if any machine does not count."""
        shares = [one.share for one in self.parts[part]]
        known = [share for share in shares if share is not None]
        return fmean(known) if known and len(known) == len(shares) else None

    def area(self, part: str) -> float | None:
        """Mean area of a part; None unless all are known."""
        areas = [one.area for one in self.parts[part] if one.area is not None]
        return fmean(areas) if areas and len(areas) == len(self.parts[part]) else None


class Cost(_Part):
    """What a benchmark cost."""

    calls: int
    prompt_tokens: int
    completion_tokens: int
    money: Number | None
    """None if a model has no price."""
    rollouts: int


Shares = dict[str, Mean]
"""Mean shares over items by part."""


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
    total: Annotated[Shares, Field(min_length=1)]
    families: dict[str, Shares]
    items: tuple[ItemResult, ...]
    cost: Cost
    isolated: bool | None = None
    """Whether agent programs ran isolated, all of them; None without any."""

    @model_validator(mode="after")
    def _has_each_part(self) -> Scorecard:
        places = [item.parts for item in self.items] + [*self.families.values()]
        if any(tuple(place) != self.parts for place in places):
            raise ValueError("its items and families have other parts than its total")
        found = {one.seed for item in self.items for its in item.parts.values() for one in its}
        if found != set(range(self.seeds)):
            raise ValueError("its seeds are not 0, 1 and so on")
        return self

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts."""
        return tuple(self.total)

    @property
    def ranked(self) -> str:
        """The part by which cards are ranked: the one after the first replies."""
        return self.parts[:2][-1]

    @property
    def seeds(self) -> int:
        """With how many seeds each part was done."""
        return len({one.seed for item in self.items for one in item.parts[self.ranked]})

    @property
    def fragile(self) -> int | None:
        """Number of items with a best machine that is fragile; None if nobody looked."""
        found = [[one.fragile for one in item.parts[self.ranked]] for item in self.items]
        known = [each for each in found if each.count(None) < len(each)]
        return sum(True in each for each in known) if known else None

    @property
    def holds_machines(self) -> bool:
        """Whether it can be checked: cards of old versions cannot."""
        return any(one.machine for item in self.items for its in item.parts.values() for one in its)

    @property
    def missing(self) -> tuple[str, ...]:
        """Items without one of their shares."""
        return tuple(item.item for item in self.items if not is_counted(item))

    def only(self, parts: Sequence[str]) -> Scorecard:
        """The card with these of its parts."""
        if self.parts == tuple(parts):
            return self
        kept = [{"parts": {part: item.parts[part] for part in parts}} for item in self.items]
        items = tuple(i.model_copy(update=k) for i, k in zip(self.items, kept, strict=True))
        return self.model_copy(update={"items": items, **summarise(items)})


def is_counted(item: ItemResult) -> bool:
    """Whether an item has its share in every part."""
    return all(item.share(part) is not None for part in item.parts)


def summary(items: Sequence[ItemResult]) -> Shares:
    """Mean shares over items; seeds of an item are resampled together."""
    return {part: Mean.of(item.share(part) for item in items) for part in items[0].parts}


def summarise(items: Sequence[ItemResult]) -> dict[str, Any]:
    """What a card says of its items as a whole: `complete`, `total` and `families`."""
    of = {item.family: [i for i in items if i.family == item.family] for item in items}
    families = {name: summary(its) for name, its in of.items()}
    complete = all(map(is_counted, items))
    return {"complete": complete, "total": summary(items), "families": families}


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
    if content["schema"] != 1:
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
