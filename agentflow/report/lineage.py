"""Owns which machine was made from which: the nodes of a run's tree, from its events.

One node per machine that was tried in a place of its own, one per refused edit of a search, one
per trajectory that ended without a machine.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from agentflow.runs import Event

TRAJECTORY = re.compile(r"traj-\d+")
REFUSED, INVALID = "refused", "invalid"


@dataclass(frozen=True)
class Node:
    """A place in the tree."""

    id: str
    parent: str | None
    title: str
    kind: str
    """Stage of what was tried; `refused` for an edit without a machine, `invalid` for nothing."""
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
    """Whether it is that, or on the way there."""

    def to_json(self) -> dict[str, Any]:
        """As the page reads it."""
        return asdict(self)


@dataclass
class Lineage:
    """The tree in the making; feed it the events in order."""

    nodes: dict[str, Node] = field(default_factory=dict)
    _newest: dict[str, str] = field(default_factory=dict)
    """Trajectory -> the node that its next stage begins with."""
    _roots: dict[str, str] = field(default_factory=dict)
    """Search label -> the node that it began with."""
    _tried: dict[str, Event] = field(default_factory=dict)
    """Machine -> its last evaluation."""
    _asked: dict[str, list[str]] = field(default_factory=dict)
    """What was asked for ("traj-1/round-2/node-0/try-1") -> labels of the calls."""
    _made: dict[str, list[str]] = field(default_factory=dict)
    """Machine -> labels of the calls that gave it."""
    _scripts: dict[str, str] = field(default_factory=dict)
    """Call -> the edits that it gave."""

    @classmethod
    def of(cls, events: Iterable[Event]) -> Lineage:
        """The tree of a run."""
        lineage = cls()
        for event in events:
            lineage.add(event)
        return lineage

    def add(self, event: Event) -> None:
        """Take in one event; kinds that say nothing of descent are passed over."""
        if event.kind == "attempt":
            self._answered(event)
        elif event.kind == "evaluation":
            self._evaluated(event)
        elif event.kind == "candidate":
            self._candidate(event)
        elif event.kind == "expand":
            self._expanded(event)
        elif event.kind == "node":
            self._simulated(event)
        elif event.kind == "edit":
            self._edited(event)

    def finished(self, machine: str | None) -> tuple[Node, ...]:
        """All nodes; what led to the result (or, without one, to the highest score) is marked."""
        tried = [n for n in self.nodes.values() if n.valid and n.score is not None]
        found = [n for n in tried if n.machine == machine] or tried
        best = max(found, key=lambda n: n.score or 0.0, default=None)
        way, at = set(), best
        while at is not None:
            way.add(at.id)
            at = self.nodes.get(at.parent or "")
        return tuple(
            replace(node, best=node == best, lead=node.id in way) for node in self.nodes.values()
        )

    def _answered(self, event: Event) -> None:
        """A call was answered."""
        asked = event.label[max(event.label.find("traj-"), 0) :].rpartition("/attempt-")[0]
        self._asked.setdefault(asked, []).append(event.label)
        if "machine" in event.data:
            self._made.setdefault(event.data["machine"], []).append(event.label)
        if event.data.get("script"):
            self._scripts[event.label] = event.data["script"]

    def _evaluated(self, event: Event) -> None:
        """A machine was simulated; where it stands in a search is told by a later event."""
        self._tried[event.data["machine"]] = event
        stage, place, *rest = event.label.split("/")
        if not rest:
            parent = self._newest.get(place)
            title = f"{place.replace('traj-', 'trajectory ')}, {stage.replace('_', ' ')}"
            self._new(event.label, parent, title, stage, event.data["machine"], place)
            self._newest[place] = event.label

    def _candidate(self, event: Event) -> None:
        """A trajectory that has nothing to show in a stage ends with a node that says why."""
        stage, place = event.label.split("/")[:2]
        if event.data["machine"] is None and not self._searched(stage, place):
            title = f"{place.replace('traj-', 'trajectory ')}, {stage.replace('_', ' ')}"
            problem = event.data["reason"]
            calls = tuple(self._asked.get(place, ()))
            parent = self._newest.get(place)
            node = Node(event.label, parent, title, INVALID, problem=problem, calls=calls)
            self.nodes[event.label] = node

    def _searched(self, stage: str, place: str) -> bool:
        return f"{stage}/{place}" in self._roots or f"{stage}/{place}" in self.nodes

    def _expanded(self, event: Event) -> None:
        """Attempts that gave no machine hang on the node that they were to refine."""
        search, _, _ = event.label.rpartition("/")
        place = _trajectory(search)
        parent = self._at(search, event.data["node"])
        for attempt in event.data["attempts"]:
            if attempt["valid"]:
                continue
            calls = self._calls(place, attempt["label"])
            node = Node(
                id=f"{search}/{attempt['label']}",
                parent=parent,
                title="refused edit",
                kind=REFUSED,
                edit=self._script(calls),
                problem=attempt["note"],
                calls=calls,
            )
            self.nodes[node.id] = node

    def _simulated(self, event: Event) -> None:
        search, _, _ = event.label.rpartition("/")
        data, place = event.data, _trajectory(search)
        calls = self._calls(place, data["made_by"])
        title = f"{place.replace('traj-', 'trajectory ')}, round {data['round']}"
        parent = self._at(search, data["parent"])
        stage = search.partition("/")[0]
        self._new(event.label, parent, title, stage, data["machine"], place, calls)

    def _edited(self, event: Event) -> None:
        """A random edit, which no model was asked for; kept ones are what the next begins with."""
        stage, place, round_ = event.label.split("/")
        title = f"{place.replace('traj-', 'trajectory ')}, {round_.replace('-', ' ')}"
        parent = self._newest.get(place)
        self._new(event.label, parent, title, stage, event.data["machine"], place)
        if event.data["kept"]:
            self._newest[place] = event.label

    def _at(self, search: str, number: int) -> str | None:
        """The id of a search's node; its root is what the trajectory had before."""
        root = self._roots.setdefault(search, self._newest.get(_trajectory(search), ""))
        return (root or None) if number == 0 else f"{search}/node-{number}"

    def _new(
        self,
        label: str,
        parent: str | None,
        title: str,
        stage: str,
        machine: str,
        place: str,
        calls: tuple[str, ...] = (),
    ) -> None:
        known = self._tried[machine].data
        written = [call for call in self._made.get(machine, ()) if f"/{place}/" in call]
        made = calls or tuple(written or self._made.get(machine, ())[-1:])
        self.nodes[label] = Node(
            id=label,
            parent=parent,
            title=title,
            kind=stage,
            machine=machine,
            score=known["score"] if known["valid"] else None,
            valid=known["valid"],
            status=known["status"],
            broken=bool(known["broken"]),
            edit=self._script(made),
            calls=made,
        )

    def _calls(self, place: str, made_by: str) -> tuple[str, ...]:
        return tuple(self._asked.get(f"{place}/{made_by}", ()))

    def _script(self, calls: tuple[str, ...]) -> str:
        return "\n".join(self._scripts[call] for call in calls if call in self._scripts)


def _trajectory(label: str) -> str:
    found = TRAJECTORY.search(label)
    return found.group() if found else ""
