"""The world of a bench: the run's laboratory, record and prompts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from agentflow.agents.tool_agent.role import Agent, AgentInput
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.runs.events import RunEvent
from agentflow.runs.places import Place
from agentflow.tools.world import View
from agentflow.workflows.base import SimulationSummary
from agentflow.workflows.context import WorkflowContext


class RunWorld:
    """Implements the `World` of a bench over a run of a workflow."""

    def __init__(self, run: WorkflowContext) -> None:
        self._run = run

    @property
    def brief(self) -> Brief:
        """The task as plain data."""
        return self._run.brief

    @property
    def brief_text(self) -> str:
        """The user prompt of the role `agent`."""
        return self._run.prompts_of(Agent(), AgentInput(**self._run.role_input))[1]

    def simulated(self, machine: Machine) -> SimulationSummary | None:
        """The result of a finished simulation; None without one."""
        evaluation = self._run.evaluation_of(machine)
        summary: SimulationSummary | None = evaluation.details if evaluation else None
        return summary

    async def simulate(self, machine: Machine, place: Place) -> SimulationSummary:
        """Simulate a machine; the only trajectory of an agent has the number 1."""
        evaluation = await self._run.evaluate(machine, replace(place, trajectory=1))
        summary: SimulationSummary = evaluation.details
        return summary

    async def query(self, machine: Machine, queries: Sequence[object], place: Place) -> str:
        """Recorded states of a simulated machine, as tables."""
        return await self._run.query(machine, queries, place)

    async def look(self, machine: Machine, view: View, time: float | None) -> bytes:
        """A PNG picture of a machine as built, or at a time of its simulation."""
        return await self._run.look(machine, view, time)

    def save(self, machine: Machine) -> None:
        """Store a machine by its content hash."""
        self._run.save(machine)

    def note(self, event: RunEvent) -> None:
        """Record an event."""
        self._run.note(event)
