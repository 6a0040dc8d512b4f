"""Cuts a session at pauses and actions into episodes, with what was said when, and says which
labels each may have."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.resources import files
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Literal

import yaml
from pydantic import BaseModel

from agentflow.errors import UsageError
from agentflow.files.atomic import os_errors
from agentflow.study.session import IDLE, Action, Pause, Session, StudioTest

_TIME = r"(?:(\d+):)?(\d\d):(\d\d)[.,](\d{3})"
_CUE = re.compile(rf"\s*{_TIME}\s+-->\s+{_TIME}")
_TAG = re.compile(r"<[^<>]*>")


class Utterance(BaseModel, frozen=True, extra="forbid"):
    """Something that was said."""

    begin: float
    """Seconds since the start of the session."""
    end: float
    text: str


def read_transcript(file: Path, shift: float = 0.0) -> tuple[Utterance, ...]:
    """The utterances of a transcript in the order of time; notes and tags are left out.

    Args:
        file: In either format.
        shift: Seconds of the session at which the times of the transcript begin.

    Raises:
        UsageError: It cannot be read, or has no times.
    """
    try:
        with os_errors(f"cannot read {file}", UsageError):
            text = file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise UsageError(f"{file} is not a transcript: expected text in UTF-8") from None
    found = [one for block in re.split(r"\n\s*\n", text) if (one := _read_cue(block, shift))]
    if not found:
        raise UsageError(
            f"{file} has no line like 00:01:02.500 --> 00:01:04.000; export the transcript with "
            "times, as WebVTT (.vtt) or SubRip (.srt)"
        )
    return tuple(sorted((one for one in found if one.text), key=lambda one: one.begin))


def _read_cue(block: str, shift: float) -> Utterance | None:
    lines = block.splitlines()
    for number, line in enumerate(lines):
        if timing := _CUE.match(line):
            said = " ".join(_TAG.sub("", part).strip() for part in lines[number + 1 :])
            begin, end = (shift + _seconds(timing.groups()[i : i + 4]) for i in (0, 4))
            return Utterance(begin=begin, end=max(begin, end), text=said.strip())
    return None


def _seconds(parts: tuple[str | None, ...]) -> float:
    hours, minutes, seconds, thousandths = (int(part or 0) for part in parts)
    return 3600 * hours + 60 * minutes + seconds + thousandths / 1000


def words_in(said: Iterable[Utterance], begin: float, end: float) -> str:
    """What somebody began to say from one time until before another, s; a line per utterance."""
    return "\n".join(one.text for one in said if begin <= one.begin < end)


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
