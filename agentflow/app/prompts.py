"""Prompt sets: list them, render one prompt, compare two sets."""

from difflib import unified_diff
from typing import Any

from agentflow.agents.base import chat_prompt
from agentflow.agents.registry import ROLES
from agentflow.errors import UsageError
from agentflow.machine import Brief, Machine, check
from agentflow.machine.formats.detect import read_for
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.prompts.render import PromptSet
from agentflow.prompts.text import token_estimate


def list_prompt_sets() -> list[dict[str, Any]]:
    """Every prompt set: name, content hash, roles, purpose."""
    return [
        {"name": item.name, "digest": item.digest, "roles": item.roles, "about": item.about}
        for item in map(PromptSet, PROMPT_SETS)
    ]


def render_prompt(name: str, role: str, brief: Brief, source: str | None = None) -> dict[str, Any]:
    """A prompt as a model receives it, with its length.

    Args:
        name: Name of the prompt set.
        role: Role that uses the prompt.
        brief: The task.
        source: A machine as text, for roles that receive one; by default a small one.
    """
    prompts, machine = PromptSet(name), None if source is None else _machine(brief, source)
    system, user = (item["content"] for item in chat_prompt(ROLES[role], brief, name, machine))
    return {
        "set": name,
        "digest": prompts.digest,
        "role": role,
        "task": brief.name,
        "system": system,
        "user": user,
        "tokens": token_estimate(system) + token_estimate(user),
    }


def compare_prompt_sets(first: str, second: str) -> str:
    """Unified diff of the templates of two sets; "" if they are equal."""
    one, other = PromptSet(first), PromptSet(second)
    lines: list[str] = []
    for template in sorted({*one.files, *other.files}):
        lines += unified_diff(
            one.files.get(template, "").splitlines(),
            other.files.get(template, "").splitlines(),
            f"{first}/{template}",
            f"{second}/{template}",
            lineterm="",
        )
    return "\n".join(lines)


def _machine(brief: Brief, source: str) -> Machine:
    report = check(read_for(brief, source), brief)
    if report.machine is None:
        raise UsageError(f"no machine to show: {report.problems[0].message}")
    return report.machine
