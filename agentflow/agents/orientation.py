"""Scores an inspector's sense of orientation against the true geometry; only recorded."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from agentflow.machine.geometry.placement import Geometry

TIE = 1e-6
"""Distance within which two blocks count as reaching equally far, m."""
AXES: Mapping[str, str] = {"x+": "right", "y+": "up", "z+": "forward"}
"""Axis -> direction in which it points."""
DIRECTIONS: Mapping[str, str] = {
    **dict.fromkeys(("right", "rightward", "rightwards"), "right"),
    **dict.fromkeys(("left", "leftward", "leftwards"), "left"),
    **dict.fromkeys(("up", "upward", "upwards", "top"), "up"),
    **dict.fromkeys(("down", "downward", "downwards", "bottom"), "down"),
    **dict.fromkeys(("forward", "forwards", "front", "ahead"), "forward"),
    **dict.fromkeys(("backward", "backwards", "back", "rear", "behind"), "backward"),
}
"""Word in a reply -> direction."""
EXTREMES: Mapping[str, tuple[int, int]] = {
    "frontmost": (2, 1),
    "rearmost": (2, -1),
    "leftmost": (0, -1),
    "rightmost": (0, 1),
    "topmost": (1, 1),
    "lowest": (1, -1),
}
"""Question -> axis index and sign of the direction in which to compare the blocks' reach."""
_KEY = re.compile(
    r"(?<![\w+-])([xyz]\+|" + "|".join(EXTREMES) + r")[\"'*`_\])]{0,4} ?[:=]", re.IGNORECASE
)
_WORD = re.compile(r"[a-z]+")
ID_LIST = re.compile(r"\d{1,6}(?:(?:, and |,| and |/) ?\d{1,6})*")
"""Block ids in a row: "3", "3, 4", "3, 4 and 5"."""
_NUMBER = re.compile(r"\d{1,6}")


def read_orientation(text: str) -> dict[str, Any]:
    """Read the answers: "key: value" pairs, one per line or in a JSON object.

    Returns:
        Axis -> direction and extreme -> list of block ids, for the keys found. The first answer
        counts if there are several.
    """
    keys = list(_KEY.finditer(text))
    answers: dict[str, Any] = {}
    for match, end in zip(keys, [*(key.start() for key in keys[1:]), len(text)], strict=False):
        value = text[match.end() : min(end, match.end() + 200)].lstrip("[ \r\n\t")
        value = value.partition("\n")[0]
        key = match[1].lower()
        answer = _direction(value) if key in AXES else _find_ids(value)
        if answer:
            answers.setdefault(key, answer)
    return answers


def _find_ids(text: str) -> list[int]:
    """The first list of block ids in a text."""
    match = ID_LIST.search(text)
    return [int(number) for number in _NUMBER.findall(match[0])] if match else []


def _direction(text: str) -> str:
    words = (DIRECTIONS.get(word, "") for word in _WORD.findall(text.lower()))
    return next(filter(None, words), "")


def extreme_blocks(geometry: Geometry) -> dict[str, tuple[int, ...]]:
    """Extreme -> ids of the blocks whose boxes reach farthest, including ties."""
    boxes = [block for block in geometry.blocks if not block.two_ended]
    found = {}
    for question, (axis, sign) in EXTREMES.items():
        reach = {
            block.id: sign * (block.box_max if sign > 0 else block.box_min)[axis] for block in boxes
        }
        limit = max(reach.values()) - TIE
        found[question] = tuple(block for block, value in reach.items() if value >= limit)
    return found


def orientation_score(answers: Mapping[str, Any], geometry: Geometry) -> float:
    """Share of the nine questions answered correctly, 0 to 1.

    The answer for an extreme is correct if it names blocks and all of them reach farthest.
    """
    right: int = sum(answers.get(axis) == word for axis, word in AXES.items())
    for question, blocks in extreme_blocks(geometry).items():
        named = answers.get(question) or []
        right += bool(named) and set(named) <= set(blocks)
    return right / (len(AXES) + len(EXTREMES))
