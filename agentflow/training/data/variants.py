"""More machines for one answer: random legal edits of its machine.

Whether a variant still works is for the function test to say, as with the answer itself.
"""

from __future__ import annotations

from collections import Counter
from random import Random

from agentflow.errors import UsageError
from agentflow.machine import Brief, Machine, library
from agentflow.machine.edits.random import random_edit

MOST_EDITS = 2
"""A variant differs from its machine by 1 or 2 edits: with up to 3, half of them stop working."""
EDITED = ", edited at random"
"""Follows the name of the model in the source of a variant."""


def make_variants(machine: Machine, brief: Brief, share: float, rng: Random) -> list[Machine]:
    """Variants of a valid machine, `share` on average."""
    count = int(share) + (rng.random() < share % 1)
    return [_edit(machine, brief, rng) for _ in range(count)]


def _edit(machine: Machine, brief: Brief, rng: Random) -> Machine:
    for _ in range(rng.randint(1, MOST_EDITS)):
        try:
            machine = random_edit(machine, rng, brief)
        except UsageError:  # no legal edit
            break
    return machine


def describe_changes(machine: Machine, variant: Machine) -> str:
    """Which blocks a variant has more or fewer of, as a sentence that continues a rationale."""
    before, after = (Counter(step.type for step in item) for item in (machine, variant))
    parts = [f"{n} more {library()[kind].name}" for kind, n in sorted((after - before).items())]
    parts += [f"{n} fewer {library()[kind].name}" for kind, n in sorted((before - after).items())]
    return f"Changed: {', '.join(parts) or 'where blocks are attached'}."
