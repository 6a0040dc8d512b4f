"""What makes new machines from those of a search without a model: edits and crossover."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random

from agentflow.errors import UsageError
from agentflow.machine.brief import Brief
from agentflow.machine.edits.crossover import cross
from agentflow.machine.tree import Machine
from agentflow.search.node import Attempt
from agentflow.workflows.stages.feedback import Revision

MAX_REPEATS = 20
"""Maximum number of edits or crossovers that are drawn to find a new machine."""
Edit = Callable[[Machine, Random], Machine]
"""Applies one random legal edit; raises UsageError if there is none."""


def draw_revision(
    machine: Machine,
    mates: Sequence[Machine],
    label: str,
    rng: Random,
    brief: Brief,
    edit: Edit,
    is_new: Callable[[Machine], bool],
) -> Attempt[Revision]:
    """Make a new machine from one machine: a crossover if there are mates, or else an edit.

    Args:
        machine: What it is made from.
        mates: Machines to take a part of.
        label: Label of the attempt.
        rng: What is drawn from.
        brief: The task.
        edit: Makes an edit.
        is_new: Whether a machine has not been simulated yet.
    """
    note = "crossover" if mates else "random edit"
    for _ in range(MAX_REPEATS):
        try:
            made = cross(machine, rng.choice(mates), rng, brief) if mates else edit(machine, rng)
        except UsageError as error:
            return Attempt(label, None, str(error))
        if is_new(made):
            return Attempt(label, Revision(made, label=label), note)
    return Attempt(label, None, f"no {note} leads to a new machine")
