"""Measures prompt lengths for every set, role and level-1 task, with machines of ten blocks.

    python benchmarks/prompts.py [SET ...]

Counts cl100k_base tokens if the tiktoken package and its vocabulary are available
(TIKTOKEN_CACHE_DIR), else uses the package's own estimate.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from typing import Any

from agentflow.agents.base import Role
from agentflow.agents.context import RoleInput
from agentflow.agents.designer import Designer, DesignerInput, Placer
from agentflow.agents.history import EditRecord, History
from agentflow.agents.inspector import Inspector, InspectorInput
from agentflow.agents.meta_designer import MetaDesigner, MetaDesignerInput
from agentflow.agents.querier import Querier, QuerierInput
from agentflow.agents.refiner import Refiner, RefinerInput
from agentflow.env.query import answer_queries
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.machine import Machine, read_machine
from agentflow.machine.brief import LONE_ROOT, Brief
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.prompts.render import PromptSet
from agentflow.prompts.text import token_estimate

FIT = 3440
"""Token limit of the compact set."""


def counter() -> tuple[str, Callable[[str], int]]:
    """Name of a tokenizer, and its function to count tokens."""
    try:
        import tiktoken

        encoding = tiktoken.get_encoding("cl100k_base")
    except (ImportError, OSError) as error:
        return f"estimate ({type(error).__name__}: no cl100k_base here)", token_estimate
    return "cl100k_base", lambda text: len(encoding.encode(text))


def ten_blocks(brief: Brief) -> Machine:
    """A frame with a mast, and the boulder on top if the task has one; without a motor where the
    task allows none."""
    blocks = [(1, 0, 0), (1, 0, 1), (15, 1, 1), (15, 1, 3), (15, 2, 1), (15, 2, 3), (63, 0, 4)]
    motor = 22 if 22 in brief.blocks else 15
    blocks += [(motor, 7, 5), (36, 7, 0) if 36 in brief.required else (63, 8, 3)]
    steps = [{"type": 0, "id": 0, "parent": -1, "face_id": -1}]
    for number, (kind, parent, face) in enumerate(blocks, start=1):
        steps.append({"type": kind, "id": number, "parent": parent, "face_id": face})
    machine = read_machine(steps, brief.blocks).machine
    assert machine is not None
    return machine


def prompt_inputs(name: str) -> Iterator[tuple[str, Role[Any, Any], Any]]:
    """Name, role and input of every prompt for a task; only the placer's if blocks are given."""
    task = get_task(name)
    if task.brief.given != LONE_ROOT:
        yield "placement", Placer(), RoleInput(task.brief)
        return
    brief, machine = task.brief, ten_blocks(task.brief)
    rollout = simulate(machine, task)
    feedback = rollout.feedback.text
    wanted = {"duration": [0.0, 3.0], "properties": ["position", "rotation", "velocity"]}
    states = answer_queries(machine, rollout, [{"id": block, **wanted} for block in (0, 3, 9)]).text
    history = History()
    for score in range(20):
        history = history.add(
            EditRecord("Add 15 to 3 in 2\nRemove 7", "Success", "", score, score + 1)
        )
    yield "plan", MetaDesigner(), MetaDesignerInput(brief)
    yield "detailed plan", MetaDesigner(), MetaDesignerInput(brief, detailed=True)
    yield "whole machine", Designer(), DesignerInput(brief)
    yield "extension", Designer(), DesignerInput(brief, machine=machine)
    yield "inspection", Inspector(), InspectorInput(brief, machine)
    yield "queries", Querier(), QuerierInput(brief, machine, 4.5, feedback)
    yield "blind", Refiner(), RefinerInput(brief, machine, critique="word " * 150)
    refinement = RefinerInput(brief, machine, None, "", history, 4.5, feedback, states)
    yield "feedback", Refiner(), refinement


def main(names: list[str]) -> None:
    tokenizer, count = counter()
    print(f"tokens by {tokenizer}; system + user, machine of 10 blocks")
    tasks = [name for name in task_names() if "/" not in name]
    for name in names or PROMPT_SETS:
        prompts = PromptSet(name)
        for task in tasks:
            for what, role, given in prompt_inputs(task):
                system, user = map(count, prompts.render(role.name, role.variables(given)))
                over = "" if system + user <= FIT else f"  over {FIT}"
                label = f"{name:<12}{task:<11}{role.name:<14}{what:<14}"
                print(f"{label}{system:>6} +{user:>6} ={system + user:>6}{over}")


if __name__ == "__main__":
    main(sys.argv[1:])
