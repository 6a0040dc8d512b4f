"""Ask the procedural client as workflows do: real roles and prompts, no physics."""

from __future__ import annotations

from agentflow.agents.base import AskContext, RoleAttempt, ask
from agentflow.agents.designer import DesignedMachine, Designer, DesignerInput
from agentflow.agents.meta_designer import Blueprint, MetaDesigner, MetaDesignerInput
from agentflow.agents.refiner import Refiner, RefinerInput
from agentflow.agents.registry import scripts
from agentflow.env.tasks.registry import get_task
from agentflow.llm.messages import Message, Request
from agentflow.llm.procedural import ProceduralClient
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.prompts.render import PromptSet

PROMPTS = PromptSet()


def brief_of(task: str) -> Brief:
    return get_task(task).brief


def context(seed: int, tries: int = 1) -> AskContext:
    return AskContext(ProceduralClient(seed, scripts()), PROMPTS, max_retry=tries)


async def blueprint_of(brief: Brief, seed: int) -> Blueprint:
    outcome = await ask(MetaDesigner(), MetaDesignerInput(brief), context(seed), "meta")
    assert outcome.output is not None, outcome.attempts[0].parsed.problem
    return outcome.output


async def designs(brief: Brief, blueprint: Blueprint, seed: int, label: str) -> Machine | None:
    """The machine after the last structure; None if a structure could not be built."""
    machine: Machine | None = None
    last = blueprint.structures[-1].name
    for part in blueprint.structures:
        given = DesignerInput(brief, blueprint, part.name, machine, part.name == last)
        outcome = await ask(Designer(), given, context(seed, 5), f"{label}/{part.name}")
        if outcome.output is None:
            return None
        machine = outcome.output.machine
    return machine


async def whole_design(brief: Brief, seed: int, label: str = "whole") -> DesignedMachine | None:
    return (await ask(Designer(), DesignerInput(brief), context(seed, 5), label)).output


async def refinement(given: RefinerInput, seed: int, label: str = "refiner") -> RoleAttempt[object]:
    outcome = await ask(Refiner(), given, context(seed), label)
    return outcome.attempts[0]


def request(user: str, *, system: str = "", label: str = "x") -> Request:
    messages = (Message(role="system", text=system), Message(role="user", text=user))
    return Request(role="designer", label=label, messages=messages)
