"""Owns how a search is written down: one event per search event, labelled by what it is about."""

from __future__ import annotations

from typing import Any

from agentflow.search.events import BackedUp, Expanded, SearchEvent, Selected, Simulated
from agentflow.search.node import SearchResult
from agentflow.workflows.base import Record


class SearchRecorder:
    """An observer that notes a search of machine versions under a label of its own."""

    def __init__(self, record: Record, label: str) -> None:
        """Note to `record` under "{label}/round-2", "{label}/node-7"."""
        self._record, self._label = record, label

    def __call__(self, event: SearchEvent) -> None:
        """Note one event."""
        round_ = f"{self._label}/round-{event.round}"
        if isinstance(event, Selected):
            self._record.event("select", round_, path=list(event.path))
        elif isinstance(event, Expanded):
            self._record.event("expand", round_, **_expansion(event))
        elif isinstance(event, Simulated):
            self._record.event("node", f"{self._label}/node-{event.node.id}", **_node(event))
        elif isinstance(event, BackedUp):
            node = f"{self._label}/node-{event.path[-1]}"
            self._record.event("back_up", node, path=list(event.path), reward=event.reward)

    def found(self, found: SearchResult[Any]) -> None:
        """Note the outcome."""
        cost = found.cost
        self._record.event(
            "search",
            self._label,
            result=found.result,
            best=found.best,
            stopped=found.stopped,
            expansions=cost.expansions,
            attempts=cost.attempts,
            valid=cost.valid,
            rollouts=cost.rollouts,
        )


def _expansion(event: Expanded) -> dict[str, Any]:
    return {
        "node": event.node,
        "attempts": [
            {"label": item.label, "valid": item.candidate is not None, "note": item.note}
            for item in event.attempts
        ],
        "children": list(event.children),
        "fallback": event.fallback,
    }


def _node(event: Simulated) -> dict[str, Any]:
    node = event.node
    return {
        "round": event.round,
        "parent": node.parent,
        "made_by": node.label,
        "machine": node.candidate.machine.digest,
        "valid": node.evaluation.valid,
        "score": node.evaluation.score,
    }
