"""The nodes of a run's tree that an agent made with tools."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from agentflow.metrics.failures import MAKING
from agentflow.report.nodes import REFUSED, LineageNode
from agentflow.runs.events import EvaluationEvent, ToolEvent


@dataclass
class ToolNodes:
    """Adds a node for each machine that a tool made, and for each that it refused."""

    used: bool = False
    """Whether any tool was called."""
    last_call: str = ""
    """Label of the last model call, in whose reply the tool was called."""
    _made: dict[str, str] = field(default_factory=dict)
    """Machine -> its node."""

    def add(self, event: ToolEvent, nodes: dict[str, LineageNode]) -> None:
        """Take in a call of a tool."""
        self.used = True
        known = event.machine is not None and event.machine in self._made
        if event.tool not in MAKING or known:
            return
        given: Mapping[str, Any] = event.arguments if isinstance(event.arguments, dict) else {}
        nodes[event.label] = LineageNode(
            id=event.label,
            parent=self._find(str(given.get("machine"))) if event.tool == "edit" else None,
            title=f"{event.tool}, call {event.place.call}",
            kind=REFUSED if event.refused else event.place.name,
            machine=event.machine,
            edit=str(given.get("script", "")),
            problem=event.answer if event.refused else "",
            calls=(self.last_call,) * bool(self.last_call),
        )
        if event.machine is not None:
            self._made[event.machine] = event.label

    def judge(self, event: EvaluationEvent, nodes: dict[str, LineageNode]) -> bool:
        """Add an evaluation to the machine's node; False if no tool made it."""
        label = self._made.get(event.machine)
        if label is None:
            return False
        nodes[label] = replace(
            nodes[label],
            score=event.score if event.valid else None,
            valid=event.valid,
            status=event.status,
            broken=bool(event.broken),
        )
        return True

    def _find(self, name: str) -> str | None:
        """The node of a machine by its name as an agent wrote it, or by its whole content hash."""
        wanted = name.strip().lower()
        made = self._made.items() if wanted else ()
        return next((node for machine, node in made if machine.startswith(wanted)), None)
