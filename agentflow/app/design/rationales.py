"""Rationales of an earlier run, which designers follow instead of writing their own."""

from __future__ import annotations

from pathlib import Path

from agentflow.agents.designer import Designer, extract_rationale
from agentflow.config.run import DesignConfig
from agentflow.errors import RunError
from agentflow.llm.wrappers.record import CallLog
from agentflow.runs import read_document
from agentflow.runs.events import AttemptEvent, read_typed_events


def with_rationales(config: DesignConfig) -> DesignConfig:
    """The configuration with the rationales of the run in `rationale_from` stored in it."""
    if config.rationale_from is None or config.settings.rationales:
        return config
    plans = rationales_of(Path(config.rationale_from))
    settings = config.settings.model_copy(update={"rationales": plans})
    return config.model_copy(update={"settings": settings})


def rationales_of(path: Path) -> tuple[str, ...]:
    """Rationales of a run's accepted designs, one text per trajectory that has one.

    Each text covers the trajectory's structures in build order.

    Raises:
        RunError: The run cannot be read, or no design of it was accepted.
    """
    read_document(path)
    accepted = {
        event.label: event.location
        for event in read_typed_events(path)
        if isinstance(event, AttemptEvent) and event.role == Designer.name and event.valid
    }
    plans: dict[int, dict[int, str]] = {}
    with CallLog(path / "calls.jsonl", lambda _line: None, writable=False) as call_log:
        for entry in call_log.calls():
            location = accepted.get(entry.request.label)
            if location is not None and location.trajectory:
                text = extract_rationale(entry.reply.text)
                plans.setdefault(location.trajectory, {}).setdefault(location.structure, text)
    texts = tuple("\n".join(plan[n] for n in sorted(plan)) for _, plan in sorted(plans.items()))
    if not any(texts):
        raise RunError(f"{path} contains no rationale: none of its designs was accepted")
    return tuple(filter(None, texts))
