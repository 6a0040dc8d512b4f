"""The edits of agents that work with tools: from one simulated machine to the next."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from agentflow.metrics.behaviour.measures import Edit
from agentflow.runs.events import AttemptEvent, EvaluationEvent, RunEvent, ToolEvent
from agentflow.runs.locations import FEEDBACK, Location
from agentflow.runs.reading import Event

NAME = 8
"""Characters of a content hash that name a machine to an agent."""


def agent_edits(events: Iterable[RunEvent | Event]) -> Iterator[Edit]:
    """The edits of an agent, in the order of their simulations.

    An agent may change a machine several times before it simulates it, so an edit leads from the
    nearest simulated ancestor. Machines that it wrote from scratch have no ancestor and are not
    edits. Edits are left out if a simulation of one of their machines crashed or timed out.
    """
    family, turn = _Family(), Location()
    for event in events:
        if isinstance(event, AttemptEvent):  # the calls of a reply come after it
            turn = event.location
        elif isinstance(event, ToolEvent):
            family.take_in(event, turn)
        elif isinstance(event, EvaluationEvent):
            family.names[event.machine[:NAME]] = event.machine
            if event.location.call:  # asked for by a tool, in this turn
                family.add_turn(event.machine, turn)
            yield from family.simulate(event)


class _Family:
    """The machines of a run, and which was made of which."""

    def __init__(self) -> None:
        self.names: dict[str, str] = {}
        """Name -> content hash."""
        self._parents: dict[str, tuple[str, bool]] = {}
        """Content hash -> that of the machine it was made of, and whether scores were known."""
        self._turns: dict[str, list[Location]] = {}
        """Content hash -> replies that made the machine or had it simulated."""
        self._results: dict[str, EvaluationEvent] = {}

    def take_in(self, event: ToolEvent, turn: Location) -> None:
        """Note whether a call has made a machine of another."""
        made = event.machine
        if made is None or event.refused:
            return
        self.names[made[:NAME]] = made
        sent = event.arguments if isinstance(event.arguments, Mapping) else {}
        parent = self.names.get(str(sent.get("machine")))
        if parent and made != parent and made not in self._parents:
            self._parents[made] = parent, event.location.name == FEEDBACK
            self.add_turn(made, turn)

    def add_turn(self, machine: str, turn: Location) -> None:
        """Note that a reply is about a machine."""
        turns = self._turns.setdefault(machine, [])
        if turn not in turns:
            turns.append(turn)

    def simulate(self, result: EvaluationEvent) -> Iterator[Edit]:
        """The edit that led to a machine, if this is its first simulation."""
        if result.machine in self._results:
            return
        self._results[result.machine] = result
        turns, seen, at, informed = list[Location](), set[str](), result.machine, True
        while at in self._parents and at not in seen:
            seen.add(at)
            turns += self._turns.get(at, ())
            at, told = self._parents[at]
            informed &= told
            if before := self._results.get(at):
                if None not in (before.score, result.score):
                    yield Edit(tuple(turns), before, result, informed)
                return
