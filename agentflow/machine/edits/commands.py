"""Parsing of edit scripts into commands, and commands in words."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast

GRAMMAR = (
    "Add [type] to [id] in [face]",
    "Add [type] to [id_a] in [face_a] to [id_b] in [face_b]",
    "Remove [id]",
    "Move [id] to [new_parent] in [new_face]",
    "Move [id] end [a or b] to [new_parent] in [new_face]",
    "Replace [id] with [type]",
    "Mirror [id, x+ or x-]",
)
"""The commands, as shown to models."""
CONTROL_GRAMMAR = (
    "Control [ids or group] at [s] for [s] level [level]",
    "Uncontrol [number]",
    "Set [number] at [s] for [s] level [level]",
)
CONTROLLER_GRAMMAR = (
    "Controllers [JSON on one line, or none]",
    "Set [path of a number, such as laws.NAME.p] [number]",
)
NAMING = (
    "an Add line may end in 'as NAME', and later lines may use the name in place of an id; "
    "names consist of letters, digits and underscores"
)

Ref = int | str
"""A block: its id, or the name that an earlier line of the script gives it, in lower case."""
Text = tuple[Ref, ...]
"""A sentence: ids of blocks are integers, words and names are strings."""
Face = int | str
"""A face of a block: its id, or where it looks and then where it lies, as `face_towards` takes it:
`x+`, `x+z-`."""
Side = Literal["x+", "x-"]
"""A side of the plane x = 0 through the middle of the root."""
Quantity = Literal["at", "for", "level"]
"""What a control entry says of its blocks, besides which they are."""

_NUMBER = r" ?\[? ?(-?[0-9]{1,9}) ?\]? ?"
_WORD = r"(?<=[ \[])[0-9]{0,9}[a-z_][a-z0-9_]{0,79}(?=[ \]]|$)"
_REF = rf" ?\[? ?(-?[0-9]{{1,9}}|{_WORD}) ?\]? ?"
_NAME = r" ?\[? ?((?<=[ \[])[^ \[\]]{1,80}) ?\]? ?"
_AXIS = r"[xyz][+-]"
_FACE = rf" ?\[? ?(-?[0-9]{{1,9}}|{_AXIS}(?: ?{_AXIS}){{0,2}}) ?\]? ?"
_END = f"to{_REF}in{_FACE}"
_ADD = re.compile(f"add{_NUMBER}{_END}(?:{_END})?(?:as{_NAME})?")
_REMOVE = re.compile(f"remove{_REF}")
_MOVE = re.compile(rf"move{_REF}(?:end ?\[? ?([ab]) ?\]? )?{_END}")
_REPLACE = re.compile(f"replace{_REF}with{_NUMBER}")
_MIRROR = re.compile(rf"mirror(?: ?\[? ?(x[+-]) ?\]? ?|{_REF})")
_FACE_AT = re.compile(f"face{_FACE}at{_REF}(?= |$)")
_DECIMAL = r"(-?[0-9]{0,6}\.?[0-9]{0,9}) ?s?"
_CONTROL = re.compile(rf"control (.{{1,800}}) at {_DECIMAL} for {_DECIMAL} level {_DECIMAL}")
_CHANGE = r" (at|for|level) (-?[0-9]{0,6}\.?[0-9]{0,9})(?: ?s)?"
_SET = re.compile(rf"set (-?[0-9]{{1,9}})((?:{_CHANGE}){{1,3}})")
_QUANTITY = re.compile(_CHANGE)
_SET_NUMBER = re.compile(
    r"set ((?:laws|outputs)\.[a-z0-9_.]{1,200}) (?:to )?"
    r"(-?[0-9]{0,9}\.?[0-9]{0,12}(?:e-?[0-9]{1,2})?)"
)
_CONTROLLERS = re.compile(r"controllers ?:? ?(none|\{.*\})")
_UNCONTROL = re.compile(r"uncontrol (-?[0-9]{1,9})")
_TARGET = re.compile(r"-?[0-9]{1,9}|[0-9]{0,9}[a-z_][a-z0-9_]{0,79}")
_NUMBERING = re.compile(
    r"(?:[-+•>] ?|\(?[0-9]{1,3}[.):] ?|step [0-9]{1,3} ?[.):-]? ?){0,3}", re.IGNORECASE
)


@dataclass(frozen=True)
class Add:
    """Adds a block on one face, or between two."""

    type: int
    ends: tuple[tuple[Ref, Face], ...]
    """One or two (parent, face) pairs."""
    name: str = ""
    """As written, in lower case; "" if it gets none."""


@dataclass(frozen=True)
class Remove:
    """Removes a block."""

    block: Ref


@dataclass(frozen=True)
class Move:
    """Moves a block, with everything attached to it, or one end of it, to another face."""

    block: Ref
    parent: Ref
    face: Face
    end: Literal["", "a", "b"] = ""
    """The end of a two-ended block that moves; "" for a block with one."""


@dataclass(frozen=True)
class Replace:
    """Gives a block another type; what is attached to it stays."""

    block: Ref
    type: int


@dataclass(frozen=True)
class Mirror:
    """Adds the mirror image of a block and of what it carries, or of all blocks of a side."""

    what: Ref | Side


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
class SetControl:
    """Changes numbers of an entry of the control program."""

    number: int
    """Its place in the program of the given machine, from 0."""
    values: tuple[tuple[Quantity, float], ...]


@dataclass(frozen=True)
class RemoveControl:
    """Removes an entry of the control program."""

    number: int


@dataclass(frozen=True)
class WriteControllers:
    """Gives the machine other controllers, or none."""

    text: str
    """JSON of an object, in lower case; "" for none."""


@dataclass(frozen=True)
class SetNumber:
    """Changes one number of the controllers."""

    path: str
    """As `numbers_of` lists them."""
    value: float


TELLING = (Replace, Mirror, SetControl, RemoveControl, SetNumber)
"""Those whose verdict says what they have changed, as their lines do not."""
ControllerCommand = WriteControllers | SetNumber
ControlCommand = AddControl | SetControl | RemoveControl
Command = Add | Remove | Move | Replace | Mirror | ControlCommand | ControllerCommand


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
    if match := _CONTROLLERS.fullmatch(plain):
        return WriteControllers("" if match[1] == "none" else match[1])
    if "face" in plain:
        plain = " ".join(_FACE_AT.sub(r" \2 in \1 ", plain).split())
    if match := _ADD.fullmatch(plain):
        kind, *ends, name = match.groups()
        pairs = zip(ends[::2], ends[1::2], strict=True)
        placed = tuple((_ref(ref), _face(face)) for ref, face in pairs if ref is not None)
        return Add(int(kind), placed, name or "")
    if match := _REMOVE.fullmatch(plain):
        return Remove(_ref(match[1]))
    if match := _MOVE.fullmatch(plain):
        end = cast('Literal["", "a", "b"]', match[2] or "")
        return Move(_ref(match[1]), _ref(match[3]), _face(match[4]), end)
    if match := _REPLACE.fullmatch(plain):
        return Replace(_ref(match[1]), int(match[2]))
    if match := _MIRROR.fullmatch(plain):
        return Mirror(match[1] or _ref(match[2]))
    return _read_control(" ".join(re.sub(r"[\[\]]", " ", plain).split()))


def _read_control(plain: str) -> ControlCommand | SetNumber | None:
    """The command of a line without brackets that begins with Control, Set or Uncontrol."""
    if match := _UNCONTROL.fullmatch(plain):
        return RemoveControl(int(match[1]))
    if match := _SET_NUMBER.fullmatch(plain):
        try:
            return SetNumber(match[1], float(match[2]))
        except ValueError:
            return None
    if match := _SET.fullmatch(plain):
        return _read_set(int(match[1]), _QUANTITY.findall(match[2]))
    match = _CONTROL.fullmatch(plain)
    words = [word for word in re.split(r"[, ]+", match[1]) if word] if match else []
    if match is None or not words or not all(map(_TARGET.fullmatch, words)):
        return None
    try:
        at, lasts, level = (float(number) for number in match.groups()[1:])
    except ValueError:
        return None
    return AddControl(tuple(map(_ref, words)), at, lasts, level)


def _read_set(number: int, written: Sequence[tuple[str, str]]) -> SetControl | None:
    try:
        values = {cast("Quantity", name): float(value) for name, value in written}
    except ValueError:
        return None
    return SetControl(number, tuple(values.items())) if len(values) == len(written) else None


def _face(text: str) -> Face:
    return int(text) if text.lstrip("-").isdigit() else text.replace(" ", "")


def _ref(text: str) -> Ref:
    return int(text) if text.lstrip("-").isdigit() else text


def command_text(command: Command) -> Text:
    """A command as a sentence."""
    if isinstance(command, Remove):
        return ("Remove ", command.block)
    if isinstance(command, Move):
        end = f" end {command.end}" if command.end else ""
        return ("Move ", command.block, f"{end} to ", command.parent, f" in {command.face}")
    if isinstance(command, Replace):
        return ("Replace ", command.block, f" with {command.type}")
    if isinstance(command, Mirror):
        return ("Mirror ", command.what)
    if isinstance(command, SetControl):
        numbers = (f" {name} {value:g}" for name, value in command.values)
        return (f"Set {command.number}", *numbers)
    if isinstance(command, WriteControllers):  # its block ids were those of then
        return ("Controllers {...}" if command.text else "Controllers none",)
    if isinstance(command, SetNumber):
        return (f"Set {command.path} {command.value:g}",)
    if isinstance(command, RemoveControl):
        return (f"Uncontrol {command.number}",)
    if isinstance(command, AddControl):
        blocks = (part for ref in command.target for part in (", ", ref))
        when = f" at {command.at:g} for {command.lasts:g} level {command.level:g}"
        return ("Control ", *list(blocks)[1:], when)
    ends = (part for ref, face in command.ends for part in (" to ", ref, f" in {face}"))
    named = (" as ", command.name) if command.name else ()
    return (f"Add {command.type}", *ends, *named)
