"""Owns how prompt sets are shown: the list, one rendered prompt, the difference of two sets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from difflib import unified_diff
from types import MappingProxyType
from typing import Any

from agentflow.agents.base import Role
from agentflow.agents.context import EXAMPLE
from agentflow.agents.designer import Designer, DesignerInput
from agentflow.agents.inspector import Inspector, InspectorInput
from agentflow.agents.meta_designer import MetaDesigner, MetaDesignerInput
from agentflow.agents.placer import Placer, PlacerInput
from agentflow.agents.querier import Querier, QuerierInput
from agentflow.agents.refiner import Refiner, RefinerInput
from agentflow.errors import UnknownNameError, UsageError
from agentflow.machine import Machine, check
from agentflow.machine.brief import Brief
from agentflow.machine.formats.detect import read_for
from agentflow.machine.tree import ROOT, Step
from agentflow.prompts.render import PromptSet, prompt_sets, token_estimate

REPORT = "Score: 0.00\nBroken: none"
"""Stands for what a simulation reports."""
Asked = tuple[Role[Any, Any], Any]

SAMPLES: Mapping[str, Callable[[Brief, Machine], Asked]] = MappingProxyType(
    {
        "meta_designer": lambda brief, _: (MetaDesigner(), MetaDesignerInput(brief)),
        "designer": lambda brief, _: (Designer(), DesignerInput(brief)),
        "inspector": lambda brief, found: (Inspector(), InspectorInput(brief, found)),
        "querier": lambda brief, found: (Querier(), QuerierInput(brief, found, 0.0, REPORT)),
        "refiner": lambda brief, found: (
            Refiner(),
            RefinerInput(brief, found, score=0.0, feedback=REPORT),
        ),
        "placer": lambda brief, _: (Placer(), PlacerInput(brief)),
    }
)
"""Role -> what it is asked first in a run, about a task and a machine."""


def set_list() -> list[dict[str, Any]]:
    """Every shipped prompt set: name, content hash, roles, what it is for."""
    sets = [PromptSet(name) for name in prompt_sets()]
    return [
        {"name": item.name, "digest": item.digest, "roles": item.roles, "about": item.about}
        for item in sets
    ]


def rendered(name: str, role: str, brief: Brief, source: str | None = None) -> dict[str, Any]:
    """One prompt as a model gets it, with its length.

    Args:
        name: of the prompt set.
        role: whose prompt.
        brief: the task.
        source: a machine as text, for the roles that are told one; None takes a small one.

    Raises:
        UnknownNameError: No such set or role.
        UsageError: The text holds no machine.
    """
    if role not in SAMPLES:
        raise UnknownNameError("role", role, SAMPLES)
    asked, given = SAMPLES[role](brief, _machine(brief, source))
    prompts = PromptSet(name)
    system, user = prompts.render(asked.name, asked.variables(given))
    return {
        "set": name,
        "digest": prompts.digest,
        "role": role,
        "task": brief.name,
        "system": system,
        "user": user,
        "tokens": token_estimate(system) + token_estimate(user),
    }


def difference(first: str, second: str) -> str:
    """The templates of two sets compared line by line; "" where they are equal."""
    one, other = PromptSet(first), PromptSet(second)
    lines: list[str] = []
    for template in sorted({*one.templates, *other.templates}):
        lines += unified_diff(
            one.source(template).splitlines(),
            other.source(template).splitlines(),
            f"{first}/{template}",
            f"{second}/{template}",
            lineterm="",
        )
    return "\n".join(lines)


def _machine(brief: Brief, source: str | None) -> Machine:
    if source is None:
        kind = EXAMPLE if EXAMPLE in brief.blocks else ROOT.type
        hung = (Step(1, kind, 0, 4),) if kind else ()
        return Machine((ROOT, *hung))
    report = check(read_for(brief, source), brief)
    if report.machine is None:
        raise UsageError(f"no machine to show: {report.problems[0].message}")
    return report.machine
