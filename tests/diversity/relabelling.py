"""Give the blocks of a machine other ids without changing anything else."""

from __future__ import annotations

from dataclasses import replace
from random import Random

from agentflow.machine import Machine


def relabel(machine: Machine, rng: Random) -> Machine:
    """The same machine with its blocks in another order, parents still before children."""
    new: dict[int, int] = {}
    left = list(machine)
    while left:
        step = rng.choice([step for step in left if all(p in new for p in step.parents)])
        left.remove(step)
        new[step.id] = len(new)
    steps = {
        new[step.id]: replace(
            step,
            id=new[step.id],
            parent=new.get(step.parent, -1),
            parent_b=None if step.parent_b is None else new[step.parent_b],
        )
        for step in machine
    }
    return Machine(tuple(steps[place] for place in sorted(steps)))
