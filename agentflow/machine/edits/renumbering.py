"""Earlier edits in today's numbering: which block of then is which block of now."""

from __future__ import annotations

from collections.abc import Mapping

from agentflow.machine.blocks.library import library
from agentflow.machine.edits.commands import (
    AddControl,
    Command,
    Mirror,
    Move,
    Ref,
    Remove,
    RemoveControl,
    Replace,
    SetControl,
    SetNumber,
    WriteControllers,
)
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine

Text = tuple[Ref, ...]
"""A sentence: ids of blocks are integers, words and names are strings."""
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


def matching_ids(old: Machine, new: Machine) -> dict[int, int | None]:
    """Id in one machine -> id in another of the block of the same type in the same place."""
    there = {(b.type, b.at, b.far, b.facing): b.id for b in reversed(place(new).blocks)}
    return {b.id: there.get((b.type, b.at, b.far, b.facing)) for b in place(old).blocks}
