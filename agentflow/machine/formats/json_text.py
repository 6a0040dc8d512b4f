"""Owns finding JSON in whatever text a model sends: fences, comments, trailing commas, prose.

What the JSON means is its reader's. Never raises, and takes time linear in the text's length.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from agentflow.machine.formats.near_json import MAX_REPAIR, near_json

Accept = Callable[[Any], bool]

MAX_PLACES = 100
"""Most fences, or bracketed regions, of a reply that are tried, the last ones first."""

_REPAIR_FAULTS = (ValueError, RecursionError, AssertionError, LookupError, TypeError)
"""What json-repair raises, by mistake too, on text that it can make nothing of."""

_FENCE = re.compile(r"`{3,}|~{3,}")
_OPENING_LINE = re.compile(r"[^\n\[{]*")
_BRACKET = re.compile(r"[\[\]{}]")


@dataclass(frozen=True)
class Extracted:
    """What was found; `value` is None when nothing was."""

    value: Any
    repaired: bool = False
    problem: str = ""
    """One sentence that the model can act on; empty when there is a value."""


def extract_json(
    text: str, kind: type[list[Any]] | type[dict[str, Any]], accept: Accept | None = None
) -> Extracted:
    """Find the JSON list or object that a reply holds (spec 4.4).

    The last fence that holds one counts; where no fence does, the last one in the text itself.
    Repair is tried only after strict parsing has failed everywhere.

    Args:
        text: any text whatever.
        kind: `list` or `dict`.
        accept: further condition on the value; what it refuses is passed over.
    """
    for value, repaired in found_json(text, kind):
        if accept is None or accept(value):
            return Extracted(value, repaired)
    what = "list" if kind is list else "object"
    return Extracted(
        None, problem=f"no JSON {what} found; write it in full inside one ```json fence"
    )


def found_json(
    text: str, kind: type[list[Any]] | type[dict[str, Any]]
) -> Iterator[tuple[Any, bool]]:
    """All values of the kind, best first, each with whether it was repaired."""
    seen_whole = False
    if text.lstrip()[:1] in ("[", "{"):
        seen_whole, value = _strict(text)
        if seen_whole and isinstance(value, kind):
            yield value, False
    if seen_whole:
        return
    budget = MAX_REPAIR
    for places in (_fenced(text), _bracketed(text, "[" if kind is list else "{")):
        places = places[: -MAX_PLACES - 1 : -1]
        for place in places:
            read, value = _strict(place)
            if read and isinstance(value, kind):
                yield value, False
        for place in places:
            plain = near_json(place) if len(place) <= budget else None
            if plain is not None:
                budget -= len(plain)
                value = _repair(plain)
                if isinstance(value, kind) and value:
                    yield value, True


def _fenced(text: str) -> list[str]:
    """Contents of all fences in order; an unclosed last one reaches to the end."""
    marks = list(_FENCE.finditer(text))
    contents = []
    for opening, closing in zip(marks[::2], [*marks[1::2], None], strict=False):
        content = text[opening.end() : closing.start() if closing else len(text)]
        info = _OPENING_LINE.match(content)
        contents.append(content[info.end() :] if info else content)
    return contents


def _bracketed(text: str, bracket: str) -> list[str]:
    """Outermost bracketed regions that open with this bracket; an unclosed last one included."""
    regions = []
    depth = start = 0
    for match in _BRACKET.finditer(text):
        if match.group() in "[{":
            if depth == 0:
                start = match.start()
            depth += 1
        elif depth:
            depth -= 1
            if depth == 0:
                regions.append(text[start : match.end()])
    if depth:
        regions.append(text[start:])
    return [region for region in regions if region[0] == bracket]


def _strict(text: str) -> tuple[bool, Any]:
    """Whether it is JSON, and its value. Nesting and digits beyond Python's limits are none."""
    try:
        return True, json.loads(text)
    except (ValueError, RecursionError):
        return False, None


def _repair(text: str) -> Any:
    """What json-repair makes of it; None if nothing."""
    from json_repair import repair_json  # takes long to import, and is rarely needed

    try:
        return repair_json(text, return_objects=True, skip_json_loads=True)
    except _REPAIR_FAULTS:
        return None
