"""Owns the XML-like sections in which inspectors, queriers and refiners answer (spec 4.4).

What stands in a section is its role's business.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

_TAG = re.compile(r"<(/?)([^<>\n]{1,80})>")


@dataclass(frozen=True)
class _Tag:
    name: str
    closing: bool
    start: int
    end: int


def sections(text: str, names: Iterable[str]) -> dict[str, str]:
    """Find the named sections of a reply; never raises, linear in the length of the text.

    Tags may have any letter case, and spaces, underscores or hyphens between words. A section
    that is not closed ends at the next known tag, or with the text. Of several with one name the
    last closed one counts, of several unclosed ones the last. Everything outside is ignored.

    Args:
        text: the whole reply.
        names: the names to look for, as they are to appear in the result.

    Returns:
        Name to stripped content, only for names that were found.
    """
    known = {_key(name): name for name in names}
    closed: dict[str, str] = {}
    unclosed: dict[str, str] = {}
    next_open: dict[str, int] = {}
    next_close: dict[str, int] = {}
    next_tag = len(text)
    for tag in reversed(_tags(text, known)):
        if tag.closing:
            next_close[tag.name] = tag.start
        else:
            close = next_close.get(tag.name)
            if close is not None and close < next_open.get(tag.name, len(text)):
                closed.setdefault(tag.name, text[tag.end : close].strip())
            else:
                unclosed.setdefault(tag.name, text[tag.end : next_tag].strip())
            next_open[tag.name] = tag.start
        next_tag = tag.start
    return {**unclosed, **closed}


def _tags(text: str, known: dict[str, str]) -> list[_Tag]:
    return [
        _Tag(known[key], match[1] == "/", match.start(), match.end())
        for match in _TAG.finditer(text)
        if (key := _key(match[2])) in known
    ]


def _key(name: str) -> str:
    return " ".join(re.split(r"[\s_-]+", name.strip().strip("/"))).strip().casefold()
