"""The edits of agents, from events as a bench writes them."""

from __future__ import annotations

from typing import Any

from agentflow.metrics.behaviour import agent_edits
from agentflow.runs.events import EvaluationEvent, RunEvent, ToolEvent
from agentflow.runs.locations import BLIND, FEEDBACK, INITIAL, Location
from tests.metrics.events import attempt, evaluation

A, B, C, D = ("aaaaaaaa00", "bbbbbbbb00", "cccccccc00", "dddddddd00")


class Bench:
    """Writes what an agent does."""

    def __init__(self) -> None:
        self.events: list[RunEvent] = []
        self.calls = self.turns = 0
        self.stage: Any = FEEDBACK

    def turn(self) -> Location:
        self.turns += 1
        self.events.append(attempt(f"agent/{self.stage}/attempt-{self.turns}"))
        return self.events[-1].location

    def call(self, tool: str, machine: str, result: str, *, refused: bool = False) -> None:
        self.calls += 1
        location, sent = Location(self.stage, call=self.calls), {"machine": machine[:8]}
        made = None if refused else result
        self.events.append(ToolEvent(location, tool, sent, refused, "", machine=made))

    def simulate(self, machine: str, score: float | None) -> None:
        location = Location(self.stage, trajectory=1, call=self.calls + 1)
        self.events.append(evaluation(str(location), score, machine))
        self.call("simulate", machine, machine)

    def end(self, machine: str, score: float) -> None:
        """The simulation of what was submitted, after a stage without simulations."""
        self.events.append(evaluation(f"{self.stage}/traj-1", score, machine))


def test_an_edit_leads_from_one_simulated_machine_to_the_next() -> None:
    bench = Bench()
    bench.call("check", "[...]", A)
    bench.simulate(A, 1.0)
    first = bench.turn()
    bench.call("edit", A, B)
    bench.turn()  # looks at it
    second = bench.turn()
    bench.call("edit", B, C)
    bench.call("edit", C, D, refused=True)
    third = bench.turn()
    bench.simulate(C, 3.0)
    bench.simulate(C, 3.0)  # costs nothing, and is no second edit
    (edit,) = agent_edits(bench.events)
    assert (edit.before.machine, edit.after.machine, edit.informed) == (A, C, True)
    assert set(edit.replies) == {first, second, third}


def test_a_machine_that_was_written_anew_is_no_edit() -> None:
    bench = Bench()
    bench.simulate(A, 1.0)
    bench.call("check", "[...]", B)
    bench.simulate(B, 2.0)
    assert list(agent_edits(bench.events)) == []


def test_an_agent_knows_no_scores_before_the_last_stage() -> None:
    bench = Bench()
    bench.stage = INITIAL
    bench.call("check", "[...]", A)
    bench.end(A, 0.0)
    bench.stage = BLIND
    bench.call("edit", A, B)
    bench.end(B, 0.0)
    bench.stage = FEEDBACK
    bench.call("edit", B, C)
    bench.simulate(C, 1.0)
    assert [edit.informed for edit in agent_edits(bench.events)] == [False, True]


def test_simulations_without_a_score_are_left_out() -> None:
    bench = Bench()
    bench.simulate(A, 1.0)
    bench.call("edit", A, B)
    bench.simulate(B, None)
    bench.call("edit", B, C)
    bench.simulate(C, 1.0)
    assert list(agent_edits(bench.events)) == []
    assert isinstance(bench.events[0], EvaluationEvent)
