"""What an edit of a machine was: as commands that repeat it, or else in words; what commands mean,
in words; and earlier edits in today's numbering."""

import json
import re
from collections.abc import Iterator, Mapping

from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.controls import control_text
from agentflow.machine.edits.commands import (
    Add,
    AddControl,
    Face,
    Mirror,
    Move,
    Ref,
    Remove,
    Replace,
    Text,
    read_command,
    script_lines,
)
from agentflow.machine.edits.script import apply_script
from agentflow.machine.geometry.placement import place
from agentflow.machine.problems import block_label
from agentflow.machine.tree import Machine, Step, shorten

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
    name, text = library()[step.type].name, tuple[Ref, ...]()
    for parent, face in step.attachments:
        if (now := id_map.get(parent)) is None:
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


def edit_text(before: Machine, after: Machine, brief: Brief | None = None) -> str:
    """One edit that led from a machine to another: commands with `; ` between them, if there are
    some that repeat it exactly, or else words that no script accepts."""
    commands = edit_commands(before, after, brief)
    return "; ".join(commands) if commands else _in_words(before, after)


def edit_commands(before: Machine, after: Machine, brief: Brief | None = None) -> tuple[str, ...]:
    """Commands of an edit script that make one machine from another; () if none were found.

    They are found for machines that one edit separates: blocks added at the end, one block removed,
    types or places changed, one control added, removed or changed, other controllers.
    """
    commands = tuple(_commands(before, after))
    outcome = apply_script(before, "\n".join(commands), brief)
    return commands if outcome.success and outcome.machine == after else ()


def edit_words(script: str, before: Machine | None = None) -> str:
    """An edit for people, a line for each command: types of blocks by name instead of number.

    Lines that are no commands, or that name a type which does not exist, stay as they are.

    Args:
        script: Commands, on lines or with `; ` between them, or words as `edit_text` has them.
        before: The machine that they edit; blocks are then told with their types.
    """
    return "\n".join(_line_words(line, before) for line in script_lines(script.replace("; ", "\n")))


def _line_words(line: str, before: Machine | None) -> str:
    """One command in words."""

    def block(ref: Ref) -> str:
        if before is not None and isinstance(ref, int) and 0 <= ref < len(before):
            return block_label(ref, before[ref].type)
        return f"block {ref}" if isinstance(ref, int) else f"new block {ref}"

    def at(parent: Ref, face: Face) -> str:
        return f"{block(parent)}, face {face}"

    def kind(number: int) -> str:
        name = library()[number].name
        return f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"

    match command := read_command(line):
        case Add(type=number) | Replace(type=number) if number not in library():
            return line
        case Add():
            ends = [at(*end) for end in command.ends]
            where = f"from {ends[0]} to {ends[1]}" if len(ends) > 1 else f"to {ends[0]}"
            called = f", called {command.name}" if command.name else ""
            return f"Add {kind(command.type)} {where}{called}"
        case Remove():
            return f"Remove {block(command.block)}"
        case Move():
            end = f"end {command.end} of " if command.end else ""
            return f"Move {end}{block(command.block)} to {at(command.parent, command.face)}"
        case Replace():
            return f"Replace {block(command.block)} with {kind(command.type)}"
        case Mirror(what="x+" | "x-"):
            return f"Mirror all blocks on the side {command.what}"
        case Mirror():
            return f"Mirror {block(command.what)} and what it carries"
        case AddControl():
            whom = ", ".join(block(r) if isinstance(r, int) else r for r in command.target)
            when = f"from {command.at:g} s for {command.lasts:g} s"
            return f"Drive {whom} {when} at level {command.level:g}"
    named = re.sub(r"(?<!block )\b\d+ \(([A-Z][\w ]+)\)", r"\1", line)
    return named[:1].upper() + named[1:]


def _commands(before: Machine, after: Machine) -> Iterator[str]:
    if before.steps == after.steps:
        yield from _control_commands(before, after)
        if after.controllers != before.controllers:
            laws = after.controllers and json.dumps(after.controllers.to_json())
            yield f"Controllers {laws or 'none'}"
    elif after.steps[: len(before)] == before.steps:
        yield from _additions(before, after)
    elif len(after) < len(before):
        yield f"Remove {_first_difference(before, after)}"
    elif len(after) == len(before):
        for old, new in zip(before, after, strict=True):
            yield from _changes(old, new)


def _additions(before: Machine, after: Machine) -> Iterator[str]:
    """New blocks; those that carry others are named."""
    new = after.steps[len(before) :]
    carriers = {parent for step in new for parent in step.parents}
    for step in new:
        ends = " to ".join(
            f"{parent if parent < len(before) else f'n{parent}'} in {face}"
            for parent, face in step.attachments
        )
        name = f" as n{step.id}" if step.id in carriers else ""
        yield f"Add {step.type} to {ends}{name}"


def _changes(old: Step, new: Step) -> Iterator[str]:
    if old.type != new.type:
        yield f"Replace {old.id} with {new.type}"
    pairs = zip("ab", old.attachments, new.attachments, strict=False)
    for end, here, (parent, face) in pairs:
        if here != (parent, face):
            which = f" end {end}" if old.two_ended else ""
            yield f"Move {old.id}{which} to {parent} in {face}"


def _control_commands(before: Machine, after: Machine) -> Iterator[str]:
    old, new = before.controls, after.controls
    if len(new) > len(old):
        yield control_text(new[-1])
    elif len(new) < len(old):
        pairs = zip(old, new, strict=False)
        yield f"Uncontrol {next((n for n, (a, b) in enumerate(pairs) if a != b), len(new))}"
    else:
        for number, (a, b) in enumerate(zip(old, new, strict=True)):
            values = (("at", a.at, b.at), ("for", a.lasts, b.lasts), ("level", a.level, b.level))
            changed = [f"{word} {shorten(now)}" for word, was, now in values if was != now]
            if changed:
                yield f"Set {number} {' '.join(changed)}"


def _first_difference(before: Machine, after: Machine) -> int:
    """The first block that is not the same in both, by its number."""
    pairs = zip(before, after, strict=False)
    return next((old.id for old, new in pairs if old != new), min(len(before), len(after)))


def _in_words(before: Machine, after: Machine) -> str:
    at = _first_difference(before, after)
    if len(after) > len(before):
        new = library()[after[min(at, len(after) - 1)].type].label
        return f"a new {new} between block {before[at].parent} and block {at}"
    label = block_label(at, before[min(at, len(before) - 1)].type)
    if len(after) < len(before):
        return f"{label} left out, its place taken by the block that it carries"
    return f"{library()[after[at].type].label} in place of {label}"
