"""A session as a page replays it: what happened when, and which machine was there then."""

from __future__ import annotations

from typing import Any

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
    "watch": "looked at a trial",
    "ask": "looked something up",
    "undo": "undid a step",
    "redo": "redid a step",
}
_ON_BLOCKS = {"add", "remove", "move", "turn", "copy", "mirror"}
_ENDED = {"finished": "finished", "time": "the time was up", "left": "the studio was closed"}


def replay_data(session: Session) -> dict[str, Any]:
    """Start, length (s), and every event with its words and the machine after it, by hash."""
    machine = session.machine(session.start).digest
    events = []
    for event in session.events:
        if isinstance(event, Action | StudioTest):
            machine = session.machine(event).digest
        told = {"at": event.at, "end": event.end, "text": _told(event), "machine": machine}
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


def _told(event: Event) -> str:
    if isinstance(event, Action):
        kind = library().get(-1 if event.type is None else event.type)
        named = f" block {event.block}, {kind.name}" if kind else ""
        return f"{_DONE[event.do]}{named or ' a block' * (event.do in _ON_BLOCKS)}"
    if isinstance(event, StudioTest):
        return f"test: {event.status if event.score is None else f'{event.score:.2f}'}"
    if isinstance(event, Pause):
        return f"{'clock stopped' if event.asked else 'pause'}, {event.seconds:.0f} s"
    if isinstance(event, Note):
        return event.text
    return f"microphone: {event.file}" if isinstance(event, Audio) else _ENDED[event.reason]
