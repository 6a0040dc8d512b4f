"""Random valid catapults: base, tower, rotating block, arm, container, boulder."""

from __future__ import annotations

from random import Random

from agentflow.env.tasks.registry import get_task
from agentflow.machine.blocks.library import BOULDER, CONTAINER, library
from agentflow.machine.tree import ROOT, Machine, Step
from agentflow.machine.validity import check

BASE, TOWER, ARM = (1, 15, 35, 63), (1, 15, 63), (1, 15, 63)
ROTOR = 22
TRIES = 40
"""Attempts to add a block before starting a new machine."""


def catapult(rng: Random) -> Machine:
    """A valid machine of 8 to 18 blocks with randomly chosen attachments."""
    while True:
        machine = _try_catapult(rng)
        if machine is not None:
            return machine


def _try_catapult(rng: Random) -> Machine | None:
    plan: list[tuple[tuple[int, ...], int | None]] = [
        *((BASE, None) for _ in range(rng.randint(3, 7))),
        (TOWER, 0),
        *((TOWER, -1) for _ in range(rng.randint(0, 2))),
        ((ROTOR,), -1),
        *((ARM, -1) for _ in range(rng.randint(1, 3))),
        ((CONTAINER,), -1),
        ((BOULDER,), -1),
    ]
    machine = Machine((ROOT,))
    for types, on in plan:
        longer = _add_block(rng, machine, types, on)
        if longer is None:
            return None
        machine = longer
    return machine if check(machine, get_task("throwing").brief).task_valid else None


def _add_block(
    rng: Random, machine: Machine, types: tuple[int, ...], on: int | None
) -> Machine | None:
    """Attach a block to block `on` (-1: the last; None: any), or return None."""
    for _ in range(TRIES):
        parent = rng.randrange(len(machine)) if on is None else on % len(machine)
        faces = library()[machine[parent].type].faces
        kind = rng.choice(types)
        face = 0 if kind == BOULDER else rng.randrange(len(faces))
        longer = Machine((*machine.steps, Step(len(machine), kind, parent, face)))
        if check(longer, get_task("throwing").brief).machine_valid:
            return longer
    return None
