"""Cuts a session at pauses and actions into episodes, and says which labels each may have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from itertools import groupby
from operator import itemgetter
from typing import Literal

import yaml
from pydantic import BaseModel

from agentflow.study.session import IDLE, Action, Pause, Session, StudioTest
from agentflow.study.transcript import Utterance

Coarse = Literal["building", "testing", "looking", "asking", "talking", "pause", "break"]
"""What goes on, as the record shows it without interpretation. A break stops the clock."""
Label = Literal[
    "Plan", "Hypothesize", "Build", "Test", "Observe", "Diagnose", "Revise", "Restructure",
    "Reflect", "Query",
]  # fmt: skip

_KNOWN = yaml.safe_load((files(__package__) / "labels.yaml").read_text("utf-8"))
MEANING: Mapping[Label, str] = _KNOWN["meaning"]
"""Label -> what the person does."""
ALLOWED: Mapping[Coarse, tuple[Label, ...]] = {
    coarse: tuple(labels) for coarse, labels in _KNOWN["allowed"].items()
}
"""Coarse label -> labels that an episode may have."""

_NOT_BUILDING: Mapping[str, Coarse] = {"watch": "looking", "ask": "asking", "refine": "asking"}
"""Actions that are not building."""


class Episode(BaseModel, frozen=True, extra="forbid"):
    """A stretch of a session in which one thing goes on."""

    begin: float
    """Seconds since the start of the session."""
    end: float
    coarse: Coarse
    label: Label | None = None
    """None until it is labelled, of breaks, and where a model gave no allowed label."""

    @property
    def seconds(self) -> float:
        """How long it lasts."""
        return self.end - self.begin


def cut(session: Session, said: Sequence[Utterance]) -> list[Episode]:
    """The episodes of a session, from its start to its end without gaps.

    An episode begins where another thing begins to go on, and lasts until the next one. Pauses are
    cut further, where somebody begins to talk or has said nothing for as long as makes a pause.
    """
    begun: list[tuple[float, Coarse]] = []
    for event in session.events:
        if isinstance(event, Pause) and not event.asked:
            begun += _cut_pause(event, said)
        elif isinstance(event, Action | StudioTest | Pause):
            begun.append((event.at, _coarse(event)))
    at_once = dict(sorted(begun, key=itemgetter(0)))  # of what begins at once, the last counts
    stretches = [(next(at), coarse) for coarse, at in groupby(at_once, at_once.__getitem__)]
    bounds = [0.0, *(begin for begin, _ in stretches[1:]), session.seconds]
    return [
        Episode(begin=begin, end=end, coarse=coarse)
        for begin, end, (_, coarse) in zip(bounds, bounds[1:], stretches, strict=False)
        if end > begin
    ]


def _coarse(event: Action | StudioTest | Pause) -> Coarse:
    if isinstance(event, StudioTest):
        return "testing"
    if isinstance(event, Pause):
        return "break"
    return _NOT_BUILDING.get(event.do, "building")


def _cut_pause(pause: Pause, said: Sequence[Utterance]) -> Iterator[tuple[float, Coarse]]:
    """Where somebody begins to talk in a pause, and where silence begins."""
    heard = [one for one in said if one.begin < pause.end and one.end > pause.at]
    silent_since = pause.at
    for one in heard:
        begin = max(one.begin, pause.at)
        if begin - silent_since >= IDLE:
            yield silent_since, "pause"
            yield begin, "talking"
        else:
            yield silent_since, "talking"
        silent_since = max(silent_since, one.end)
    if not heard or pause.end - silent_since >= IDLE:
        yield silent_since, "pause"
