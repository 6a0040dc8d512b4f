"""A session as a page replays it: what happened when, and which machine was there then."""

from __future__ import annotations

from typing import Any

from agentflow.env.tasks.registry import known_unit
from agentflow.machine import library
from agentflow.study.session import Action, Audio, Event, Note, Pause, Session, StudioTest

_DONE = {
    "add": "added",
    "remove": "removed",
    "move": "moved",
    "turn": "turned",
    "copy": "copied",
    "mirror": "mirrored",
    "control": "changed the control",
    "open": "opened a machine",
    "new": "started over",
    "refine": "asked a model",
    "watch": "looked at a test",
    "ask": "looked something up",
    "undo": "undid a step",
    "redo": "redid a step",
}
_ON_BLOCKS = {"add", "remove", "move", "turn", "copy", "mirror"}
_ENDED = {"finished": "finished", "time": "the time was up", "left": "the studio was closed"}


def replay_data(session: Session) -> dict[str, Any]:
    """Start, length (s), and every event with its words and the machine after it, by hash."""
    machine = session.machine(session.start).digest
    unit, events = known_unit(session.start.task), []
    for event in session.events:
        if isinstance(event, Action | StudioTest):
            machine = session.machine(event).digest
        told = {"at": event.at, "end": event.end, "text": _told(event, unit), "machine": machine}
        events.append({"kind": _kind(event), **told})
    shown = {"task", "mode", "participant", "rationale", "consent"}
    return {
        **session.start.model_dump(include=shown),
        "began": session.start.began.timestamp(),
        "seconds": session.seconds,
        "machine": session.machine(session.start).digest,
        "events": events,
    }


def _kind(event: Event) -> str:
    return "break" if isinstance(event, Pause) and event.asked else event.kind


def _told(event: Event, unit: str) -> str:
    if isinstance(event, Action):
        kind = library().get(-1 if event.type is None else event.type)
        named = f" block {event.block}, {kind.name}" if kind else ""
        return f"{_DONE[event.do]}{named or ' a block' * (event.do in _ON_BLOCKS)}"
    if isinstance(event, StudioTest):
        scored = event.score is not None
        return f"test: {f'{event.score:.2f} {unit}'.strip() if scored else event.status}"
    if isinstance(event, Pause):
        return f"{'clock stopped' if event.asked else 'nothing done'}, {event.seconds:.0f} s"
    if isinstance(event, Note):
        return event.text
    return f"microphone: {event.file}" if isinstance(event, Audio) else _ENDED[event.reason]
