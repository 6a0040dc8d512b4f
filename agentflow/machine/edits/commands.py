"""Parsing of edit scripts into commands."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

GRAMMAR = (
    "Add [type] to [id] in [face]",
    "Add [type] to [id_a] in [face_a] to [id_b] in [face_b]",
    "Remove [id]",
    "Move [id] to [new_parent] in [new_face]",
)
"""The commands, as shown to models."""
CONTROL_GRAMMAR = (
    "Control [ids or group] at [s] for [s] level [level]",
    "Uncontrol [number]",
)
"""Those for machines with control programs."""
NAMING = (
    "an Add line may end in 'as NAME', and later lines may use the name in place of an id; "
    "names consist of letters, digits and underscores"
)
"""How blocks are named, as shown to models."""

Ref = int | str
"""A block: its id, or the name that an earlier line of the script gives it, in lower case."""

_NUMBER = r" ?\[? ?(-?[0-9]{1,9}) ?\]? ?"
_WORD = r"(?<=[ \[])[0-9]{0,9}[a-z_][a-z0-9_]{0,79}(?=[ \]]|$)"
_REF = rf" ?\[? ?(-?[0-9]{{1,9}}|{_WORD}) ?\]? ?"
_NAME = r" ?\[? ?((?<=[ \[])[^ \[\]]{1,80}) ?\]? ?"
_END = f"to{_REF}in{_NUMBER}"
_ADD = re.compile(f"add{_NUMBER}{_END}(?:{_END})?(?:as{_NAME})?")
_REMOVE = re.compile(f"remove{_REF}")
_MOVE = re.compile(f"move{_REF}{_END}")
_DECIMAL = r"(-?[0-9]{0,6}\.?[0-9]{0,9}) ?s?"
_CONTROL = re.compile(rf"control (.{{1,800}}) at {_DECIMAL} for {_DECIMAL} level {_DECIMAL}")
_UNCONTROL = re.compile(r"uncontrol (-?[0-9]{1,9})")
_TARGET = re.compile(r"-?[0-9]{1,9}|[0-9]{0,9}[a-z_][a-z0-9_]{0,79}")
_NUMBERING = re.compile(
    r"(?:[-+•>] ?|\(?[0-9]{1,3}[.):] ?|step [0-9]{1,3} ?[.):-]? ?){0,3}", re.IGNORECASE
)


@dataclass(frozen=True)
class Add:
    """Adds a block on one face, or between two."""

    type: int
    ends: tuple[tuple[Ref, int], ...]
    """One or two (parent, face) pairs."""
    name: str = ""
    """As written, in lower case; "" if it gets none."""


@dataclass(frozen=True)
class Remove:
    """Removes a block."""

    block: Ref


@dataclass(frozen=True)
class Move:
    """Moves a block, with everything attached to it, to another face."""

    block: Ref
    parent: Ref
    face: int


@dataclass(frozen=True)
class AddControl:
    """Adds an entry at the end of the control program."""

    target: tuple[Ref, ...]
    """Blocks, or the name of one group."""
    at: float
    """When it begins, in seconds since t = 0."""
    lasts: float
    """For how long it holds, s."""
    level: float


@dataclass(frozen=True)
class RemoveControl:
    """Removes an entry of the control program."""

    number: int
    """Its place in the program of the given machine, from 0."""


Command = Add | Remove | Move | AddControl | RemoveControl


def script_lines(script: str) -> list[str]:
    """The lines that should be commands: not empty, no code fence, no `//` comment."""
    lines = (line.strip() for line in script.splitlines())
    return [line for line in lines if line and not line.startswith(("```", "~~~", "//"))]


def is_machine(lines: Sequence[str]) -> bool:
    """Whether lines that should be commands are a whole machine instead."""
    return any("{" in line for line in lines) and not any(map(read_command, lines))


def read_command(line: str) -> Command | None:
    """The command on a line; None if the line is not a command.

    Ignores numbering, bullets, emphasis, letter case, trailing punctuation and `//` comments.
    """
    plain = " ".join(line.partition("//")[0].replace("`", "").replace("*", "").split()).lower()
    numbering = _NUMBERING.match(plain)
    plain = plain[numbering.end() if numbering else 0 :].rstrip(" .;,")
    if match := _ADD.fullmatch(plain):
        kind, *ends, name = match.groups()
        pairs = zip(ends[::2], ends[1::2], strict=True)
        placed = tuple((_ref(ref), int(face)) for ref, face in pairs if ref is not None)
        return Add(int(kind), placed, name or "")
    if match := _REMOVE.fullmatch(plain):
        return Remove(_ref(match[1]))
    if match := _MOVE.fullmatch(plain):
        return Move(_ref(match[1]), _ref(match[2]), int(match[3]))
    return _read_control(" ".join(re.sub(r"[\[\]]", " ", plain).split()))


def _read_control(plain: str) -> AddControl | RemoveControl | None:
    """The command of a line without brackets that begins with Control or Uncontrol."""
    if match := _UNCONTROL.fullmatch(plain):
        return RemoveControl(int(match[1]))
    match = _CONTROL.fullmatch(plain)
    words = [word for word in re.split(r"[, ]+", match[1]) if word] if match else []
    if match is None or not words or not all(map(_TARGET.fullmatch, words)):
        return None
    try:
        at, lasts, level = (float(number) for number in match.groups()[1:])
    except ValueError:
        return None
    return AddControl(tuple(map(_ref, words)), at, lasts, level)


def _ref(text: str) -> Ref:
    return int(text) if text.lstrip("-").isdigit() else text
