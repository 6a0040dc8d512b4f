"""Owns chance: random machines and random legal edits, for baselines, property tests, fuzzing.

What can be done to a machine is moves.py's, what is legal validity.py's (spec 1.10).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random
from typing import TypeVar

from agentflow.errors import UsageError
from agentflow.machine.blocks.library import STARTING_BLOCK, library
from agentflow.machine.brief import Brief
from agentflow.machine.edits.moves import MOVES, Addition, Move, additions
from agentflow.machine.tree import ROOT, Machine
from agentflow.machine.validity import check

__all__ = ["random_edit", "random_machine"]

MAX_TRIES = 1000
"""Most machines that are begun before `random_machine` gives up."""

_T = TypeVar("_T")
_U = TypeVar("_U")


def random_machine(
    rng: Random, brief: Brief | None = None, size: tuple[int, int] = (5, 20)
) -> Machine:
    """A random valid machine that has the blocks that the task requires, grown block by block.

    The number of blocks is uniform over `size`. A growth step is a type and a free face that it
    hangs on (for a two-ended type any face), uniform over all that are legal; the second end of
    a two-ended block is then uniform over the faces of all other blocks. A step that gives more
    blocks of a type than the task requires is not legal; a machine that ends with fewer, or that
    cannot grow on, is thrown away and another one grown.

    Args:
        rng: where chance comes from.
        brief: the task, for its block list, size limit and required blocks; without one the core
            types and the standard building volume.
        size: fewest and most blocks, the Starting Block included.

    Raises:
        UsageError: With these blocks no such machine was found.
    """
    types = _types(brief)
    for _ in range(MAX_TRIES):
        machine = _grown(rng, types, brief, rng.randint(*size))
        if machine is not None and _complete(machine, brief):
            return machine
    raise UsageError(
        f"no machine of {size[0]} to {size[1]} blocks was found that the task allows; "
        f"allowed types: {', '.join(map(str, types)) or 'none'}"
    )


def random_edit(machine: Machine, rng: Random, brief: Brief | None = None) -> Machine:
    """A machine that is one random legal edit away (spec 5.2).

    Uniform over the kinds of edit (`moves.MOVES`) that have a legal one, then uniform over the
    legal edits of that kind. Legal is what leads to a valid machine and, where the given one has
    the blocks that the task requires, keeps it so.

    Args:
        machine: a valid machine.
        rng: where chance comes from.
        brief: the task; without one the core types and the standard building volume.

    Raises:
        UsageError: No edit is legal.
    """
    types, complete = _types(brief), _complete(machine, brief)

    def legal(move: Move) -> Machine | None:
        edited = _valid(move, rng, brief)
        return edited if edited and (_complete(edited, brief) or not complete) else None

    def of_kind(kind: str) -> Machine | None:
        return _draw(rng, MOVES[kind](machine, types), legal)

    edited = _draw(rng, tuple(MOVES), of_kind)
    if edited is None:
        raise UsageError("no edit of this machine is legal")
    return edited


def _grown(rng: Random, types: Sequence[int], brief: Brief | None, count: int) -> Machine | None:
    """A machine of so many blocks; None where growth comes to an end before."""
    required = {} if brief is None else brief.required
    machine: Machine | None = Machine((ROOT,)) if brief is None else brief.given

    def legal(addition: Addition) -> Machine | None:
        return _valid(addition, rng, brief)

    while machine is not None and len(machine) < count:
        wanted = [kind for kind in types if machine.count(kind) < required.get(kind, count)]
        machine = _draw(rng, additions(machine, wanted), legal)
    return machine


def _valid(move: Move, rng: Random, brief: Brief | None) -> Machine | None:
    """The machine that a move makes, if it is valid."""
    made = move.apply(rng)
    return made if made is not None and check(made, brief).machine_valid else None


def _draw(rng: Random, items: Sequence[_T], attempt: Callable[[_T], _U | None]) -> _U | None:
    """What the first item in random order gives that succeeds; None if none does.

    Uniform over the items that succeed, without trying all of them.
    """
    left = list(items)
    while left:
        index = rng.randrange(len(left))
        left[index], left[-1] = left[-1], left[index]
        result = attempt(left.pop())
        if result is not None:
            return result
    return None


def _types(brief: Brief | None) -> tuple[int, ...]:
    allowed = library().core if brief is None else brief.blocks
    return tuple(sorted(set(allowed) - {STARTING_BLOCK}))


def _complete(machine: Machine, brief: Brief | None) -> bool:
    """Whether the machine has the blocks that the task requires."""
    required = {} if brief is None else brief.required
    return all(machine.count(kind) == count for kind, count in required.items())
