"""Owns what metrics take from a run's events: candidates, expansions, nodes.

One pass over the events; what is computed of it is the other modules'.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from agentflow.runs import Event

INITIAL, BLIND, FEEDBACK = "initial", "blind_refinement", "env_feedback"
STAGES = (INITIAL, BLIND, FEEDBACK)
OTHER = "other"
"""Stage of a call whose label belongs to none of the three."""
_STAGE_OF = {
    "meta_designer": INITIAL,
    "designer": INITIAL,
    "placer": INITIAL,
    "inspector": BLIND,
    "querier": FEEDBACK,
    "refiner/blind": BLIND,
    "refiner/feedback": FEEDBACK,
}


def stage_of(label: str) -> str:
    """The stage that a call belongs to, by its label ("refiner/blind/traj-1/attempt-1")."""
    role, _, rest = label.partition("/")
    return _STAGE_OF.get(role) or _STAGE_OF.get(f"{role}/{rest.partition('/')[0]}", OTHER)


@dataclass(frozen=True)
class CandidateRecord:
    """What one trajectory had to show at the end of a stage."""

    stage: str
    trajectory: int
    valid: bool
    """Whether there was a machine that could be simulated, after all retries."""
    score: float | None
    """None when there was none, or when the computer failed at simulating it."""
    parsed_first: bool
    """Of the first attempt: the reply had the demanded format ..."""
    spatial_first: bool
    """... its machine was spatially valid ..."""
    valid_first: bool
    """... and it was what was asked for in every respect."""
    machine: str | None
    """Content hash."""
    reason: str
    """Why it is invalid; empty when it is valid."""


@dataclass(frozen=True)
class ExpansionRecord:
    """One expansion of a search."""

    trajectory: int
    round: int
    attempts: int
    children: int
    """Valid attempts; each is a new node. A parent fallen back to is none."""


@dataclass(frozen=True)
class NodeRecord:
    """One node of a search tree but the root. Ids count from 1 in order of creation."""

    trajectory: int
    id: int
    round: int
    parent: int
    machine: str
    valid: bool
    score: float | None


@dataclass
class RunRecord:
    """The events of one run by kind, in order."""

    candidates: list[CandidateRecord] = field(default_factory=list)
    expansions: list[ExpansionRecord] = field(default_factory=list)
    nodes: list[NodeRecord] = field(default_factory=list)

    @classmethod
    def of(cls, events: Iterable[Event]) -> RunRecord:
        """Sort a run's events; kinds that no metric needs are passed over."""
        record = cls()
        for event in events:
            record.add(event)
        return record

    def add(self, event: Event) -> None:
        """Take in one event."""
        if event.kind == "candidate":
            self.candidates.append(_candidate(event))
        elif event.kind == "expand":
            self.expansions.append(_expansion(event))
        elif event.kind == "node":
            self.nodes.append(_node(event))

    def stage(self, name: str) -> list[CandidateRecord]:
        """The candidates of one stage, by trajectory."""
        return [item for item in self.candidates if item.stage == name]


def _candidate(event: Event) -> CandidateRecord:
    data = event.data
    first: Mapping[str, Any] = data["first"]
    return CandidateRecord(
        stage=event.label.partition("/")[0],
        trajectory=data["trajectory"],
        valid=data["valid"],
        score=data["score"],
        parsed_first=first["parsed"],
        spatial_first=first["spatial"],
        valid_first=first["valid"],
        machine=data["machine"],
        reason=data["reason"],
    )


def _expansion(event: Event) -> ExpansionRecord:
    _, trajectory, round_ = event.label.split("/")
    attempts = event.data["attempts"]
    children = sum(item["valid"] for item in attempts)
    return ExpansionRecord(_number(trajectory), _number(round_), len(attempts), children)


def _node(event: Event) -> NodeRecord:
    _, trajectory, node = event.label.split("/")
    data = event.data
    return NodeRecord(
        trajectory=_number(trajectory),
        id=_number(node),
        round=data["round"],
        parent=data["parent"],
        machine=data["machine"],
        valid=data["valid"],
        score=data["score"],
    )


def _number(part: str) -> int:
    """The number in "traj-3"."""
    return int(part.rpartition("-")[2])
