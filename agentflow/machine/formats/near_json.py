"""Owns the question how far a text is from being JSON, so that hopeless ones are not repaired.

json-repair takes seconds on a few hostile kilobytes; on text that is nearly JSON it is quick.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

MAX_REPAIR = 12_000
"""Longest text, in characters, that is worth repairing."""
MAX_DEPTH = 32
"""Deepest nesting that is worth repairing; json-repair recurses once per level."""
MAX_EFFORT = 400_000
"""Most characters times slips: json-repair may scan ahead from each slip."""

_TOKEN = re.compile(
    r"""(?P<space>\s+)
    |(?P<comment>//[^\n]*|\#[^\n]*)
    |(?P<mark>[\[\]{}:,])
    |(?P<scalar>"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*'|[\w.+-]+)
    |(?P<junk>["'](?:[^"'\\\n]|\\.)*|.)""",
    re.VERBOSE,
)


def near_json(text: str) -> str | None:
    """The text without comments if it is nearly JSON; None if not. Time linear in its length."""
    if len(text) > MAX_REPAIR:
        return None
    tokens = [match for match in _TOKEN.finditer(text) if match.lastgroup != "comment"]
    if len(text) * _slips(tokens) > MAX_EFFORT:
        return None
    return "".join(match.group() for match in tokens)


def _slips(tokens: Sequence[re.Match[str]]) -> int:
    """How many tokens stand where JSON has no such token: stray words, missing commas, ...

    Single quotes, words without quotes and trailing commas are no slips; junk counts five, for it
    misleads json-repair most. Nesting deeper than
    `MAX_DEPTH` counts as more than `MAX_EFFORT` slips.
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
