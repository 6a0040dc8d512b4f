"""What today's rules say of the machines of earlier runs."""

from __future__ import annotations

from agentflow.machine import Brief, Machine, check
from agentflow.machine.problems import LATER_RULES


def later_note(machine: Machine, brief: Brief) -> str:
    """Why a recorded machine would now be refused, by rules that came after its run; or ""."""
    found = [item for item in check(machine, brief).problems if item.code in LATER_RULES]
    if not found:
        return ""
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return f"would now be refused: {found[0].message}{more}"
