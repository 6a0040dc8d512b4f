"""The tree of a run: which machine was made from which.

It has a node for each evaluation of a machine, each refused edit of a search, and each trajectory
that ended without a machine; in a run with tools, for each machine that they made or refused.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from agentflow.report.nodes import INVALID, REFUSED, LineageNode
from agentflow.report.tool_nodes import ToolNodes
from agentflow.runs import Event
from agentflow.runs.events import (
    AttemptEvent,
    CandidateEvent,
    EditEvent,
    EvaluationEvent,
    ExpandEvent,
    NodeEvent,
    RunEvent,
    ToolEvent,
)
from agentflow.runs.places import Place


@dataclass
class Lineage:
    """Builds the tree from the events in order."""

    nodes: dict[str, LineageNode] = field(default_factory=dict)
    _newest: dict[int, str] = field(default_factory=dict)
    """Trajectory -> the node that its next stage starts from."""
    _roots: dict[Place, str | None] = field(default_factory=dict)
    """Search -> the node that it started from."""
    _evaluations: dict[str, EvaluationEvent] = field(default_factory=dict)
    """Machine -> its last evaluation."""
    _calls: dict[Place, list[str]] = field(default_factory=dict)
    """Place of a question, without its role -> labels of the calls."""
    _made: dict[str, list[Place]] = field(default_factory=dict)
    """Machine -> places of the calls that made it."""
    _scripts: dict[str, str] = field(default_factory=dict)
    """Label of a call -> the edits in its reply."""
    _tools: ToolNodes = field(default_factory=ToolNodes)

    @classmethod
    def of(cls, events: Iterable[RunEvent | Event]) -> Lineage:
        """Build the tree of a run."""
        lineage = cls()
        for event in events:
            lineage.add(event)
        return lineage

    def add(self, event: RunEvent | Event) -> None:
        """Take in one event; other kinds are ignored."""
        if isinstance(event, AttemptEvent):
            self._add_attempt(event)
        elif isinstance(event, EvaluationEvent):
            self._add_evaluation(event)
        elif isinstance(event, CandidateEvent):
            self._add_candidate(event)
        elif isinstance(event, ExpandEvent):
            self._add_refused(event)
        elif isinstance(event, NodeEvent):
            self._add_node(event)
        elif isinstance(event, EditEvent):
            self._add_edit(event)
        elif isinstance(event, ToolEvent):
            self._tools.add(event, self.nodes)

    def finish(self, machine: str | None) -> tuple[LineageNode, ...]:
        """All nodes, with the path to the result marked, or else to the best score."""
        scored = [n for n in self.nodes.values() if n.valid and n.score is not None]
        results = [n for n in scored if n.machine == machine] or scored
        best = max(results, key=lambda n: n.score or 0.0, default=None)
        path, at = set(), best
        while at is not None:
            path.add(at.id)
            at = self.nodes.get(at.parent or "")
        return tuple(
            replace(node, best=node == best, lead=node.id in path) for node in self.nodes.values()
        )

    def _add_attempt(self, event: AttemptEvent) -> None:
        self._tools.last_call = event.label
        question = replace(event.place, name="", structure=0, attempt=0)
        self._calls.setdefault(question, []).append(event.label)
        if event.machine is not None:
            self._made.setdefault(event.machine, []).append(event.place)
        if event.script:
            self._scripts[event.label] = event.script

    def _add_evaluation(self, event: EvaluationEvent) -> None:
        """Add a machine outside a search; those in one are added by a later event."""
        self._evaluations[event.machine] = event
        if self._tools.judge(event, self.nodes):
            return
        if event.place == replace(_search_of(event.place), try_=event.place.try_):
            newest = self.nodes.get(self._newest_at(event.place) or "")
            self._add_machine(event.place, event.machine, self._newest_at(event.place))
            score = newest.score if newest and event.place.try_ else None
            if score is None or (event.score or 0.0) > score:  # of trials, the best one goes on
                self._newest[event.place.trajectory] = event.label

    def _add_candidate(self, event: CandidateEvent) -> None:
        """Add a node with the reason for a trajectory that ended without a machine."""
        place, known = event.place, event.label in self.nodes or event.place in self._roots
        known = known or self._tools.used
        if event.machine is None and not known:
            self.nodes[event.label] = LineageNode(
                id=event.label,
                parent=self._newest_at(place),
                title=_title(place),
                kind=INVALID,
                problem=event.reason,
                calls=tuple(self._calls.get(Place(trajectory=place.trajectory), ())),
            )

    def _add_refused(self, event: ExpandEvent) -> None:
        """Attempts without a machine become children of the node that they refined."""
        search = _search_of(event.place)
        parent = self._node_id(search, event.node)
        for attempt in event.attempts:
            if not attempt.valid:
                calls, node_id = self._calls_of(search, attempt.label), f"{search}/{attempt.label}"
                self.nodes[node_id] = LineageNode(
                    id=node_id,
                    parent=parent,
                    title="rejected edit",
                    kind=REFUSED,
                    edit=self._script(calls),
                    problem=attempt.note,
                    calls=calls,
                )

    def _add_node(self, event: NodeEvent) -> None:
        search = _search_of(event.place)
        parent, calls = self._node_id(search, event.parent), self._calls_of(search, event.made_by)
        place = replace(event.place, round=event.round)
        self._add_machine(event.place, event.machine, parent, calls, _title(place))

    def _add_edit(self, event: EditEvent) -> None:
        """A random edit; the next one starts from the last one that was kept."""
        self._add_machine(event.place, event.machine, self._newest_at(event.place))
        if event.kept:
            self._newest[event.place.trajectory] = event.label

    def _newest_at(self, place: Place) -> str | None:
        return self._newest.get(place.trajectory)

    def _node_id(self, search: Place, number: int) -> str | None:
        """The id of a search's node; the root is the node that the trajectory had before."""
        root = self._roots.setdefault(search, self._newest_at(search))
        return root if number == 0 else str(replace(search, node=number))

    def _add_machine(
        self,
        place: Place,
        machine: str,
        parent: str | None,
        calls: tuple[str, ...] = (),
        title: str = "",
    ) -> None:
        known, made = self._evaluations.get(machine), self._made.get(machine, [])
        valid = known is not None and known.valid
        own = [call for call in made if call.trajectory == place.trajectory]
        calls = calls or tuple(map(str, own or made[-1:]))
        self.nodes[str(place)] = LineageNode(
            id=str(place),
            parent=parent,
            title=title or _title(place),
            kind=place.name,
            machine=machine,
            score=known.score if known and valid else None,
            valid=valid,
            status=known.status if known else "",
            broken=bool(known and known.broken),
            edit=self._script(calls),
            calls=calls,
        )

    def _calls_of(self, search: Place, attempt: str) -> tuple[str, ...]:
        """Labels of the calls of an attempt, whose label is relative to its search."""
        question = replace(Place.parse(attempt), trajectory=search.trajectory)
        return tuple(self._calls.get(question, ()))

    def _script(self, calls: tuple[str, ...]) -> str:
        return "\n".join(self._scripts[call] for call in calls if call in self._scripts)


def _search_of(place: Place) -> Place:
    """The search that a place is in: its stage and trajectory."""
    return Place(place.name, trajectory=place.trajectory)


def _title(place: Place) -> str:
    detail = f"round {place.round}" if place.round else place.name.replace("_", " ")
    detail += f", trial {place.try_ + 1}" if place.try_ else ""
    return f"trajectory {place.trajectory}, {detail}"
