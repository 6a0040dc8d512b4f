"""Owns where the plans come from that designers follow instead of their own: an earlier run."""

from __future__ import annotations

import re
from pathlib import Path

from agentflow.agents.designer import Designer, rationale_of
from agentflow.config.run import DesignConfig
from agentflow.errors import RunError
from agentflow.llm.wrappers.tape import Tape
from agentflow.runs import read_document, read_events

_PLACE = re.compile(r"designer/(?:structure-(\d+)/)?traj-(\d+)/")


def with_rationales(config: DesignConfig) -> DesignConfig:
    """The configuration with the plans of the run that it names, so that it needs it no more.

    Raises:
        RunError: That run cannot be read, or no design of it was accepted.
    """
    if config.rationale_from is None or config.settings.rationales:
        return config
    plans = rationales_of(Path(config.rationale_from))
    settings = config.settings.model_copy(update={"rationales": plans})
    return config.model_copy(update={"settings": settings})


def rationales_of(path: Path) -> tuple[str, ...]:
    """What the designers of a run said of the designs that were accepted, by trajectory.

    Those of a trajectory's structures follow each other in build order; trajectories without an
    accepted design are left out.

    Raises:
        RunError: The run cannot be read, or no design of it was accepted.
    """
    read_document(path)
    accepted = {
        event.label
        for event in read_events(path)
        if event.kind == "attempt" and event.data["role"] == Designer.name and event.data["valid"]
    }
    plans: dict[int, dict[int, str]] = {}
    with Tape(path / "calls.jsonl", lambda _line: None, writable=False) as tape:
        for entry in tape.calls():
            place = _PLACE.match(entry.request.label)
            if place and entry.request.label in accepted:
                said = rationale_of(entry.reply.text)
                plans.setdefault(int(place[2]), {}).setdefault(int(place[1] or 0), said)
    texts = tuple("\n".join(plan[n] for n in sorted(plan)) for _, plan in sorted(plans.items()))
    if not any(texts):
        raise RunError(f"{path} holds no rationale: no design of it was accepted")
    return tuple(filter(None, texts))
