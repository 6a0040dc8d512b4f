"""Hill climbing with random legal edits and restarts, to find reference machines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.families.jumping import Jumping
from agentflow.errors import UsageError
from agentflow.machine.brief import Brief
from agentflow.machine.edits.random import random_edit, random_machine
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check

EDITS = (1, 1, 1, 2, 2, 3, 4)
"""Number of edits between neighbours; one of these is chosen at random."""
PATIENCE = 60
"""Rollouts without improvement before a restart."""

Value = tuple[float, float]
"""Score, then the tie-breaker."""


@dataclass(frozen=True)
class Found:
    """A machine and its value."""

    machine: Machine
    value: Value


class OneJump(Jumping):
    """Jumping with a single trial: a tenth of the time, and terms that distinguish near
    machines."""

    count = 1


async def climb(
    task: Task,
    rollouts: int,
    rng: Random,
    start: Machine | None = None,
    aim: str | None = None,
    tell: Callable[[int, Found], None] = lambda _count, _found: None,
) -> Found:
    """Return the best machine found with this many rollouts.

    Each climb starts from `start`, or from a random machine, and moves to neighbours that are at
    least as good. It restarts after `PATIENCE` rollouts without improvement.

    Args:
        task: The task to score on.
        rollouts: Number of machines to simulate.
        rng: Random generator.
        start: A valid machine.
        aim: Score term that breaks ties.
        tell: Called with the number of rollouts so far whenever a better machine is found.
    """
    best: Found | None = None
    here: Found | None = None
    idle = 0
    async with RolloutPool(1) as pool:
        for count in range(1, rollouts + 1):
            machine = _next(here, start, task.brief, rng)
            found = Found(machine, _value(await pool.run(machine, task), aim))
            idle = 0 if here is None or found.value > here.value else idle + 1
            if here is None or found.value >= here.value:
                here = found
            if best is None or found.value > best.value:
                best = found
                tell(count, best)
            if idle >= PATIENCE:
                here, idle = None, 0
    if best is None:
        raise UsageError(f"a search needs at least one rollout, not {rollouts}")
    return best


def change(machine: Machine, brief: Brief, rng: Random) -> Machine:
    """A neighbour of a machine, one to four random edits away; the machine itself if invalid."""
    changed = machine
    for _ in range(rng.choice(EDITS)):
        changed = random_edit(changed, rng, brief)
    return changed if check(changed, brief).task_valid else machine


def _next(here: Found | None, start: Machine | None, brief: Brief, rng: Random) -> Machine:
    if here is None:
        return start or random_machine(rng, brief)
    return change(here.machine, brief, rng)


def _value(rollout: Rollout, aim: str | None) -> Value:
    """Failed rollouts and missing terms count as 0."""
    tie = rollout.terms.get(aim) if aim else None
    return rollout.score or 0.0, float(tie) if isinstance(tie, int | float) else 0.0
