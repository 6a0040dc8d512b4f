"""Random machines and random legal edits, for baselines, property tests and fuzzing; and all
machines one edit away."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from random import Random
from typing import TypeVar

from agentflow.errors import UsageError
from agentflow.machine.blocks.library import STARTING_BLOCK, library
from agentflow.machine.brief import Brief
from agentflow.machine.edits.moves import (
    MOVES,
    Kinds,
    Move,
    additions,
    control_moves,
    with_random_program,
)
from agentflow.machine.tree import ROOT, Machine
from agentflow.machine.validity import budget_problems, check

MAX_TRIES = 1000
"""Maximum number of machines that `random_machine` starts before it gives up."""
BLOCKS = (5, 20)
"""Least and most blocks of random machines, by default."""

_T = TypeVar("_T")
_U = TypeVar("_U")


def random_machine(
    rng: Random, brief: Brief | None = None, size: tuple[int, int] = BLOCKS
) -> Machine:
    """Grow a random valid machine, with the blocks that the task requires, block by block.

    The number of blocks is uniform over `size`, cut to what the task allows. Each step draws a
    legal (type, free face) pair uniformly; two-ended types may use any face, and their second end
    is uniform over the faces of all other blocks. Steps that exceed a required number of blocks are
    not legal. Machines that end with too few required blocks, or cannot grow further, are
    discarded. If machines may bring control programs, they get random ones.

    Args:
        rng: random generator.
        brief: the task, for its block list, limits and required blocks; the core types and the
            standard building volume if None.
        size: minimum and maximum number of blocks, including the Starting Block.

    Raises:
        UsageError: No such machine was found.
    """
    types = _allowed_types(brief)
    for _ in range(MAX_TRIES):
        machine = _grow(rng, types, brief, rng.randint(*_allowed_size(size, brief)))
        if machine is not None and _has_required_blocks(machine, brief):
            window = window_of(brief)
            return machine if window is None else with_random_program(machine, window, rng)
    raise UsageError(
        f"found no valid machine of {size[0]} to {size[1]} blocks for this task; "
        f"allowed types: {', '.join(map(str, types)) or 'none'}"
    )


def random_edit(machine: Machine, rng: Random, brief: Brief | None = None) -> Machine:
    """Apply one random legal edit.

    Draws a kind of edit (`kinds_of_moves`) uniformly among those with a legal edit, then a legal
    edit of that kind uniformly. An edit is legal if its result is valid and has the blocks that the
    task requires, unless the given machine already lacks some.

    Args:
        machine: a valid machine.
        rng: random generator.
        brief: the task; the core types and the standard building volume if None.

    Raises:
        UsageError: There is no legal edit.
    """
    return draw_legal(machine, rng, brief, kinds_of_moves(brief))[1]


def draw_legal(
    machine: Machine, rng: Random, brief: Brief | None, kinds: Kinds
) -> tuple[str, Machine]:
    """As `random_edit`, among these kinds of edits; also returns the kind."""
    types, complete = _allowed_types(brief), _has_required_blocks(machine, brief)

    def legal(move: Move) -> Machine | None:
        edited = _apply_if_valid(rng, brief, move)
        return edited if edited and (_has_required_blocks(edited, brief) or not complete) else None

    def of_kind(kind: str) -> tuple[str, Machine] | None:
        edited = _draw_first_success(rng, kinds[kind](machine, types), legal)
        return None if edited is None else (kind, edited)

    drawn = _draw_first_success(rng, tuple(kinds), of_kind)
    if drawn is None:
        raise UsageError("this machine has no legal edit")
    return drawn


def kinds_of_moves(brief: Brief | None) -> Kinds:
    """Kind of edit -> function that lists all its moves: also of control programs, if the task lets
    machines bring them."""
    window = window_of(brief)
    return MOVES if window is None else {**MOVES, **control_moves(window)}


def window_of(brief: Brief | None) -> float | None:
    """Latest end of controls, s; None without a task, or if machines may not bring any."""
    return None if brief is None else brief.limits.controls


def _grow(rng: Random, types: Sequence[int], brief: Brief | None, count: int) -> Machine | None:
    """Grow a machine of `count` blocks; None if it cannot grow that far."""
    required = {} if brief is None else brief.required
    machine: Machine | None = Machine((ROOT,)) if brief is None else brief.given

    while machine is not None and len(machine) < count:
        wanted = [kind for kind in types if machine.count(kind) < required.get(kind, count)]
        place_block = partial(_apply_if_valid, rng, brief)
        machine = _draw_first_success(rng, additions(machine, wanted), place_block)
    return machine


def _apply_if_valid(rng: Random, brief: Brief | None, move: Move) -> Machine | None:
    """The machine that a move makes; None if it is invalid."""
    edited = move(rng)
    if edited is None or (brief and budget_problems(len(edited), brief)):
        return None  # a full machine has thousands of additions, each soon refused
    report = check(edited, brief)
    return None if report.lasting_problems else report.machine


def _draw_first_success(
    rng: Random, items: Sequence[_T], attempt: Callable[[_T], _U | None]
) -> _U | None:
    """Try items in random order and return the first result; None if all attempts fail.

    The choice is uniform over the items that succeed.
    """
    left = list(items)
    while left:
        index = rng.randrange(len(left))
        left[index], left[-1] = left[-1], left[index]
        result = attempt(left.pop())
        if result is not None:
            return result
    return None


def _allowed_types(brief: Brief | None) -> tuple[int, ...]:
    allowed = library().core if brief is None else brief.blocks
    return tuple(sorted(set(allowed) - {STARTING_BLOCK}))


def _allowed_size(size: tuple[int, int], brief: Brief | None) -> tuple[int, int]:
    """The part of a range of sizes that the task allows; its largest machine if there is none."""
    if brief is None or brief.limits.blocks is None:
        return size
    most = brief.limits.blocks + brief.uncounted
    return min(size[0], most), min(size[1], most)


def _has_required_blocks(machine: Machine, brief: Brief | None) -> bool:
    required = {} if brief is None else brief.required
    return all(machine.count(kind) == count for kind, count in required.items())


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
    differing = (
        old
        for old, new in zip(before, after, strict=False)
        if (old.type, old.attachments) != (new.type, new.attachments)
    )
    changed = next(differing, before.steps[-1])
    return Neighbour(after, changed.id, changed.attachments)
