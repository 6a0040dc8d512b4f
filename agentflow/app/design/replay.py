"""Replays a finished run from its record and compares the two."""

import asyncio
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from agentflow.app.design.execution import execute, finding_of
from agentflow.app.design.notices import REMARK
from agentflow.app.design.plan import RunPlan, repetition
from agentflow.env.pool.pool import Simulator
from agentflow.env.simulation.variations import VARIATIONS, Variation
from agentflow.errors import RunError
from agentflow.llm.wrappers.record import CallLog
from agentflow.models.choices import replay_models
from agentflow.runs import Event, Notify, RunResult, read_document, read_events, read_result
from agentflow.runs.events import RunEvent, VerificationEvent, read_stage
from agentflow.runs.reading import read_machine_text
from agentflow.runs.result import BUDGET, RunFinding


def replay(path: Path, notify: Notify, pool: Simulator | None = None) -> str | None:
    """Run a finished run again from its record and compare every event and the result.

    Returns:
        None if identical, else the first difference.

    Raises:
        RunError: The run is unfinished or damaged, or was verified in another way.
        ReplayMissError: A request was not recorded.
    """
    document = read_document(path)
    recorded = read_result(path)
    plan = RunPlan.of_run(path, document)
    verified = recorded.verified is not None  # perhaps later, by `agentflow verify`
    plan = replace(plan, config=plan.config.model_copy(update={"verify": verified}))
    if changes := plan.changes_since(document):
        notify(f"{path} was made with different {changes}; expect differences")
    for note in plan.notes_on(path, document):
        notify(note)
    memory = MemoryRecord(path)
    with CallLog(path / "calls.jsonl", notify, writable=False) as call_log:
        models = replay_models(plan.config, call_log, budget_spent=recorded.stopped == BUDGET)
        execution = asyncio.run(
            execute(
                plan, models, memory, pool, repetition(path, document), repeated=_verified_in(path)
            )
        )
    return first_difference(read_events(path), memory.events) or _result_difference(
        recorded, finding_of(plan, execution)
    )


def _verified_in(path: Path) -> dict[str, list[Variation]]:
    """Which machines were verified, and under what, which other versions may choose otherwise."""
    found: dict[str, list[Variation]] = {}
    for event in read_events(path):
        if event.kind == VerificationEvent.kind:
            names = [item["variation"] for item in event.data["scores"]]
            if unknown := [name for name in names if name not in VARIATIONS]:
                raise RunError(
                    f"{path} was verified under {unknown[0]!r}, which this version does not know; "
                    "replay it with the version that made it"
                )
            found[event.data["machine"]] = [VARIATIONS[name] for name in names]
    return found


@dataclass
class MemoryRecord:
    """The record, in memory, of a run that is repeated."""

    path: Path | None = None
    """The run directory; None for a new run."""
    events: dict[tuple[str, str], Mapping[str, Any]] = field(default_factory=dict)

    def event(self, event: RunEvent) -> None:
        """Keep one event as it would be read back from a file."""
        self.events[event.kind, event.label] = json.loads(json.dumps(event.data))

    def save_machine(self, digest: str, text: str) -> None:
        """Does nothing: events hold the digest, which is enough to compare."""

    def log(self, text: bytes) -> None:
        """Does nothing: no program runs in a replay."""

    def earlier(self, stage: str) -> Sequence[RunEvent]:
        """What the run recorded in a stage."""
        return read_stage(self.path, stage) if self.path else ()

    def load_machine(self, digest: str) -> str:
        """The text of a machine of the run."""
        assert self.path is not None
        return read_machine_text(self.path, digest)


def first_difference(
    recorded: Iterable[Event], replayed: Mapping[tuple[str, str], Mapping[str, Any]]
) -> str | None:
    """The first recorded event that is missing or differs, else the first new one, in words."""
    rest = dict(replayed)
    for event in recorded:
        if event.kind == REMARK:
            continue
        again = rest.pop((event.kind, event.label), None)
        if again is None:
            return f"{event.kind} {event.label}: recorded, but missing from the replay"
        if again != event.data:
            key = next(k for k in {**event.data, **again} if event.data.get(k) != again.get(k))
            return (
                f"{event.kind} {event.label}: {key} was {event.data.get(key)!r}, "
                f"is now {again.get(key)!r}"
            )
    if rest:
        kind, label = next(iter(rest))
        return f"{kind} {label}: in the replay, but not recorded"
    return None


def _result_difference(recorded: RunResult, replayed: RunFinding) -> str | None:
    before = recorded.to_json()
    for key, value in replayed.to_json().items():
        if before.get(key) != value:
            return f"result: {key} was {before.get(key)!r}, is now {value!r}"
    return None
