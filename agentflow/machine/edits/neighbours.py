"""Neighbours of a machine: the legal machines one edit away, and where each edit is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from random import Random

from agentflow.errors import UsageError
from agentflow.machine.blocks.library import STARTING_BLOCK
from agentflow.machine.brief import Brief
from agentflow.machine.edits.random import kinds_of_moves, random_edit
from agentflow.machine.tree import Machine, Step
from agentflow.machine.validity import check

MAX_REPEATS = 20
"""Draws of the same neighbours in a row after which a sample is taken to hold all of them."""


@dataclass(frozen=True)
class Neighbour:
    """A machine one edit away. Ids are those of the machine that was edited."""

    machine: Machine
    block: int | None
    """The block that the edit changes or removes; None if it adds one, or changes controls only."""
    faces: tuple[tuple[int, int], ...]
    """(block, face) where the new block is attached, or where the old one was; () for controls."""


def all_neighbours(machine: Machine, brief: Brief, rng: Random) -> Iterator[Neighbour]:
    """Every legal neighbour. The second ends of added two-ended blocks are random.

    An edit is legal if its result is valid and has the blocks that the task requires.
    """
    types = sorted(set(brief.blocks) - {STARTING_BLOCK})
    seen = {machine}
    for moves in kinds_of_moves(brief).values():
        for move in moves(machine, types):
            edited = move(rng)
            if edited is None or edited in seen:
                continue
            seen.add(edited)
            valid = check(edited, brief)
            if valid.machine is not None and not valid.problems:
                yield _locate(machine, valid.machine)


def sample_neighbours(machine: Machine, brief: Brief, rng: Random, count: int) -> list[Neighbour]:
    """At most `count` different legal neighbours, drawn as `random_edit` does.

    Each kind of edit is as likely as the others, although there are more additions than removals.
    """
    found: dict[Machine, Neighbour] = {}
    repeats = 0
    while len(found) < count and repeats < MAX_REPEATS:
        try:
            edited = random_edit(machine, rng, brief)
        except UsageError:
            break
        repeats = repeats + 1 if edited in found or edited == machine else 0
        if not repeats:
            found[edited] = _locate(machine, edited)
    return list(found.values())


def _locate(before: Machine, after: Machine) -> Neighbour:
    """Where an edit is: the first step that differs, as moves renumber what follows."""
    if after.steps == before.steps:  # only controls differ
        return Neighbour(after, None, ())
    if len(after) > len(before):
        return Neighbour(after, None, after.steps[-1].attachments)
    pairs = zip(before.steps, after.steps, strict=False)
    changed = next((old for old, new in pairs if _content(old) != _content(new)), before.steps[-1])
    return Neighbour(after, changed.id, changed.attachments)


def _content(step: Step) -> tuple[int, tuple[tuple[int, int], ...]]:
    return step.type, step.attachments
