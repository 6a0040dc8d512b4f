"""Records a search: one event of the run per event of the search."""

from dataclasses import replace
from typing import Any

from agentflow.machine.tree import Machine
from agentflow.runs.events import (
    ArchiveEvent,
    BackUpEvent,
    ExpandAttempt,
    ExpandEvent,
    NicheEvent,
    NodeEvent,
    RecordedAxis,
    SearchEndEvent,
    SelectEvent,
)
from agentflow.runs.locations import Location
from agentflow.search.events import (
    ArchiveOpened,
    BackedUp,
    Expanded,
    Filed,
    SearchEvent,
    Selected,
    Simulated,
)
from agentflow.search.node import Evaluation, Node, SearchResult
from agentflow.tools.host import SimulationSummary
from agentflow.workflows.base import GREATEST
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.stages.memory import Known


class SearchRecorder:
    """An observer that records the search at one location: a stage and a trajectory."""

    def __init__(
        self, run: WorkflowContext, location: Location, *, names_nodes: bool = False
    ) -> None:
        """Record at a location; `names_nodes`: a round may expand several nodes of it."""
        self._run, self._location, self._names_nodes = run, location, names_nodes
        self._known: dict[int, Known] = {}
        """Id of a node -> its machine."""

    def begin(self, machine: Machine, evaluation: Evaluation) -> None:
        """Remember the machine that a search begins with."""
        self._known[0] = Known(machine, evaluation)
        self._run.memory.learn(self._location.trajectory, self._known[0])

    def _learn(self, node: Node[Any]) -> None:
        """Remember a new machine, and what the edit did that made it."""
        known = self._known[node.id] = Known(node.candidate.machine, node.evaluation)
        origin = self._known.get(node.parent or 0)
        self._run.memory.learn(self._location.trajectory, known, origin)

    def __call__(self, event: SearchEvent) -> None:
        round_ = replace(self._location, round=event.round)
        if isinstance(event, Selected):
            self._run.note(SelectEvent(self._expansion(round_, event.path[-1]), event.path))
        elif isinstance(event, Expanded):
            attempts = tuple(
                ExpandAttempt(item.label, item.candidate is not None, item.note)
                for item in event.attempts
            )
            grown = (event.node, attempts, event.children, event.fallback)
            self._run.note(ExpandEvent(self._expansion(round_, event.node), *grown))
        elif isinstance(event, Simulated):
            node, evaluation = event.node, event.node.evaluation
            self._learn(node)
            made = (event.round, node.parent or 0, node.label, node.candidate.machine.digest)
            location = replace(self._location, node=node.id)
            self._run.note(NodeEvent(location, *made, evaluation.valid, evaluation.score))
        elif isinstance(event, BackedUp):
            location = replace(self._location, node=event.path[-1])
            self._run.note(BackUpEvent(location, event.path, event.reward))
        elif isinstance(event, ArchiveOpened):
            axes = tuple(RecordedAxis(**vars(axis)) for axis in event.axes)
            self._run.note(ArchiveEvent(self._location, axes))
        elif isinstance(event, Filed):
            self._run.note(self._niche(event))

    def _expansion(self, round_: Location, node: int) -> Location:
        """Where the expansion of a node is recorded."""
        return replace(round_, node=node) if self._names_nodes else round_

    def _niche(self, event: Filed) -> NicheEvent:
        node, filing = event.node, event.filing
        found: SimulationSummary = node.evaluation.details
        return NicheEvent(
            replace(self._location, node=node.id),
            event.round,
            node.candidate.machine.digest,
            node.evaluation.score,
            tuple(item.value for item in node.evaluation.measurements),
            filing.cell,
            filing.outcome,
            found.mechanism,
        )

    def finish(self, found: SearchResult[Any]) -> None:
        """Record the result."""
        self._run.reached_greatest |= found.perfect
        cost = found.cost
        counts = (cost.expansions, cost.attempts, cost.valid, cost.rollouts)
        reason = GREATEST if found.perfect else None
        self._run.note(
            SearchEndEvent(self._location, found.result, found.best, found.stopped, *counts, reason)
        )
