"""Owns how the validity of a machine in a reply is told to the model that sent it.

What is valid is decided by agentflow.machine; what else a role demands is the role's.
"""

from __future__ import annotations

from collections.abc import Sequence

from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.machine.validity import Problem, Report

COUNT = "required_count"
"""Code of having more or fewer blocks of a type than the task demands."""
MAX_TOLD = 8
"""Most problems told at once; the first are usually the cause of the others."""


def told(problems: Sequence[Problem]) -> str:
    """The problems as lines, the number of those left out last."""
    lines = [f"- {problem.message}" for problem in problems[:MAX_TOLD]]
    if len(problems) > MAX_TOLD:
        lines.append(f"- and {len(problems) - MAX_TOLD} more")
    return "\n".join(lines)


def shortcoming(
    machine: Machine, report: Report, brief: Brief, *, complete: bool
) -> tuple[str, str] | None:
    """Why a machine cannot be accepted, as (code, problem); None if it can.

    Args:
        machine: a file-valid machine.
        report: what validity says of it under the brief.
        brief: the task.
        complete: whether the machine is to be task-valid; one that is not must not have more of a
            type than the task wants, because nothing can take them away again.
    """
    if not report.machine_valid or (complete and not report.task_valid):
        problems = [item for item in report.problems if complete or item.code != COUNT]
        return problems[0].code, "The machine is not valid:\n" + told(problems)
    for kind, most in sorted(brief.required.items()):
        if machine.count(kind) > most:
            return (
                COUNT,
                f"The machine has {machine.count(kind)} blocks of type {kind}; "
                f"the task wants exactly {most}.",
            )
    return None
