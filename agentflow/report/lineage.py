"""The tree of a run: which machine was made from which.

It has a node for each evaluation of a machine, each refused edit of a search, and each trajectory
that ended without a machine; in a run with tools, for each machine that they made or refused.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from agentflow.metrics.failures import MAKING
from agentflow.runs import Event
from agentflow.runs.events import (
    AttemptEvent,
    CandidateEvent,
    EditEvent,
    EvaluationEvent,
    ExpandEvent,
    LocalTrialsEvent,
    NodeEvent,
    RunEvent,
    RunStartEvent,
    ToolEvent,
)
from agentflow.runs.locations import INITIAL, Location, stage_words

REFUSED, INVALID = "refused", "invalid"


@dataclass(frozen=True)
class LineageNode:
    """A node of the tree."""

    id: str
    parent: str | None
    title: str
    kind: str
    """Stage of the machine; `refused` for a refused edit, `invalid` for no machine."""
    machine: str | None = None
    """Content hash."""
    score: float | None = None
    valid: bool = False
    status: str = ""
    broken: bool = False
    edit: str = ""
    problem: str = ""
    calls: tuple[str, ...] = ()
    """Labels of the calls that made it."""
    best: bool = False
    """Whether it is the run's result."""
    lead: bool = False
    """Whether it is the result or one of its ancestors."""


@dataclass
class _ToolNodes:
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
            parent=self._find(str(given.get("machine" if event.tool == "edit" else "parent", ""))),
            title=f"machine {len(self._made) + 1}" if event.machine else f"refused {event.tool}",
            kind=REFUSED if event.refused else event.location.name,
            machine=event.machine,
            edit=str(given.get("script") or given.get("note") or ""),
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


@dataclass
class Lineage:
    """Builds the tree from the events in order."""

    nodes: dict[str, LineageNode] = field(default_factory=dict)
    _model: str = ""
    """What answered in the run."""
    _newest: dict[int, str] = field(default_factory=dict)
    """Trajectory -> the node that its next stage starts from."""
    _roots: dict[Location, str | None] = field(default_factory=dict)
    """Search -> the node that it started from."""
    _evaluations: dict[str, EvaluationEvent] = field(default_factory=dict)
    """Machine -> its last evaluation."""
    _calls: dict[Location, list[str]] = field(default_factory=dict)
    """Location of a question, without its role -> labels of the calls."""
    _made: dict[str, list[Location]] = field(default_factory=dict)
    """Machine -> locations of the calls that made it."""
    _scripts: dict[str, str] = field(default_factory=dict)
    """Label of a call -> the edits in its reply."""
    _tried: dict[str, str] = field(default_factory=dict)
    """Machine of a local trial -> the edit that made it."""
    _tools: _ToolNodes = field(default_factory=_ToolNodes)

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
        elif isinstance(event, LocalTrialsEvent):
            self._tried |= {trial.machine: trial.edit for trial in event.trials}
        elif isinstance(event, EditEvent):
            self._add_edit(event)
        elif isinstance(event, ToolEvent):
            self._tools.add(event, self.nodes)
        elif isinstance(event, RunStartEvent):
            self._model = event.model

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
        question = replace(event.location, name="", structure=0, attempt=0)
        self._calls.setdefault(question, []).append(event.label)
        if event.machine is not None:
            self._made.setdefault(event.machine, []).append(event.location)
        if event.script:
            self._scripts[event.label] = event.script

    def _add_evaluation(self, event: EvaluationEvent) -> None:
        """Add a machine outside a search; those in one are added by a later event."""
        self._evaluations[event.machine] = event
        if self._tools.judge(event, self.nodes):
            return
        if event.location == replace(_search_of(event.location), try_=event.location.try_):
            newest = self.nodes.get(self._newest_at(event.location) or "")
            self._add_machine(event.location, event.machine, self._newest_at(event.location))
            score = newest.score if newest and event.location.try_ else None
            if score is None or (event.score or 0.0) > score:  # of trials, the best one goes on
                self._newest[event.location.trajectory] = event.label

    def _add_candidate(self, event: CandidateEvent) -> None:
        """Add a node with the reason for a trajectory that ended without a machine."""
        location, known = event.location, event.label in self.nodes or event.location in self._roots
        known = known or self._tools.used
        if event.machine is None and not known:
            self.nodes[event.label] = LineageNode(
                id=event.label,
                parent=self._newest_at(location),
                title=_title(location, self._model),
                kind=INVALID,
                problem=event.reason,
                calls=tuple(self._calls.get(Location(trajectory=location.trajectory), ())),
            )

    def _add_refused(self, event: ExpandEvent) -> None:
        """Attempts without a machine become children of the node that they refined."""
        search = _search_of(event.location)
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
        search = _search_of(event.location)
        parent, calls = self._node_id(search, event.parent), self._calls_of(search, event.made_by)
        title = _title(replace(event.location, round=event.round), self._model)
        self._add_machine(event.location, event.machine, parent, calls, title)

    def _add_edit(self, event: EditEvent) -> None:
        """A random edit; the next one starts from the last one that was kept."""
        self._add_machine(event.location, event.machine, self._newest_at(event.location))
        if event.kept:
            self._newest[event.location.trajectory] = event.label

    def _newest_at(self, location: Location) -> str | None:
        return self._newest.get(location.trajectory)

    def _node_id(self, search: Location, number: int) -> str | None:
        """The id of a search's node; the root is the node that the trajectory had before."""
        root = self._roots.setdefault(search, self._newest_at(search))
        return root if number == 0 else str(replace(search, node=number))

    def _add_machine(
        self,
        location: Location,
        machine: str,
        parent: str | None,
        calls: tuple[str, ...] = (),
        title: str = "",
    ) -> None:
        known, made = self._evaluations.get(machine), self._made.get(machine, [])
        valid = known is not None and known.valid
        own = [call for call in made if call.trajectory == location.trajectory]
        calls = calls or tuple(map(str, own or made[-1:]))
        self.nodes[str(location)] = LineageNode(
            id=str(location),
            parent=parent,
            title=title or _title(location, self._model),
            kind=location.name,
            machine=machine,
            score=known.score if known and valid else None,
            valid=valid,
            status=known.status if known else "",
            broken=bool(known and known.broken),
            edit=self._script(calls) or self._tried.get(machine, ""),
            calls=calls,
        )

    def _calls_of(self, search: Location, attempt: str) -> tuple[str, ...]:
        """Labels of the calls of an attempt, whose label is relative to its search."""
        question = replace(Location.parse(attempt), trajectory=search.trajectory)
        return tuple(self._calls.get(question, ()))

    def _script(self, calls: tuple[str, ...]) -> str:
        return "\n".join(self._scripts[call] for call in calls if call in self._scripts)


def _search_of(location: Location) -> Location:
    """The search that a location is in: its stage and trajectory."""
    return Location(location.name, trajectory=location.trajectory)


def _title(location: Location, model: str) -> str:
    first = location.name == INITIAL and not location.round
    stage = f"round {location.round}" if location.round else stage_words(location.name, model)
    title = f"{'first ' * first}design {location.trajectory}" + f", {stage}" * (not first)
    return title + (f", trial {location.try_ + 1}" if location.try_ else "")
