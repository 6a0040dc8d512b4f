"""Owns the repetition of a finished run from its record, and the comparison of the two."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from agentflow.app.design.conduct import Plan, answer, changed, conduct
from agentflow.app.design.models import replaying
from agentflow.app.design.remarks import REMARK, Say
from agentflow.app.design.results import finished
from agentflow.config.run import build
from agentflow.llm.wrappers.tape import Tape
from agentflow.runs import Event, read_document, read_events


def replay(path: Path, say: Say) -> str | None:
    """Run a finished run again from its record and compare every event and the result.

    Returns:
        None when identical, else the first difference.

    Raises:
        RunError: The run is unfinished or damaged.
        ReplayMissError: A request was not recorded.
    """
    document = read_document(path)
    recorded = finished(path)
    plan = Plan.of(build(document.get("config")))
    other = changed(plan, document)
    if other:
        say(f"{path} was made with other {other}, so differences are to be expected")
    memory = Memory()
    with Tape(path / "calls.jsonl", say, writable=False) as tape:
        models = replaying(plan.config, tape, budget_spent=recorded["stopped"] == "budget")
        outcome = asyncio.run(conduct(plan, models, memory))
    return first_difference(read_events(path), memory.events) or _result_differs(
        recorded, answer(plan, outcome)
    )


@dataclass
class Memory:
    """A record in memory."""

    events: dict[tuple[str, str], Mapping[str, Any]] = field(default_factory=dict)

    def event(self, kind: str, label: str, **data: Any) -> None:
        """Keep one event as it would be read back from a file."""
        self.events[kind, label] = json.loads(json.dumps(data))

    def save_machine(self, digest: str, text: str) -> None:
        """Machines are in the events by digest; that is enough to compare."""


def first_difference(
    recorded: Iterable[Event], repeated: Mapping[tuple[str, str], Mapping[str, Any]]
) -> str | None:
    """The first recorded event that the repetition lacks or has otherwise; then what is new."""
    rest = dict(repeated)
    for event in recorded:
        if event.kind == REMARK:
            continue
        again = rest.pop((event.kind, event.label), None)
        if again is None:
            return f"{event.kind} {event.label}: recorded, but not in the repetition"
        if again != event.data:
            key = next(k for k in {**event.data, **again} if event.data.get(k) != again.get(k))
            return (
                f"{event.kind} {event.label}: {key} was {event.data.get(key)!r}, "
                f"is now {again.get(key)!r}"
            )
    if rest:
        kind, label = next(iter(rest))
        return f"{kind} {label}: in the repetition, but not recorded"
    return None


def _result_differs(recorded: Mapping[str, Any], again: Mapping[str, Any]) -> str | None:
    for key, value in json.loads(json.dumps(again)).items():
        if recorded.get(key) != value:
            return f"result: {key} was {recorded.get(key)!r}, is now {value!r}"
    return None
