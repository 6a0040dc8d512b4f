"""Reads answers out of replies in whatever form models write them; never raises.

Replies are data that may be anything, so every pattern is bounded and takes linear time.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, islice
from typing import Any, NamedTuple

from agentflow.machine.formats.json_text import iter_json

Pair = tuple[int, int]
"""Block ids, lower one first."""
MAX_ID = 9999
"""Greatest number that is read as a block id."""
FAR = 1e6
"""Greatest coordinate, m; infinities and NaN are none."""
CANDIDATES = 20
"""Most JSON values of a reply that are looked at."""
NESTING = 4
"""Levels of objects and lists below which pairs are looked for."""

_ID = r"(?:blocks? ?)?#?(\d{1,4})(?: ?\([A-Za-z][A-Za-z ]{0,30}\))?"
_BETWEEN = (
    r" ?(?:,|-|\u2013|/|&|:|and|with|vs\.?|<->|\u2194|overlaps(?: with)?|intersects(?: with)?) ?"
)
_WRITTEN = re.compile(rf"{_ID}{_BETWEEN}{_ID}", re.IGNORECASE)
_BRACKETED = re.compile(rf"[(\[{{] ?{_ID}{_BETWEEN}{_ID} ?[)\]}}]", re.IGNORECASE)
_LISTED = re.compile(
    rf"^[ \t]*(?:[-*+\u2022] |\d{{1,3}}[.)] )? ?{_ID}{_BETWEEN}{_ID}(?![\d.])",
    re.IGNORECASE | re.MULTILINE,
)
_JOINED = re.compile(r"(?<![\d.\-])(\d{1,4})(?:-|\u2013|&|<->|\u2194)(\d{1,4})(?![\d.\-])")
_NAMED = re.compile(
    rf"\bblock ?#?(\d{{1,4}})(?: ?\([A-Za-z][A-Za-z ]{{0,30}}\))?{_BETWEEN}"
    r"block ?#?(\d{1,4})(?![\d.])",
    re.IGNORECASE,
)
_NONE = re.compile(r"\b(?:none|no (?:blocks?|pairs?|overlap\w{0,7}))\b", re.IGNORECASE)
_AXIS = re.compile(r"[\s\"']*(?:([+-])\s?([xyz])|([xyz])\s?([+-]))", re.IGNORECASE)
_VERDICT = re.compile(
    r"\b(stand|drive|throw)s?\b[\"'*`_]{0,4} ?[:=] ?[\"'*`_]{0,4}(yes|no|true|false)\b",
    re.IGNORECASE,
)


def read_pairs(text: str) -> list[Pair] | None:
    """Pairs of block ids: a JSON list of pairs, else pairs in the prose.

    A JSON pair is a list of two ids, an object with two ids, or a text such as "3-5". In prose, it
    is two ids in brackets, else "block 3 and block 5", else "3-5", else a line that begins with two
    ids. Among several JSON lists, fenced ones count before others, then the last. Ids may be wrong,
    but not their form.

    Returns:
        Each pair once, ascending; [] if the reply says that there are none; None if it says
        nothing.
    """
    for value in _json_values(text):
        pairs = _pairs_in(value)
        if pairs is not None:
            return _unique(pairs)
    for pattern in (_BRACKETED, _NAMED, _JOINED, _LISTED):
        if written := pattern.findall(text):
            return _unique((int(a), int(b)) for a, b in written)
    return [] if _NONE.search(text) else None


def _json_values(text: str) -> Iterator[Any]:
    """Lists, then objects of a reply, best first, at most `CANDIDATES` of each."""
    for value, _ in chain(
        islice(iter_json(text, list), CANDIDATES), islice(iter_json(text, dict), CANDIDATES)
    ):
        yield value


def _pairs_in(value: Any, depth: int = 0) -> list[Pair] | None:
    """The pairs that a JSON value holds; None if it is not about pairs."""
    if (pair := _pair(value)) is not None:
        return [pair]
    if isinstance(value, list):
        pairs = [_pair(item) for item in value]
        if None not in pairs:
            return [pair for pair in pairs if pair is not None]
    if depth < NESTING and isinstance(value, Mapping):
        found = [_pairs_in(item, depth + 1) for item in value.values()]
        return max((pairs for pairs in found if pairs is not None), key=len, default=None)
    return None


def _pair(item: Any) -> Pair | None:
    """The pair that a JSON item stands for."""
    if isinstance(item, str):
        match = _WRITTEN.fullmatch(item.strip(" ()[]")[:80])
        return (int(match[1]), int(match[2])) if match else None
    if isinstance(item, Mapping):
        lists = [value for value in item.values() if isinstance(value, list)]
        return _pair(lists[0] if len(lists) == 1 else _ids(item.values()))
    if not isinstance(item, list) or len(item) != 2:
        return None
    ids = _ids(item)
    return (ids[0], ids[1]) if len(ids) == 2 else None


def _ids(values: Iterable[Any]) -> list[int]:
    """The block ids among some values."""
    return [number for number in map(_id, values) if number is not None]


def _id(value: Any) -> int | None:
    """A block id as a number, or as a text such as "3" or "block 3"."""
    if isinstance(value, str):
        match = re.fullmatch(_ID, value.strip()[:80], re.IGNORECASE)
        return int(match[1]) if match else None
    whole = isinstance(value, int) and not isinstance(value, bool)
    return value if whole and 0 <= value <= MAX_ID else None


def _unique(pairs: Iterable[Pair]) -> list[Pair]:
    return sorted({(min(pair), max(pair)) for pair in pairs})


class StatedPose(NamedTuple):
    """Where a block is and which way it faces; None for what is not said."""

    facing: str | None
    centre: tuple[float, float, float] | None


def read_poses(text: str) -> dict[int, StatedPose]:
    """Poses by block id: a JSON list of objects with `id`, `facing` and `centre`.

    Objects by id, and one object alone, are accepted as well. The first pose of a block counts.
    """
    for value in _json_values(text):
        items = list(_posed(value))
        if items:
            found: dict[int, StatedPose] = {}
            for number, item in items:
                found.setdefault(number, _pose(item))
            return found
    return {}


def _posed(value: Any) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """(block id, object) of a JSON value."""
    if isinstance(value, list):
        named = ((item.get("id", item.get("block")), item) for item in value
                 if isinstance(item, Mapping))  # fmt: skip
        pairs: Iterable[tuple[Any, Any]] = named
    elif isinstance(value, Mapping):
        lists = (_posed(item) for item in value.values() if isinstance(item, list))
        yield from chain.from_iterable(lists)
        pairs = [(value["id"], value)] if "id" in value else value.items()
    else:
        return
    for name, item in pairs:
        number = _id(name)
        if number is not None and isinstance(item, Mapping):
            yield number, item


def _pose(item: Mapping[str, Any]) -> StatedPose:
    facing = next((item[key] for key in ("facing", "faces", "orientation") if key in item), None)
    centre = next((item[key] for key in ("centre", "center", "position") if key in item), None)
    return StatedPose(_facing(facing), _point(centre))


def _facing(value: Any) -> str | None:
    match = _AXIS.match(value) if isinstance(value, str) else None
    if match is None:
        return None
    sign, axis = match[1] or match[4], match[2] or match[3]
    return f"{axis.lower()}{sign}"


def _point(value: Any) -> tuple[float, float, float] | None:
    if isinstance(value, Mapping):
        value = [value.get(axis) for axis in "xyz"]
    if not isinstance(value, list) or len(value) != 3:
        return None
    if not all(type(item) in (int, float) and abs(item) < FAR for item in value):
        return None
    x, y, z = map(float, value)
    return x, y, z


def read_verdicts(text: str) -> dict[str, bool]:
    """Yes or no for stand, drive and throw, in JSON or in lines; the last one of each counts."""
    return {verb.lower(): word.lower() in ("yes", "true") for verb, word in _VERDICT.findall(text)}
