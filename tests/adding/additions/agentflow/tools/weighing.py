"""A tool that weighs."""

from __future__ import annotations

from agentflow.machine.blocks.library import library
from agentflow.tools.results import ToolResult
from agentflow.tools.workspace import Call


async def weigh(call: Call, machine: str) -> ToolResult:
    """Weigh a machine.

    Args:
        machine: Name of the machine.
    """
    known = call.workspace.machines.find(machine)
    mass = sum(library()[step.type].mass for step in known.machine)
    return ToolResult(f"It weighs {mass:g} kg.", {"machine": known.name, "mass": mass})
