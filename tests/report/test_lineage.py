"""Which machine was made from which, by the events of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agentflow.report.lineage import Lineage, LineageNode
from agentflow.runs.events import (
    CandidateEvent,
    EditEvent,
    EvaluationEvent,
    ExpandAttempt,
    ExpandEvent,
    FirstAttempt,
    LocalTrial,
    LocalTrialsEvent,
    NodeEvent,
    RunEvent,
    RunStartEvent,
    ToolEvent,
    read_typed_events,
)
from agentflow.runs.locations import RANDOM_EDITS, Location
from tests.metrics.events import attempt as asked
from tests.metrics.events import evaluation

RECORDED = Path(__file__).parent.parent.parent / "runs" / "recorded-throwing"
Shown = tuple[str, "str | None", str, "float | None", bool]


def tried(label: str, machine: str, score: float | None, **data: Any) -> EvaluationEvent:
    return evaluation(label, score, machine, **data)


def outline(nodes: tuple[LineageNode, ...]) -> list[Shown]:
    return [(n.id, n.parent, n.title, n.score, n.lead) for n in nodes]


def test_a_recorded_run() -> None:
    scores = {
        event.machine: event.score
        for event in read_typed_events(RECORDED)
        if isinstance(event, EvaluationEvent)
    }
    top = max(scores, key=lambda machine: scores[machine] or 0.0)
    nodes = Lineage.of(read_typed_events(RECORDED)).finish(top)
    blind, feedback = "blind_refinement", "env_feedback"
    assert sorted((n.id, n.parent or "") for n in nodes) == [
        (f"{blind}/traj-1", "initial/traj-1"),
        (f"{blind}/traj-2", "initial/traj-2"),
        (f"{feedback}/traj-1/node-1", f"{blind}/traj-1"),
        (f"{feedback}/traj-1/node-2", f"{blind}/traj-1"),
        (f"{feedback}/traj-2/node-1", f"{blind}/traj-2"),
        (f"{feedback}/traj-2/node-2", f"{blind}/traj-2"),
        ("initial/traj-1", ""),
        ("initial/traj-2", ""),
    ]
    assert {n.machine: n.score for n in nodes} == scores
    (best,) = [n for n in nodes if n.best]
    assert best.machine == top
    known = {n.id: n for n in nodes}
    refined = known[f"{feedback}/traj-1/node-2"]
    assert refined.calls == ("refiner/feedback/traj-1/round-1/node-0/try-2/attempt-1",)
    assert refined.edit
    assert known[f"{blind}/traj-2"].calls == ("refiner/blind/traj-2/attempt-1",)
    assert known["initial/traj-1"].calls[-1].startswith("designer/structure-")


def test_a_refused_edit_hangs_on_what_it_was_to_refine() -> None:
    question = "refiner/feedback/traj-1/round-1/node-0/try-1/attempt-1"
    location = Location("env_feedback", trajectory=1, round=1)
    attempt = ExpandAttempt("round-1/node-0/try-1", valid=False, note="why")
    nodes = Lineage.of(
        [
            tried("initial/traj-1", "a", 1.0),
            asked(question, valid=False, script="Add 1 to 2 in 3"),
            ExpandEvent(location, 0, (attempt,), (), fallback=True),
        ]
    ).finish("a")
    assert outline(nodes) == [
        ("initial/traj-1", None, "first design 1", 1.0, True),
        (
            "env_feedback/traj-1/round-1/node-0/try-1",
            "initial/traj-1",
            "rejected edit",
            None,
            False,
        ),
    ]
    assert (nodes[1].kind, nodes[1].problem, nodes[1].edit) == ("refused", "why", "Add 1 to 2 in 3")
    assert nodes[1].calls == (question,)


def test_a_trajectory_without_a_machine_says_why() -> None:
    location = Location("initial", trajectory=2)
    ended = CandidateEvent(location, 2, None, False, None, FirstAttempt(), "overlap")
    call = "designer/traj-2/attempt-5"
    events = [asked(call, valid=False), ended]
    (node,) = Lineage.of(events).finish(None)
    assert (node.kind, node.machine, node.problem, node.calls) == (
        "invalid",
        None,
        "overlap",
        (call,),
    )


def test_random_edits_grow_from_the_last_that_was_kept() -> None:
    def edit(round_: int, machine: str, score: float, kept: bool) -> list[RunEvent]:
        label = f"env_feedback/traj-1/round-{round_}"
        return [tried(label, machine, score), EditEvent(Location.parse(label), "?", machine, kept)]

    events = [
        tried("initial/traj-1", "a", 1.0),
        *edit(1, "b", 2.0, True),
        *edit(2, "c", 0.0, False),
    ]
    nodes = Lineage.of([*events, *edit(3, "d", 3.0, True)]).finish(None)
    location = "env_feedback/traj-1/round"
    assert outline(nodes) == [
        ("initial/traj-1", None, "first design 1", 1.0, True),
        (f"{location}-1", "initial/traj-1", "design 1, round 1", 2.0, True),
        (f"{location}-2", f"{location}-1", "design 1, round 2", 0.0, False),
        (f"{location}-3", f"{location}-1", "design 1, round 3", 3.0, True),
    ]
    assert nodes[3].best


def test_where_random_edits_design_nothing_is_refined() -> None:
    titles = [
        [node.title for node in Lineage.of([start, event]).finish(None)]
        for event in [tried("blind_refinement/traj-1", "a", 1.0)]
        for model in (RANDOM_EDITS, "a model")
        for start in [RunStartEvent(Location("start"), "movement", "random-dsl", model)]
    ]
    assert titles == [
        ["design 1, random edits without simulation"],
        ["design 1, refinement without simulation"],
    ]


def test_what_the_computer_failed_at_has_no_score_and_is_not_best() -> None:
    events = [
        tried("initial/traj-1", "a", None, status="timeout"),
        tried("initial/traj-2", "b", -1.0, broken=((1, 0, 0.5),)),
        tried("initial/traj-3", "c", 0.0, valid=False, status="invalid"),
    ]
    nodes = Lineage.of(events).finish(None)
    assert [(n.score, n.valid, n.status, n.broken, n.best) for n in nodes] == [
        (None, True, "timeout", False, False),
        (-1.0, True, "ok", True, True),
        (None, False, "invalid", False, False),
    ]


def test_no_events_make_no_tree() -> None:
    assert Lineage.of([]).finish(None) == ()


def test_a_machine_whose_evaluation_is_lost_has_no_score() -> None:
    location = Location("env_feedback", trajectory=1, round=1)
    (node,) = Lineage.of([EditEvent(location, None, "a", kept=True)]).finish(None)
    assert (node.machine, node.score, node.valid, node.status) == ("a", None, False, "")


def test_machines_that_tools_made() -> None:
    def call(number: int, tool: str, made: str | None, **arguments: str) -> ToolEvent:
        location = Location("env_feedback", call=number)
        refused = made is None
        answer = "no" if refused else "yes"
        return ToolEvent(location, tool, arguments, refused, answer, machine=made)

    first, second = "aaaaaaaa11111111", "bbbbbbbb22222222"
    events: list[RunEvent] = [
        asked("agent/env_feedback/attempt-1"),
        call(1, "check", first, machine="[...]"),
        call(2, "simulate", first, machine=first[:8]),
        tried("env_feedback/traj-1/call-2", first, 1.0),
        call(3, "edit", second, machine=f" {first[:8].upper()} ", script="Remove 3"),
        call(4, "edit", None, machine=second[:8], script="Remove 99"),
        tried("env_feedback/traj-1/call-5", second, 2.0),
        tried("env_feedback/traj-1", second, 2.0),
        CandidateEvent(
            Location("env_feedback", trajectory=2), 2, None, False, None, FirstAttempt(), "none"
        ),
    ]
    nodes = Lineage.of(events).finish(second)
    assert outline(nodes) == [
        ("env_feedback/call-1", None, "machine 1", 1.0, True),
        ("env_feedback/call-3", "env_feedback/call-1", "machine 2", 2.0, True),
        ("env_feedback/call-4", "env_feedback/call-3", "refused edit", None, False),
    ]
    assert [node.kind for node in nodes] == ["env_feedback", "env_feedback", "refused"]
    assert nodes[1].edit == "Remove 3"
    assert {node.calls for node in nodes} == {("agent/env_feedback/attempt-1",)}


def test_the_machine_of_a_local_trial_is_shown_with_its_edit() -> None:
    search = "env_feedback/traj-1"
    trial = LocalTrial("Remove 2", "better", 3.0)
    events: list[RunEvent] = [
        tried("initial/traj-1", "first", 1.0),
        tried(f"{search}/candidate-1/node-0", "better", 3.0),
        LocalTrialsEvent(Location.parse(f"{search}/node-0"), "first", 1.0, (trial,), "told"),
        tried(f"{search}/node-1", "better", 3.0),
        NodeEvent(
            Location.parse(f"{search}/node-1"), 1, 0, "candidate-1/node-0", "better", True, 3.0
        ),
    ]
    first, better = Lineage.of(events).finish("better")
    assert (better.parent, better.edit, better.score) == (first.id, "Remove 2", 3.0)
    assert (better.best, first.lead) == (True, True)
