"""Problems of machines, and the wording of the messages that several modules share."""

import reprlib
from collections.abc import Collection, Iterable
from dataclasses import dataclass

from agentflow.errors import UsageError
from agentflow.machine.blocks.library import STARTING_BLOCK, library


@dataclass(frozen=True, slots=True)
class Problem:
    """One fault of a machine."""

    code: str
    """Machine-readable kind, for counting: overlap, face_not_found, ..."""
    blocks: tuple[int, ...]
    """Ids of the blocks concerned, ascending; list indices if the ids are wrong."""
    message: str
    """One sentence, with the offending values, that a model can act on."""

    def to_json(self) -> dict[str, object]:
        """The problem as JSON data."""
        return {"code": self.code, "blocks": list(self.blocks), "message": self.message}


class RefusedEdit(UsageError):
    """A change that cannot be made: a code for counting, and one sentence that says why."""

    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason


REQUIRED_COUNT = "required_count"
LATER_RULES = frozenset({"too_many_blocks", "duplicate_connection"})
"""Codes of rules that did not exist when older runs were recorded; their machines may break them.
"""

_short = reprlib.Repr()
_short.maxstring = _short.maxother = 40
_short.maxlevel = 2


def short_repr(value: object) -> str:
    """Any value, abbreviated for messages."""
    if isinstance(value, int) and abs(value) >= 10**12:
        return "a very large number"
    return _short.repr(value)


def comma_list(items: Iterable[object]) -> str:
    """Items separated by commas; "none" if there are none."""
    return ", ".join(str(item) for item in items) or "none"


def size_of_piece(parts: int, most: int, engine: str) -> Problem:
    """The problem of a machine with more parts in one piece than this physics engine can hold."""
    message = (
        f"the machine has {parts} parts in one piece; {engine} holds at most {most}: "
        "remove blocks (a two-ended block has 2 parts, a moving joint in a loop counts as one more)"
    )
    return Problem("too_many_parts", (), message)


def block_label(block_id: int, block_type: int) -> str:
    """A block in messages: "block 7 (Log)"."""
    return f"block {block_id} ({library()[block_type].name})"


def type_problem(kind: int, allowed: Collection[int], *, two_ended: bool) -> tuple[str, str] | None:
    """Code and message if a block other than the root may not have this type; None if it may.

    Args:
        kind: type id as written.
        allowed: type ids that the task allows.
        two_ended: whether the block is written with two parents.
    """
    if kind == STARTING_BLOCK:
        return "starting_block", "type 0 is the Starting Block; only the first block may have it"
    if kind not in library():
        near = comma_list(library().nearest(kind)[:3])
        return "unknown_type", f"type {short_repr(kind)} is unknown; the nearest types are {near}"
    block = library()[kind]
    if kind not in allowed:
        types = comma_list(kind for kind in sorted(allowed) if kind != STARTING_BLOCK)
        return "type_not_allowed", f"type {block.label} is not allowed here; allowed types: {types}"
    if block.linear and not two_ended:
        return "two_ended", f"type {block.label} is two-ended; give two parents, each with a face"
    if two_ended and not block.linear:
        return "two_ended", f"type {block.label} is not two-ended; give one parent and one face"
    return None


def face_problem(block_id: int, block_type: int, face_id: int) -> str | None:
    """Message if nothing can be attached to this face; None if it is fine or the type unknown."""
    if block_type not in library():
        return None
    kind = library()[block_type]
    count, label = len(kind.faces), block_label(block_id, block_type)
    if 0 <= face_id < count:
        hole = f"face {face_id} of {label} is over a hole; nothing can be attached to it"
        return hole if face_id in kind.closed else None
    if count == 0:
        return f"{label} has no faces; nothing can be attached to it"
    faces = "its only face is 0" if count == 1 else f"its faces are 0 to {count - 1}"
    return f"{label} has no face {short_repr(face_id)}; {faces}"
