"""Owns how prompt sets are shown: the list, one rendered prompt, the difference of two sets."""

from __future__ import annotations

from difflib import unified_diff
from typing import Any

from agentflow.agents.context import EXAMPLE
from agentflow.agents.registry import ROLES
from agentflow.errors import UsageError
from agentflow.machine import Machine, check
from agentflow.machine.brief import Brief
from agentflow.machine.formats.detect import read_for
from agentflow.machine.tree import ROOT, Step
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.prompts.render import PromptSet, token_estimate


def set_list() -> list[dict[str, Any]]:
    """Every shipped prompt set: name, content hash, roles, what it is for."""
    sets = [PromptSet(name) for name in PROMPT_SETS]
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
    asked, prompts = ROLES[role](), PromptSet(name)
    given = asked.sample(brief, _machine(brief, source))
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
