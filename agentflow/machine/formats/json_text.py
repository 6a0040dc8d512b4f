"""Find JSON in model replies, despite fences, comments, trailing commas and prose around it.

Never raises, and takes time linear in the length of the text. json-repair takes seconds on a few
hostile kilobytes but is quick on text that is nearly JSON, so only such text is repaired.
"""

import json
import re
from collections.abc import Iterator, Sequence
from typing import Any

MAX_PLACES = 100
"""Maximum number of fences, or bracketed regions, to try, starting from the last."""
MAX_REPAIR = 12_000
"""Maximum number of characters to repair."""
MAX_DEPTH = 32
"""Maximum nesting to repair; json-repair recurses once per level."""
MAX_EFFORT = 400_000
"""Maximum number of characters times syntax errors; json-repair may scan ahead from each error."""

_REPAIR_FAULTS = (ValueError, RecursionError, AssertionError, LookupError, TypeError)
"""Exceptions that json-repair raises, deliberately or by mistake, on hopeless text."""

_FENCE = re.compile(r"`{3,}|~{3,}")
_OPENING_LINE = re.compile(r"[^\n\[{]*")
_BRACKET = re.compile(r"[\[\]{}]")
_TOKEN = re.compile(
    r"""(?P<space>\s+)
    |(?P<comment>//[^\n]*|\#[^\n]*)
    |(?P<mark>[\[\]{}:,])
    |(?P<scalar>"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*'|[\w.+-]+)
    |(?P<junk>["'](?:[^"'\\\n]|\\.)*|.)""",
    re.VERBOSE,
)


def extract_json(
    text: str, kind: type[list[Any]] | type[dict[str, Any]]
) -> tuple[Any | None, bool]:
    """The best JSON list or object in a reply, or None, and whether it was repaired."""
    return next(iter_json(text, kind), (None, False))


def iter_json(
    text: str, kind: type[list[Any]] | type[dict[str, Any]]
) -> Iterator[tuple[Any, bool]]:
    """All JSON lists or objects in a reply, best first, each with whether it was repaired.

    Fenced values come before those in plain text, then strictly parsed before repaired ones, then
    later before earlier ones. If the whole reply is JSON, it is the only candidate.
    """
    if text.lstrip()[:1] in ("[", "{"):
        is_json, value = _strict(text)
        if is_json:
            if isinstance(value, kind):
                yield value, False
            return
    budget = MAX_REPAIR
    for places in (_fenced(text), _bracketed(text, "[" if kind is list else "{")):
        places = places[: -MAX_PLACES - 1 : -1]
        for place in places:
            is_json, value = _strict(place)
            if is_json and isinstance(value, kind):
                yield value, False
        for place in places:
            near_json = _strip_comments(place) if len(place) <= budget else None
            if near_json is not None:
                budget -= len(near_json)
                value = _repair(near_json)
                if isinstance(value, kind) and value:
                    yield value, True


def _fenced(text: str) -> list[str]:
    """Contents of all fences in order; an unclosed last fence extends to the end."""
    marks = list(_FENCE.finditer(text))
    contents = []
    for opening, closing in zip(marks[::2], [*marks[1::2], None], strict=False):
        content = text[opening.end() : closing.start() if closing else len(text)]
        info = _OPENING_LINE.match(content)
        contents.append(content[info.end() :] if info else content)
    return contents


def _bracketed(text: str, bracket: str) -> list[str]:
    """Outermost regions that open with this bracket, including an unclosed last one."""
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
    """Whether the text is JSON that Python can parse, and its value."""
    try:
        return True, json.loads(text)
    except (ValueError, RecursionError):
        return False, None


def _repair(text: str) -> Any:
    """The value that json-repair reads from the text; None if it fails."""
    from json_repair import repair_json  # slow to import and rarely needed

    try:
        return repair_json(text, return_objects=True, skip_json_loads=True)
    except _REPAIR_FAULTS:
        return None


def _strip_comments(text: str) -> str | None:
    """The text without comments; None if it is too far from JSON to be worth repairing."""
    if len(text) > MAX_REPAIR:
        return None
    tokens = [match for match in _TOKEN.finditer(text) if match.lastgroup != "comment"]
    if len(text) * _count_errors(tokens) > MAX_EFFORT:
        return None
    return "".join(match.group() for match in tokens)


def _count_errors(tokens: Sequence[re.Match[str]]) -> int:
    """Number of syntax errors: stray words, missing commas, ...

    Single quotes, unquoted words and trailing commas are free; junk counts five because it misleads
    json-repair most. Nesting deeper than `MAX_DEPTH` counts as more than `MAX_EFFORT`.
    """
    count = 0
    opened: list[str] = []
    expected = "value"
    for match in tokens:
        token, kind = match.group(), match.lastgroup
        in_object = opened[-1:] == ["{"]
        if kind == "space":
            continue
        if kind != "mark":
            count += 5 if kind == "junk" else expected in ("colon", "after")
            expected = "after" if expected == "value" or not in_object else "colon"
        elif token in "[{":
            count += expected != "value"
            opened.append(token)
            expected = "key" if token == "{" else "value"
        elif token in "]}":
            count += expected == "colon" or (in_object and expected == "value")
            count += not opened or opened.pop() + token not in ("[]", "{}")
            expected = "after"
        else:
            count += expected != ("after" if token == "," else "colon")
            expected = "value" if token == ":" or not in_object else "key"
        if len(opened) > MAX_DEPTH:
            return MAX_EFFORT + 1
    return count + len(opened)
