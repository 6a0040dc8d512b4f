"""Time-stamped transcripts: what was said when, from WebVTT (.vtt) and SubRip (.srt) files."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from pydantic import BaseModel

from agentflow.errors import UsageError
from agentflow.files.atomic import os_errors

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
