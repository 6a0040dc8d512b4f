"""Parsing of edit scripts into Add, Remove and Move commands."""

from __future__ import annotations

import re
from dataclasses import dataclass

GRAMMAR = (
    "Add [type] to [id] in [face]",
    "Add [type] to [id_a] in [face_a] to [id_b] in [face_b]",
    "Remove [id]",
    "Move [id] to [new_parent] in [new_face]",
)
"""The commands, as shown to models."""

_NUMBER = r" ?\[? ?(-?[0-9]{1,9}) ?\]? ?"
_END = f"to{_NUMBER}in{_NUMBER}"
_ADD = re.compile(f"add{_NUMBER}{_END}(?:{_END})?", re.IGNORECASE)
_REMOVE = re.compile(f"remove{_NUMBER}", re.IGNORECASE)
_MOVE = re.compile(f"move{_NUMBER}{_END}", re.IGNORECASE)
_NUMBERING = re.compile(
    r"(?:[-+•>] ?|\(?[0-9]{1,3}[.):] ?|step [0-9]{1,3} ?[.):-]? ?){0,3}", re.IGNORECASE
)


@dataclass(frozen=True)
class Add:
    """Adds a block on one face, or between two."""

    type: int
    ends: tuple[tuple[int, int], ...]
    """One or two (parent, face) pairs."""


@dataclass(frozen=True)
class Remove:
    """Removes a block."""

    id: int


@dataclass(frozen=True)
class Move:
    """Moves a block, with everything attached to it, to another face."""

    id: int
    parent: int
    face: int


Command = Add | Remove | Move


def script_lines(script: str) -> list[str]:
    """The lines that should be commands: not empty, no code fence, no `//` comment."""
    lines = (line.strip() for line in script.splitlines())
    return [line for line in lines if line and not line.startswith(("```", "~~~", "//"))]


def read_command(line: str) -> Command | None:
    """The command on a line; None if the line is not a command.

    Ignores numbering, bullets, emphasis, trailing punctuation and `//` comments.
    """
    plain = " ".join(line.partition("//")[0].replace("`", "").replace("*", "").split())
    numbering = _NUMBERING.match(plain)
    plain = plain[numbering.end() if numbering else 0 :].rstrip(" .;,")
    if match := _ADD.fullmatch(plain):
        kind, *ends = (int(digits) for digits in match.groups() if digits is not None)
        return Add(kind, tuple(zip(ends[::2], ends[1::2], strict=True)))
    if match := _REMOVE.fullmatch(plain):
        return Remove(int(match[1]))
    if match := _MOVE.fullmatch(plain):
        return Move(int(match[1]), int(match[2]), int(match[3]))
    return None
