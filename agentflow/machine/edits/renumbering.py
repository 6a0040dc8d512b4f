"""Earlier edits in today's numbering: which block of then is which block of now."""

from __future__ import annotations

from collections.abc import Mapping

from agentflow.machine.blocks.library import library
from agentflow.machine.edits.commands import Ref, Text
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine

Renumbering = Mapping[Ref, Text]
"""Id or name of a block then -> what it is called now; what is missing kept its name."""


def renumbering(
    machine: Machine, id_map: Mapping[int, int | None], names: Mapping[str, int | None]
) -> Renumbering:
    """What an edit of a machine does to its ids; removed blocks are described in words.

    Args:
        machine: The machine before the edit.
        id_map: Its ids -> ids after the edit, None for removed blocks.
        names: Names that the edit gives -> ids after the edit, None for those not there any more.
    """
    now: dict[Ref, Text] = {name: (id_,) for name, id_ in names.items() if id_ is not None}
    for step in machine:
        new = id_map.get(step.id)
        now[step.id] = (new,) if new is not None else _gone(machine, step.id, id_map)
    return now


def _gone(machine: Machine, block: int, id_map: Mapping[int, int | None]) -> Text:
    """A removed block by its type, and by its place if what it was attached to is still there."""
    step = machine[block]
    name = library()[step.type].name
    text: Text = ()
    for parent, face in step.attachments:
        now = id_map.get(parent)
        if now is None:
            return (f"{name} (gone)",)
        text = (*text, " and " if text else f"{name} (gone from ", now, f" in {face}")
    return (*text, ")")


def follow(earlier: Renumbering, later: Renumbering) -> Renumbering:
    """Two renumberings, one after the other; an empty one changes nothing.

    The names of the later edit are not those of the earlier one.
    """
    if not earlier:
        return {ref: text for ref, text in later.items() if isinstance(ref, int)}
    return {ref: renumber(text, later) for ref, text in earlier.items()}


def renumber(text: Text, now: Renumbering) -> Text:
    """A sentence in the numbering of now."""
    return tuple(part for ref in text for part in now.get(ref, (ref,)))


def matching_ids(old: Machine, new: Machine) -> dict[int, int | None]:
    """Id in one machine -> id in another of the block of the same type in the same place."""
    there = {(b.type, b.at, b.far, b.facing): b.id for b in reversed(place(new).blocks)}
    return {b.id: there.get((b.type, b.at, b.far, b.facing)) for b in place(old).blocks}
