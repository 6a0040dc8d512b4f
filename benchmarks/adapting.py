"""Adapts known machines to a smaller budget of blocks, or to fewer types."""

from __future__ import annotations

import random
import time
from dataclasses import replace

from recordbook import MachineRecord, Target, own_machines

from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Parameters, Task
from agentflow.env.tasks.family import Family
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import LONE_ROOT, Brief
from agentflow.machine.edits.moves import removals
from agentflow.machine.tree import ROOT, Machine
from agentflow.machine.validity import check as check_machine

TRIES = 4
"""Blocks whose removal is tried before one is removed."""


def adapt(target: Target, end: float, rng: random.Random) -> MachineRecord | None:
    """The best of the machines that fit the knobs after withheld types were exchanged and blocks
    were removed from known machines of the family; blocks whose removal costs least go first."""
    best: MachineRecord | None = None
    for item in own_machines():
        if item.family == target.task.family and time.monotonic() < end:
            machine = reduce(exchange(item.machine, target.task.brief, rng), target, rng)
            found = machine and target.record(machine, f"{item.how}, adapted")
            if found and (best is None or found.verified > best.verified):
                best = found
    return best


def exchange(machine: Machine, brief: Brief, rng: random.Random) -> Machine:
    """The machine on the structure that the task gives, if any, with each block of a withheld type
    as a random other type."""
    if brief.given != LONE_ROOT:
        return Machine((*brief.given.steps, *machine.steps[len(brief.given) :]))
    allowed = [kind for kind in brief.blocks if kind not in (ROOT.type, *brief.required)]
    steps = []
    for step in machine:
        like = [kind for kind in allowed if library()[kind].linear == step.two_ended]
        known = step.type in brief.blocks or not like
        steps.append(step if known else replace(step, type=rng.choice(like)))
    return Machine(tuple(steps))


def reduce(machine: Machine, target: Target, rng: random.Random) -> Machine | None:
    """Remove one block after the other until the machine is within the budget of blocks."""
    brief = target.task.brief
    roomy = replace(target.task, parameters=without_budget(target.task))
    while not check_machine(machine, brief).task_valid:
        moves = removals(machine, ())
        tried = [move(rng) for move in rng.sample(moves, min(TRIES, len(moves)))]
        fitting = [m for m in tried if m and check_machine(m, roomy.brief).task_valid]
        if not fitting or len(machine) <= len(brief.given):
            return None
        scores = {m: simulate(m, roomy, seed=target.seed).score or 0.0 for m in fitting}
        machine = max(fitting, key=lambda m: scores[m])
    return machine


def without_budget(task: Task) -> Parameters:
    """The parameters of a task without a budget of blocks."""
    assert isinstance(task, Family)
    blocks = task.parameters.blocks.model_copy(update={"max": 0})
    return task.parameters.model_copy(update={"blocks": blocks})
