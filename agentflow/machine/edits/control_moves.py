"""Random control programs, and changes of one entry."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from random import Random

from agentflow.machine.controls import MAX_CONTROLS, PRECISION, driven_blocks
from agentflow.machine.edits.moves import Kinds
from agentflow.machine.tree import Control, Machine

MOST_BLOCKS = 4
"""Most blocks of a random entry that names blocks, such as the wheels of one side."""
STEP = 0.1
"""Random times (s) and levels are multiples of this."""


def random_control(machine: Machine, window: float, rng: Random) -> Control | None:
    """An entry for a random group, or for a few random blocks of one; None if nothing is driven.

    Args:
        machine: what it is for.
        window: latest end of a control, s.
        rng: random generator.
    """
    driven = driven_blocks(machine)
    if not driven:
        return None
    group = rng.choice(sorted(set(driven.values())))
    blocks = [block for block, own in driven.items() if own == group]
    some = rng.sample(blocks, rng.randint(1, min(len(blocks), MOST_BLOCKS)))
    return _timed(rng.choice((group, tuple(sorted(some)))), window, rng)


def _timed(target: tuple[int, ...] | str, window: float, rng: Random) -> Control:
    """An entry for a target, at random times within the window and a random level."""
    most = max(1, int(window / STEP))
    begin = rng.randrange(most)
    end = rng.randint(begin + 1, most)
    level = rng.choice((-1, 1)) * rng.randint(1, 10)
    times = (min(window, step * STEP) for step in (begin, end - begin))
    at, lasts, share = (round(number, PRECISION) for number in (*times, level * STEP))
    return Control(target, at, lasts, share)  # type: ignore[arg-type]


def _added(window: float, machine: Machine, rng: Random) -> Machine | None:
    new = random_control(machine, window, rng)
    if new is None or len(machine.controls) >= MAX_CONTROLS:
        return None
    return replace(machine, controls=(*machine.controls, new))


def _changed(window: float, machine: Machine, number: int, rng: Random) -> Machine:
    new = _timed(machine.controls[number].target, window, rng)
    return replace(machine, controls=_with(machine, number, (new,)))


def _removed(machine: Machine, number: int, rng: Random) -> Machine:  # noqa: ARG001
    return replace(machine, controls=_with(machine, number, ()))


def _with(machine: Machine, number: int, entries: tuple[Control, ...]) -> tuple[Control, ...]:
    """The program with other entries in place of one."""
    return (*machine.controls[:number], *entries, *machine.controls[number + 1 :])


def control_moves(window: float) -> Kinds:
    """Kinds of edits of control programs that end within the window, s; as `moves.MOVES`."""
    return {
        "control": lambda machine, _types: [partial(_added, window, machine)],
        "uncontrol": lambda machine, _types: [
            partial(_removed, machine, number) for number in range(len(machine.controls))
        ],
        "retime": lambda machine, _types: [
            partial(_changed, window, machine, number) for number in range(len(machine.controls))
        ],
    }


def with_random_program(machine: Machine, window: float, rng: Random, most: int = 4) -> Machine:
    """The machine with one to `most` more random entries, if something in it is driven."""
    for _ in range(rng.randint(1, most)):
        machine = _added(window, machine, rng) or machine
    return machine
